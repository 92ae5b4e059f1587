//! `--quality`: a level, or whatever there is time for.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::budget::Quality;

/// How finely to blur, as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityChoice {
    /// As the time allows, where there is a time to keep.
    Auto,
    /// This level.
    Level(Quality),
}

impl QualityChoice {
    /// The level, where one is chosen.
    pub fn level(self) -> Option<Quality> {
        match self {
            Self::Auto => None,
            Self::Level(quality) => Some(quality),
        }
    }
}

/// A parser of quality levels.
pub fn level() -> impl TypedValueParser<Value = Quality> {
    PossibleValuesParser::new(Quality::ALL.map(Quality::name)).try_map(|name| name.parse::<Quality>())
}

/// A parser of quality levels and `auto`.
pub fn level_or_auto() -> impl TypedValueParser<Value = QualityChoice> {
    let names = ["auto"].into_iter().chain(Quality::ALL.map(Quality::name));
    PossibleValuesParser::new(names).try_map(|name| match &*name {
        "auto" => Ok::<_, String>(QualityChoice::Auto),
        level => level.parse().map(QualityChoice::Level),
    })
}
