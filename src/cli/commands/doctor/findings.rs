//! Findings: what is collected, and how it is told.

use std::fmt::Write as _;

use serde::Serialize;

use super::finding::{Finding, Level};
use super::system::System;
use super::{CliError, cameras, computing, loopback};
use crate::cli::terminal::print;
use crate::v4l2::node::nodes;

#[derive(Serialize)]
struct Told<'a> {
    ready: bool,
    system: &'a System,
    findings: &'a [Finding],
}

/// Looks at everything, and tells it.
///
/// # Errors
/// Something essential is missing.
pub fn run(json: bool) -> Result<(), CliError> {
    let system = System::look();
    let nodes = nodes();
    let mut findings = cameras::look(&nodes, &system);
    findings.extend(loopback::look(&nodes, &system));
    findings.extend(computing::look());
    let missing: Vec<&str> = [cameras::ABOUT, loopback::ABOUT]
        .into_iter()
        .filter(|about| findings.iter().any(|f| f.about == *about && f.level == Level::Missing))
        .collect();
    if json {
        let told = Told { ready: missing.is_empty(), system: &system, findings: &findings };
        print((serde_json::to_string_pretty(&told).unwrap_or_default() + "\n").as_bytes())?;
    } else {
        print(text(&system, &findings).as_bytes())?;
    }
    if missing.is_empty() { Ok(()) } else { Err(CliError::NotReady(missing.join(" and no "))) }
}

fn text(system: &System, findings: &[Finding]) -> String {
    let mut out = system.to_string();
    let mut about = "";
    for finding in findings {
        if finding.about != about {
            about = finding.about;
            // Writing to a string does not fail.
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
