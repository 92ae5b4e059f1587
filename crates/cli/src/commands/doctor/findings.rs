//! Runs all checks, and prints their findings.

use std::fmt::Write as _;

use serde::Serialize;

use super::finding::{Finding, Level};
#[cfg(feature = "pipewire")]
use super::pipewire_camera;
use super::system::System;
use super::{CliError, cameras, computing, loopback};
use crate::terminal::print;
use bokehcam::v4l2::node::{Node, nodes};

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
        let nodes = nodes();
        let mut findings = cameras::findings(&nodes, &system);
        findings.extend(loopback::findings(&nodes, &system));
        #[cfg(feature = "pipewire")]
        {
            let verdict = pipewire_camera::check(&system);
            // One kind of camera source is enough, and one kind of virtual camera.
            for finding in findings.iter_mut().filter(|finding| finding.level == Level::Missing) {
                let is_camera = finding.about == cameras::ABOUT;
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
        findings.extend(computing::findings());
        Self { system, nodes, findings }
    }

    /// Returns the essential topics with something missing.
    fn missing(&self) -> Vec<&'static str> {
        let is_missing = |about: &&str| self.findings.iter().any(|f| f.about == *about && f.level == Level::Missing);
        [cameras::ABOUT, loopback::ABOUT].into_iter().filter(is_missing).collect()
    }

    /// Formats the findings as text.
    pub fn text(&self) -> String {
        text(&self.findings)
    }
}

/// Runs all checks and prints the findings.
///
/// # Errors
/// [`CliError::NotReady`] if something essential is missing.
pub fn run(json: bool) -> Result<(), CliError> {
    let examined = CheckResults::collect();
    let missing = examined.missing();
    if json {
        let report = Report { ready: missing.is_empty(), system: &examined.system, findings: &examined.findings };
        print((serde_json::to_string_pretty(&report).unwrap_or_default() + "\n").as_bytes())?;
    } else {
        print((examined.system.to_string() + &examined.text()).as_bytes())?;
    }
    if missing.is_empty() { Ok(()) } else { Err(CliError::NotReady(missing.join(" and no "))) }
}

/// Formats findings as text, each group under a heading.
fn text(findings: &[Finding]) -> String {
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
