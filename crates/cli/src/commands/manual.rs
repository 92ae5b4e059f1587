//! `manual`: writes the manual pages, generated from the clap command.

use std::fs;
use std::io;
use std::path::PathBuf;

use clap::{Args, Command};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use crate::error::CliError;
use crate::files::{refuse_overwrite, write_atomically};
use crate::options::Output;

/// Write the manual pages of all commands into a folder, as packages install them
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  bokehcam manual --out ~/.local/share/man/man1")]
pub struct ManualCommand {
    /// Folder for the pages
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs the command for the program that `table` describes.
///
/// # Errors
/// Fails if a page exists without `--force`, or the folder cannot be written.
pub fn run(command: &ManualCommand, mut table: Command) -> Result<(), CliError> {
    // `help` needs no page.
    table = table.disable_help_subcommand(true);
    table.build();
    let mut pages = Vec::new();
    add_pages(&table, table.get_name(), &mut pages).map_err(CliError::io(&command.out))?;
    for (name, _) in &mut pages {
        *name = command.out.join(&*name);
    }
    refuse_overwrite(pages.iter().map(|(path, _)| path.as_path()), command.output.force)?;
    fs::create_dir_all(&command.out).map_err(CliError::io(&command.out))?;
    pages.iter().try_for_each(|(path, page)| write_atomically(path, page, command.output.force))
}

/// Adds the pages (file name and text) of a command and its visible subcommands.
fn add_pages(command: &Command, program: &str, pages: &mut Vec<(PathBuf, Vec<u8>)>) -> io::Result<()> {
    let visible = || command.get_subcommands().filter(|subcommand| !subcommand.is_hide_set());
    visible().try_for_each(|subcommand| add_pages(subcommand, program, pages))?;
    // The full usage line of a command with settings has too many options to read.
    let usage = command.clone().render_usage().to_string();
    let page = Man::new(command.clone().override_usage(usage.trim_start_matches("Usage:").trim().to_owned()))
        // A build has no date. An empty one would be left out, and the next field would take its place.
        .date(" ")
        .source(format!("{program} {}", env!("CARGO_PKG_VERSION")))
        .manual("User Commands");
    let mut text = Vec::new();
    page.render_title(&mut text)?;
    page.render_name_section(&mut text)?;
    page.render_synopsis_section(&mut text)?;
    page.render_description_section(&mut text)?;
    page.render_options_section(&mut text)?;
    if visible().next().is_some() {
        page.render_subcommands_section(&mut text)?;
    }
    let mut rest = format_after_help(&command.get_after_help().map(ToString::to_string).unwrap_or_default());
    if command.get_name() != program {
        rest.control("SH", ["SEE ALSO"]).text([bold(program), roman("(1)")]);
    }
    rest.to_writer(&mut text)?;
    pages.push((page.get_filename().into(), text));
    Ok(())
}

/// Formats the text after the options: examples line by line, the rest as notes.
fn format_after_help(text: &str) -> Roff {
    let mut page = Roff::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with("Example") {
            page.control("SH", ["EXAMPLES"]).control("nf", []);
            while let Some(example) = lines.next_if(|line| line.starts_with(' ')) {
                page.text([roman(example.trim())]);
            }
            page.control("fi", []);
            if lines.peek().is_some() {
                page.control("SH", ["NOTES"]);
            }
        } else if !line.is_empty() {
            page.text([roman(line)]);
        }
    }
    page
}
