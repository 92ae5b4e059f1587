//! Runs all checks, and prints their findings.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use super::finding::{Finding, Level, PipeWireResults};
use super::system::System;
use super::{CliError, cameras, computing, loopback, pipewire_camera, settings};
use crate::terminal::print_to_stdout;
use bokehcam_live::v4l2::node::{Node, list_nodes};

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
    /// Runs all checks. `config` is the chosen settings file.
    pub fn collect(config: Option<&Path>) -> Self {
        let system = System::detect();
        let nodes = list_nodes();
        let mut findings = cameras::check_cameras(&nodes, &system);
        findings.extend(loopback::check_loopback(&nodes, &system));
        let mut findings = add_pipewire(findings, pipewire_camera::check_pipewire(&system), &system);
        findings.extend(computing::check_computing());
        findings.extend(settings::check_settings(config));
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

/// Adds the results of PipeWire to findings about devices: one kind of camera is enough, and one kind of virtual camera.
fn add_pipewire(mut findings: Vec<Finding>, verdict: PipeWireResults, system: &System) -> Vec<Finding> {
    let PipeWireResults { findings: others, can_publish, cameras } = verdict;
    let has_cameras = !cameras.is_empty();
    let none = cameras::report_none(system);
    if let Some(finding) = findings.iter_mut().find(|finding| has_cameras && **finding == none) {
        *finding = Finding::good(cameras::TOPIC, format!("by PipeWire: {}", cameras.join(", ")));
    }
    for finding in findings.iter_mut().filter(|finding| finding.level == Level::Missing) {
        let is_optional = if finding.about == cameras::TOPIC { has_cameras } else { can_publish };
        finding.level = if is_optional { Level::Note } else { Level::Missing };
    }
    findings.extend(others);
    findings
}

/// Runs all checks and prints the findings.
///
/// # Errors
/// [`CliError::NotReady`] if something essential is missing.
pub fn run(json: bool, config: Option<&Path>) -> Result<(), CliError> {
    let examined = CheckResults::collect(config);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_of_pipewire_is_a_camera() {
        let system = System::detect();
        let devices = || cameras::check_cameras(&[], &system);
        let topics = |cameras: &[&str]| {
            let cameras = cameras.iter().map(ToString::to_string).collect();
            let verdict = PipeWireResults { findings: Vec::new(), can_publish: true, cameras };
            let findings = add_pipewire(devices(), verdict, &system);
            findings.into_iter().map(|finding| (finding.level, finding.found)).collect::<Vec<_>>()
        };
        assert_eq!(topics(&["Integrated Webcam"]), [(Level::Good, "by PipeWire: Integrated Webcam".to_owned())]);
        assert_eq!(topics(&[]), [(Level::Missing, "there is none".to_owned())]);
    }
}
