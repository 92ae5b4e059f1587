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
    parse_in_range(text, 0.0, f32::MAX).filter(|number| *number > 0.0).ok_or_else(|| "use a number above 0".to_string())
}

/// Parses a finite number from 0.
///
/// # Errors
/// `text` is not such a number.
pub fn parse_non_negative(text: &str) -> Result<f32, String> {
    parse_in_range(text, 0.0, f32::MAX).ok_or_else(|| "use a number from 0".to_string())
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
