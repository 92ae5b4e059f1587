//! `--quality`: a level, or whatever there is time for.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::values::OrAuto;
use crate::budget::Quality;

/// A parser of quality levels.
pub fn level() -> impl TypedValueParser<Value = Quality> {
    PossibleValuesParser::new(Quality::ALL.map(Quality::name)).try_map(|name| name.parse::<Quality>())
}

/// A parser of quality levels and `auto`.
pub fn level_or_auto() -> impl TypedValueParser<Value = OrAuto<Quality>> {
    let names = ["auto"].into_iter().chain(Quality::ALL.map(Quality::name));
    PossibleValuesParser::new(names).try_map(|name| match &*name {
        "auto" => Ok::<_, String>(OrAuto::Auto),
        level => level.parse().map(OrAuto::This),
    })
}
