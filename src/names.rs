//! Enumerations whose values have the same names on the command line, in files and in the window; and suggestions for
//! misspelt names.

use std::any::type_name;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::Mutex;

/// An enumeration whose values have names.
pub trait Named: Copy + PartialEq + 'static {
    /// All values, in the order in which they are shown.
    const VALUES: &'static [Self];

    fn name(self) -> &'static str;

    /// Returns a one-line description of the value.
    fn help(self) -> &'static str;

    /// Returns the names of earlier versions that mean this value now: they are accepted, but not listed.
    fn former_names(self) -> &'static [&'static str];
}

/// Parses the name of a value. Warns of a former name once, as a text is parsed several times.
///
/// # Errors
/// No value has this name; the message lists the accepted names.
pub fn parse_name<T: Named>(text: &str) -> Result<T, String> {
    if let Some(line) = describe_former_name::<T>(text)
        && FORMER_NAMES.lock().is_ok_and(|mut warned| warned.insert(line.clone()))
    {
        tracing::warn!("{line}");
    }
    let is_meant = |value: &T| value.name() == text || value.former_names().contains(&text);
    T::VALUES.iter().copied().find(is_meant).ok_or_else(|| {
        let mut accepted = String::from("use ");
        for (k, value) in T::VALUES.iter().enumerate() {
            let separator = match k {
                0 => "",
                _ if k + 1 == T::VALUES.len() => " or ",
                _ => ", ",
            };
            // Writing to a String cannot fail.
            let _ = write!(accepted, "{separator}{}", value.name());
        }
        accepted
    })
}

/// Returns a line on what a former name means now; `None` for any other text.
pub fn describe_former_name<T: Named>(text: &str) -> Option<String> {
    let value = T::VALUES.iter().find(|value| value.former_names().contains(&text))?;
    let kind = type_name::<T>().rsplit("::").next().unwrap_or_default().to_lowercase();
    Some(format!("{kind} {text} is called {} now", value.name()))
}

/// Lines on the former names that were parsed so far.
static FORMER_NAMES: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Logs the warnings of former names again: for a logger that starts after the command line is parsed.
pub fn repeat_warnings() {
    FORMER_NAMES.lock().iter().flat_map(|lines| lines.iter()).for_each(|line| tracing::warn!("{line}"));
}

/// Smallest Jaro-Winkler similarity (0 to 1) of a suggestion: one or two typos in a word of usual length.
const MIN_SIMILARITY: f64 = 0.8;

/// Returns the most similar of these names, if any is similar enough to be meant.
pub fn find_similar<N: AsRef<str>>(name: &str, names: impl IntoIterator<Item = N>) -> Option<N> {
    let name = name.to_lowercase();
    let similarity = |other: &N| strsim::jaro_winkler(&name, &other.as_ref().to_lowercase());
    let rated = names
        .into_iter()
        .map(|other| (similarity(&other), other))
        .filter(|(similarity, _)| *similarity >= MIN_SIMILARITY);
    rated.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| other)
}

/// Implements [`Named`] for an enumeration: `named! { pub enum Name default Value { /// help Value = "value" once
/// "former name", ... } }`.
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $vis:vis enum $name:ident default $default:ident {
        $($(#[doc = $help:literal])+ $value:ident = $text:literal $(once $former:literal)*),+ $(,)?
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        $vis enum $name { $($(#[doc = $help])+ $value),+ }

        impl $name {
            /// All values, in the order in which they are shown.
            pub const ALL: [Self; [$($text),+].len()] = [$(Self::$value),+];

            /// The value's name.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$value => $text),+ }
            }
        }

        impl $crate::names::Named for $name {
            const VALUES: &'static [Self] = &Self::ALL;

            fn name(self) -> &'static str {
                $name::name(self)
            }

            fn help(self) -> &'static str {
                match self { $(Self::$value => concat!($($help),+).trim_start()),+ }
            }

            fn former_names(self) -> &'static [&'static str] {
                match self { $(Self::$value => &[$($former),*]),+ }
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::$default
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str($crate::names::Named::name(*self))
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;
            fn from_str(text: &str) -> Result<Self, String> {
                $crate::names::parse_name(text)
            }
        }
    };
}
pub use named;

#[cfg(test)]
mod tests {
    named! {
        enum Meal default Tea {
            /// Hot
            Tea = "tea",
            /// Cold,
            /// sweet
            Ice = "ice-cream",
            /// For birds
            Seed = "seed" once "corn" once "grain",
        }
    }

    use super::{Named, describe_former_name};

    #[test]
    fn values_are_read_as_they_are_written() {
        for meal in Meal::ALL {
            assert_eq!(meal.to_string().parse(), Ok(meal));
        }
        assert_eq!((Meal::default(), Meal::Ice.help()), (Meal::Tea, "Cold, sweet"));
        assert_eq!("Tea".parse::<Meal>(), Err("use tea, ice-cream or seed".to_string()));
    }

    #[test]
    fn former_names_are_read_and_explained() {
        assert_eq!(["corn", "grain"].map(str::parse), [Ok(Meal::Seed), Ok(Meal::Seed)]);
        assert_eq!(describe_former_name::<Meal>("corn").unwrap(), "meal corn is called seed now");
        assert_eq!(["seed", "wheat"].map(describe_former_name::<Meal>), [None, None]);
    }
}
