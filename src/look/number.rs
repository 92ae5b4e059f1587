//! Parses numbers in settings.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Parses a number from `low` to `high`; `None` for anything else.
pub(crate) fn parse_in_range(text: &str, low: f32, high: f32) -> Option<f32> {
    text.trim().parse().ok().filter(|number| (low..=high).contains(number))
}

/// Returns a parser of numbers within `range`, ends included.
pub fn in_range_parser(
    range: RangeInclusive<f32>,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    let (low, high) = range.into_inner();
    move |text| parse_in_range(text, low, high).ok_or_else(|| format!("use a number from {low} to {high}"))
}

/// Parses a finite number above 0.
///
/// # Errors
/// `text` is not such a number.
pub fn parse_positive(text: &str) -> Result<f32, String> {
    parse_in_range(text, 0.0, f32::MAX)
        .filter(|number| *number > 0.0)
        .ok_or_else(|| describe_finite(text, "use a number above 0"))
}

/// Parses a finite number from 0.
///
/// # Errors
/// `text` is not such a number.
pub fn parse_non_negative(text: &str) -> Result<f32, String> {
    parse_in_range(text, 0.0, f32::MAX).ok_or_else(|| describe_finite(text, "use a number from 0"))
}

/// Returns what is accepted instead of `text`: also the largest number, if that is exceeded.
fn describe_finite(text: &str, accepted: &str) -> String {
    let is_too_large = text.trim().parse().is_ok_and(|number: f32| number == f32::INFINITY);
    if is_too_large { format!("{accepted}, up to {:e}", f32::MAX) } else { accepted.to_owned() }
}

/// Returns a parser of whole numbers within `range`, ends included.
pub fn whole_number_parser<T: FromStr + PartialOrd + fmt::Display + Clone + Send + Sync + 'static>(
    range: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.trim().parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("use a whole number from {} to {}", range.start(), range.end()))
    }
}

/// Parses a whole number of things, at least one.
///
/// # Errors
/// `text` is not such a number.
pub fn parse_count<T: FromStr + PartialOrd + From<u8>>(text: &str) -> Result<T, String> {
    text.trim().parse().ok().filter(|count| *count >= T::from(1)).ok_or_else(|| "use a whole number from 1".to_owned())
}

/// Parses the value of a switch: true or false, and other words for them.
///
/// # Errors
/// `text` is another word.
pub fn parse_switch(text: &str) -> Result<bool, String> {
    match text.trim().to_lowercase().as_str() {
        "true" | "t" | "yes" | "y" | "on" | "1" => Ok(true),
        "false" | "f" | "no" | "n" | "off" | "0" => Ok(false),
        _ => Err("use true or false".to_owned()),
    }
}

/// A value, or `auto`, which the picture or the quality level determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrAuto<T> {
    /// `auto`.
    Auto,
    /// An explicit value.
    Value(T),
}

impl<T> OrAuto<T> {
    /// Returns the explicit value, if any.
    pub fn value(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Value(value) => Some(value),
        }
    }

    /// Extends the parser `parse` by `auto`. Errors of parsers say what is accepted.
    pub fn parser(
        parse: impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static,
    ) -> impl Fn(&str) -> Result<Self, String> + Clone + Send + Sync + 'static {
        move |text| match text {
            "auto" => Ok(Self::Auto),
            value => parse(value).map(Self::Value).map_err(|accepted| format!("{accepted}, or auto")),
        }
    }
}

impl<T> From<Option<T>> for OrAuto<T> {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Auto, Self::Value)
    }
}

impl<T: FromStr<Err = String> + 'static> FromStr for OrAuto<T> {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        Self::parser(T::from_str)(text)
    }
}

impl<T: fmt::Display> fmt::Display for OrAuto<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Value(value) => value.fmt(f),
        }
    }
}
