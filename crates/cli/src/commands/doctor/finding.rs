//! The result of one check, and what to do about it.

use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// No problem.
    Good,
    /// Works, but could be better.
    Note,
    /// Something essential is missing.
    Missing,
}

/// The result of one check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Topic, and heading of its group.
    pub about: &'static str,
    /// Severity.
    pub level: Level,
    pub found: String,
    /// Recommended action, if any.
    pub fix: Option<String>,
}

impl Finding {
    pub fn good(about: &'static str, found: impl Into<String>) -> Self {
        Self { about, level: Level::Good, found: found.into(), fix: None }
    }

    /// Returns a finding that works, but could be better.
    pub fn note(about: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { about, level: Level::Note, found: found.into(), fix: Some(fix.into()) }
    }

    /// Returns a finding that does not work.
    pub fn missing(about: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { about, level: Level::Missing, found: found.into(), fix: Some(fix.into()) }
    }
}

/// Results of the PipeWire checks.
pub struct PipeWireResults {
    pub findings: Vec<Finding>,
    /// Whether this program can publish a camera that others can read.
    pub can_publish: bool,
    /// The cameras to read from, by the names that people see.
    pub cameras: Vec<String>,
}
