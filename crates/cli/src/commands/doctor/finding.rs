//! The result of one check, and what to do about it.

use serde::Serialize;

/// How good a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Good,
    /// Works, and could be better.
    Note,
    /// Something essential is missing.
    Missing,
}

/// The result of one check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub about: &'static str,
    /// How good it is.
    pub level: Level,
    pub found: String,
    /// What to do about it.
    pub fix: Option<String>,
}

impl Finding {
    pub fn good(about: &'static str, found: impl Into<String>) -> Self {
        Self { about, level: Level::Good, found: found.into(), fix: None }
    }

    /// It works, and could be better.
    pub fn note(about: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { about, level: Level::Note, found: found.into(), fix: Some(fix.into()) }
    }

    /// It does not work.
    pub fn missing(about: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { about, level: Level::Missing, found: found.into(), fix: Some(fix.into()) }
    }
}
