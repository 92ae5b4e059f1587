//! Adds the flag for PipeWire's cameras to the flags files of browsers, and removes it.
//!
//! Some start programs pass comments on as arguments, so a comment cannot mark the added line: a file in the state folder
//! lists the files that have one. A file with other features is left to its user, as browsers use only the last
//! `--enable-features`.

use std::fs;
use std::io::{self, BufRead, IsTerminal};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::browsers::{FEATURE, FLAG, Features, SETTING, find_browsers, read_features, read_flags, shorten};
use crate::error::CliError;
use crate::files::{create_parent_folder, write_atomically};
use crate::settings::file::state_folder;
use crate::terminal::print_to_stderr;
use bokehcam_files::place::resolve_links;

/// A file to which the flag was added.
#[derive(Debug, Deserialize, Serialize)]
struct Added {
    file: PathBuf,
    /// Whether the file did not exist.
    is_new: bool,
}

/// Adds the flag to the files of the installed browsers, and names what is to be done by hand. Asks at a terminal, unless
/// `is_agreed`.
///
/// # Errors
/// A file cannot be read or written.
pub fn offer(is_agreed: bool) -> Result<(), CliError> {
    let mut files: Vec<PathBuf> = Vec::new();
    for browser in find_browsers() {
        let name = browser.name;
        let Some(file) = browser.flags_file else {
            print_to_stderr(&format!("{name} lists PipeWire cameras after {SETTING}, or with {FLAG}"));
            continue;
        };
        match read_features(&file)? {
            Features::Others => print_to_stderr(&format!(
                "{name} lists PipeWire cameras with ,{FEATURE} at the end of --enable-features in {}",
                shorten(&file)
            )),
            Features::None if !files.contains(&file) => files.push(file),
            Features::None | Features::PipeWireCamera => {}
        }
    }
    if files.is_empty() {
        return Ok(());
    }
    let names = files.iter().map(|file| shorten(file)).collect::<Vec<_>>().join(" and ");
    if is_agreed || ask(&format!("browsers list PipeWire cameras with {FLAG}: add it to {names}? [y/N]"))? {
        return files.iter().try_for_each(|file| add(file));
    }
    let how = "`bokehcam service on --browser-flags` adds it";
    print_to_stderr(&format!("browsers list PipeWire cameras with {FLAG} in {names}; {how}"));
    Ok(())
}

/// Asks a question at the terminal; without one, the answer is no.
fn ask(question: &str) -> Result<bool, CliError> {
    if !io::stdin().is_terminal() || !io::stderr().is_terminal() {
        return Ok(false);
    }
    print_to_stderr(question);
    let mut answer = String::new();
    io::stdin().lock().read_line(&mut answer).map_err(CliError::io("standard input".as_ref()))?;
    Ok(["y", "yes"].contains(&answer.trim().to_lowercase().as_str()))
}

/// Adds the flag as the first line, so that a last line without an end stays as it is.
fn add(file: &Path) -> Result<(), CliError> {
    let target = resolve_links(file);
    if target.is_symlink() {
        let what = format!("{} is a link to nothing: create its target", file.display());
        return Err(CliError::Service(what));
    }
    let text = read_flags(&target)?;
    let mut list = read_list()?;
    list.retain(|added| added.file != file);
    list.push(Added { file: file.to_owned(), is_new: !target.exists() });
    // First, so that no line is forgotten.
    write_list(&list)?;
    create_parent_folder(&target)?;
    write_atomically(&target, format!("{FLAG}\n{text}").as_bytes(), true)?;
    print_to_stderr(&format!("added {FLAG} to {}: start the browser again", shorten(file)));
    Ok(())
}

/// Removes the flags that were added.
///
/// # Errors
/// A file cannot be read or written.
pub fn remove() -> Result<(), CliError> {
    let list = read_list()?;
    for Added { file, is_new } in &list {
        let target = resolve_links(file);
        let text = read_flags(&target)?;
        let mut lines: Vec<&str> = text.split_inclusive('\n').collect();
        // Without the line, its user has changed it.
        let Some(index) = lines.iter().position(|line| line.strip_suffix('\n').unwrap_or(line) == FLAG) else {
            continue;
        };
        lines.remove(index);
        if lines.is_empty() && *is_new {
            fs::remove_file(&target).map_err(CliError::io(&target))?;
        } else {
            write_atomically(&target, lines.concat().as_bytes(), true)?;
        }
        print_to_stderr(&format!("removed {FLAG} from {}: start the browser again", shorten(file)));
    }
    if list.is_empty() { Ok(()) } else { write_list(&[]) }
}

/// Returns the path of the list of changed files.
fn list_path() -> Result<PathBuf, CliError> {
    let no_folder = "there is no folder for states: neither XDG_STATE_HOME nor HOME is an absolute path";
    Ok(state_folder().ok_or_else(|| CliError::Service(no_folder.into()))?.join("browser-flags.json"))
}

fn read_list() -> Result<Vec<Added>, CliError> {
    let path = list_path()?;
    let text = read_flags(&path)?;
    let list = if text.is_empty() { Ok(Vec::new()) } else { serde_json::from_str(&text) };
    list.map_err(|error| CliError::Service(format!("{}: {error}; remove the file", path.display())))
}

fn write_list(list: &[Added]) -> Result<(), CliError> {
    let path = list_path()?;
    create_parent_folder(&path)?;
    let text = serde_json::to_string(list).map_err(|error| CliError::Service(error.to_string()))?;
    write_atomically(&path, text.as_bytes(), true)
}
