//! Enumerations whose values have the same names on the command line, in files and in the window; and suggestions for
//! misspelt names.

use std::fmt::Write;

/// An enumeration whose values have names.
pub trait Named: Copy + PartialEq + 'static {
    /// All values, in the order in which they are shown.
    const VALUES: &'static [Self];

    fn name(self) -> &'static str;

    /// Returns a one-line description of the value.
    fn help(self) -> &'static str;
}

/// Parses the name of a value.
///
/// # Errors
/// No value has this name; the message lists the accepted names.
pub fn parse_name<T: Named>(text: &str) -> Result<T, String> {
    T::VALUES.iter().copied().find(|value| value.name() == text).ok_or_else(|| {
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

/// Implements [`Named`] for an enumeration: `named! { pub enum Name default Value { /// help Value = "value", ... } }`.
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $vis:vis enum $name:ident default $default:ident {
        $($(#[doc = $help:literal])+ $value:ident = $text:literal),+ $(,)?
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
            Seed = "seed",
        }
    }

    use super::Named;

    #[test]
    fn values_are_read_as_they_are_written() {
        for meal in Meal::ALL {
            assert_eq!(meal.to_string().parse(), Ok(meal));
        }
        assert_eq!((Meal::default(), Meal::Ice.help()), (Meal::Tea, "Cold, sweet"));
        assert_eq!("Tea".parse::<Meal>(), Err("use tea, ice-cream or seed".to_string()));
    }
}
