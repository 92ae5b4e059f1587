//! A report of this machine for others, as a form: what was found, without what is nobody's business.

use std::fmt::Write as _;
use std::path::Path;

use super::findings::Examined;
use super::private::Private;
use super::{CliError, hardware};
use crate::commands::{bench, devices};
use crate::files::{refuse_overwrite, write_whole};
use crate::terminal::{print, say};

/// What the reader of a report wants to know first, for its writer to fill in.
const FORM: &str = "\
<!-- Made by `bokehcam doctor --report`. Names of users, their folders, the name of this machine and serial numbers are taken
out; no picture was taken, nothing was sent. Read it all before you give it to others. -->

### What works, and what does not

<!-- The command, what you saw, what you expected. \"All well\" helps, too. -->

";

/// Prints a report of this machine and, with `file`, writes it.
///
/// # Errors
/// There is such a file, or it cannot be written.
pub fn run(file: Option<&Path>) -> Result<(), CliError> {
    refuse_overwrite(file, false).map_err(stays)?;
    let examined = Examined::here();
    let mut facts = String::new();
    section(&mut facts, "Machine", &(examined.system.to_string() + "\n" + &hardware::lines().join("\n")));
    section(&mut facts, "Cameras", &devices::formats(&examined.nodes));
    section(&mut facts, "What doctor found", &examined.text());
    section(&mut facts, "Time of the blur", &bench::short());
    let report = FORM.to_owned() + &Private::here().taken_out(&facts);
    print(report.as_bytes())?;
    match file {
        Some(file) => {
            write_whole(file, report.as_bytes(), false).map_err(stays)?;
            say(&format!("this report is in {}, and nowhere else", file.display()));
        }
        None => say("this report was printed, and not kept: `bokehcam doctor --report FILE` writes it, too"),
    }
    Ok(())
}

/// Here is no way to overwrite.
fn stays(error: CliError) -> CliError {
    match error {
        CliError::Exists(path) => CliError::Stays(path),
        other => other,
    }
}

/// Adds a part of the report, as it would be printed.
fn section(report: &mut String, heading: &str, text: &str) {
    // Writing to a string does not fail.
    let _ = write!(report, "### {heading}\n\n```text\n{}\n```\n\n", text.trim());
}
