//! A report of this machine as a form to share: the findings, with private words redacted.

use std::fmt::Write as _;
use std::path::Path;

use super::findings::CheckResults;
use super::private::Redactor;
use super::{CliError, hardware, trial_run};
use crate::commands::{bench, devices};
use crate::files::{create_parent_folder, refuse_overwrite, write_atomically};
use crate::terminal::{print_to_stderr, print_to_stdout};

/// Introduction, and a question for the user to answer.
const FORM: &str = "\
<!-- Made by `bokehcam doctor --report`. Names of users, their folders, the name of this machine and serial numbers are taken
out; no picture was kept, nothing was sent. Read it all before you give it to others. -->

### What works, and what does not

<!-- The command, what you saw, what you expected. \"All well\" helps, too. -->

";

/// Prints a report of this machine and writes it to `file`, if given. `config` is the chosen settings file.
///
/// # Errors
/// Fails if the file exists or cannot be written.
pub fn run(file: Option<&Path>, config: Option<&Path>) -> Result<(), CliError> {
    refuse_overwrite(file, false).map_err(remove_force_hint)?;
    let examined = CheckResults::collect(config);
    let mut facts = String::new();
    add_section(
        &mut facts,
        "Machine",
        &(examined.system.to_string() + "\n" + &hardware::describe_hardware().join("\n")),
    );
    add_section(&mut facts, "Cameras", &devices::list::format_devices(&examined.nodes));
    add_section(&mut facts, "What doctor found", &examined.format_text());
    add_section(&mut facts, "Time of the blur", &bench::run_short_benchmark());
    print_to_stderr("measuring for ten seconds; the pictures are dropped");
    add_section(&mut facts, "A run of ten seconds", &trial_run::run(&examined.nodes, config));
    let report = FORM.to_owned() + &Redactor::detect().redact(&facts);
    print_to_stdout(report.as_bytes())?;
    match file {
        Some(file) => {
            create_parent_folder(file)?;
            write_atomically(file, report.as_bytes(), false).map_err(remove_force_hint)?;
            print_to_stderr(&format!("this report is in {}, and was not sent anywhere", file.display()));
        }
        None => print_to_stderr("this report was only printed: `bokehcam doctor --report FILE` also saves it"),
    }
    Ok(())
}

/// Replaces the hint to `--force`, which this command lacks.
fn remove_force_hint(error: CliError) -> CliError {
    match error {
        CliError::Exists(path) => CliError::NeverReplaced(path),
        other => other,
    }
}

/// Appends a section to the report, as preformatted text.
fn add_section(report: &mut String, heading: &str, text: &str) {
    // Writing to a string cannot fail.
    let _ = write!(report, "### {heading}\n\n```text\n{}\n```\n\n", text.trim());
}
