//! Runs all checks, and prints their findings.

use std::fmt::Write as _;

use serde::Serialize;

use super::finding::{Finding, Level};
#[cfg(feature = "pipewire")]
use super::pipewire_camera;
use super::system::System;
use super::{CliError, cameras, computing, loopback};
use crate::terminal::print_to_stdout;
use bokehcam::v4l2::node::{Node, list_nodes};

/// The JSON form of everything that was found.
#[derive(Serialize)]
struct Report<'a> {
    ready: bool,
    system: &'a System,
    findings: &'a [Finding],
}

/// Results of all checks.
pub struct CheckResults {
    pub system: System,
    pub nodes: Vec<Node>,
    findings: Vec<Finding>,
}

impl CheckResults {
    /// Runs all checks.
    pub fn collect() -> Self {
        let system = System::detect();
        let nodes = list_nodes();
        let mut findings = cameras::check_cameras(&nodes, &system);
        findings.extend(loopback::check_loopback(&nodes, &system));
        #[cfg(feature = "pipewire")]
        {
            let verdict = pipewire_camera::check_pipewire(&system);
            // One kind of camera source is enough, and one kind of virtual camera.
            for finding in findings.iter_mut().filter(|finding| finding.level == Level::Missing) {
                let is_camera = finding.about == cameras::TOPIC;
                let is_optional = if is_camera { verdict.has_cameras } else { verdict.can_publish };
                finding.level = if is_optional { Level::Note } else { Level::Missing };
            }
            findings.extend(verdict.findings);
        }
        #[cfg(not(feature = "pipewire"))]
        findings.push(Finding::note(
            "PipeWire",
            "this program was built without it",
            "build it with the feature pipewire",
        ));
        findings.extend(computing::check_computing());
        Self { system, nodes, findings }
    }

    /// Returns the essential topics with something missing.
    fn missing_topics(&self) -> Vec<&'static str> {
        let is_missing = |about: &&str| self.findings.iter().any(|f| f.about == *about && f.level == Level::Missing);
        [cameras::TOPIC, loopback::TOPIC].into_iter().filter(is_missing).collect()
    }

    /// Formats the findings as text.
    pub fn format_text(&self) -> String {
        format_findings(&self.findings)
    }
}

/// Runs all checks and prints the findings.
///
/// # Errors
/// [`CliError::NotReady`] if something essential is missing.
pub fn run(json: bool) -> Result<(), CliError> {
    let examined = CheckResults::collect();
    let missing = examined.missing_topics();
    if json {
        let report = Report { ready: missing.is_empty(), system: &examined.system, findings: &examined.findings };
        print_to_stdout((serde_json::to_string_pretty(&report).unwrap_or_default() + "\n").as_bytes())?;
    } else {
        print_to_stdout((examined.system.to_string() + &examined.format_text()).as_bytes())?;
    }
    if missing.is_empty() { Ok(()) } else { Err(CliError::NotReady(missing.join(" and no "))) }
}

/// Formats findings as text, each group under a heading.
fn format_findings(findings: &[Finding]) -> String {
    let mut out = String::new();
    let mut about = "";
    for finding in findings {
        if finding.about != about {
            about = finding.about;
            // Writing to a string cannot fail.
            let _ = write!(out, "\n{about}\n");
        }
        let mark = match finding.level {
            Level::Good => "good   ",
            Level::Note => "note   ",
            Level::Missing => "MISSING",
        };
        let _ = writeln!(out, "  {mark}  {}", finding.found);
        if let Some(fix) = &finding.fix {
            let _ = writeln!(out, "           -> {fix}");
        }
    }
    out
}
