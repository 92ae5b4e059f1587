//! Editing the settings file: new values go in, the rest stays, comments and order included.

use std::fs::{self, File};
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::dump::toml_number;
use super::file::{self, SettingsFile};
use super::layers::Setting;
use super::paths::{self, resolve_paths};
use super::table::find_excluded;
use crate::error::CliError;
use crate::files::{create_parent_folder, write_atomically};
use crate::log;
use crate::terminal;
use bokehcam::look::settings;
use bokehcam_files::lock::lock_folder;
use bokehcam_files::{atomic_file, input};

/// Time limit for the lock of the file's folder, which programs hold while they save.
const LOCK_TIMEOUT: Duration = Duration::from_secs(10);

/// Runs `config save`: writes the settings given as flags to the chosen file or the user's.
///
/// # Errors
/// Fails if no setting is given, or the file is not a settings file or cannot be read or written.
pub fn save_settings(chosen: Option<&Path>, settings: &[Setting]) -> Result<(), CliError> {
    let cwd = std::env::current_dir().map_err(CliError::io(".".as_ref()))?;
    let by_flag = settings.iter().filter(|setting| setting.origin == "flag");
    let given: Vec<(String, String)> = by_flag
        .filter_map(|Setting { name, value, .. }| Some((name.clone(), resolve_paths(&cwd, name, value.as_deref()?))))
        .collect();
    let names: Vec<String> = given.iter().map(|(name, _)| name.clone()).collect();
    if names.is_empty() {
        let what = "nothing to save: give settings as flags, such as --rim 0.1";
        return Err(CliError::Usage(what.to_string()));
    }
    for (name, value) in &given {
        for file in paths::input_files(name, value).iter().filter(|file| !file.exists()) {
            log::warn(&format!("{name}: {}: there is no such file; commands need it", file.display()));
        }
    }
    let path = file_to_save(chosen)?;
    let excluded = find_excluded(&names);
    let mut removed: Vec<String> = Vec::new();
    edit_file(&path, |document| {
        let table = document.as_table_mut();
        let excluded = excluded.iter().map(|name| find_key(table, name).to_owned()).collect::<Vec<_>>();
        removed = excluded.into_iter().filter(|name| table.remove(name).is_some()).collect();
        given.iter().for_each(|(name, value)| set_key(table, name, value));
        Some(())
    })?;
    let without = if removed.is_empty() { String::new() } else { format!("; {} set aside", removed.join(", ")) };
    terminal::print_to_stderr(&format!("{}: saved {}{without}", path.display(), names.join(", ")));
    Ok(())
}

/// Returns the file for saving settings and presets: the chosen one, else the user's.
///
/// # Errors
/// Fails if none is chosen and the user has no home folder.
pub fn file_to_save(chosen: Option<&Path>) -> Result<PathBuf, CliError> {
    let no_home =
        || CliError::Usage("there is no home folder for settings: name a file with --config FILE".to_string());
    chosen.map(Path::to_owned).or_else(file::user_file).ok_or_else(no_home)
}

/// Edits the settings file at `path` atomically, one program after another; creates it and its folder if missing. A value
/// that is refused may be there before the change.
///
/// # Errors
/// Fails if the file is not TOML before or no settings file after the change, cannot be read or written, or `change`
/// returns `None`.
pub fn edit_file(path: &Path, change: impl FnOnce(&mut DocumentMut) -> Option<()>) -> Result<(), CliError> {
    // A symbolic link, for example into a repository of settings, is followed and not replaced.
    let path = &link_target(path)?;
    create_parent_folder(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Held until the file is replaced: of two programs that read it at once, the first one's change would be lost.
    let _lock = lock_folder(folder, LOCK_TIMEOUT).map_err(CliError::io(folder))?;
    for part in atomic_file::find_abandoned(path).map_err(CliError::io(folder))? {
        // Of a killed save, which changed nothing. One that cannot be removed does no harm.
        let _ = fs::remove_file(part);
    }
    let text = match input::read_text(path, input::MAX_SETTINGS_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
        read => read.map_err(CliError::io(path))?,
    };
    let no_place =
        || CliError::Settings { path: path.clone(), line: 1, what: "nothing can be added to it".to_string() };
    let edit = || {
        let mut document: DocumentMut = text.parse().map_err(|_| no_place())?;
        change(&mut document).ok_or_else(no_place)?;
        let edited = document.to_string();
        // Unreadable results are not written.
        SettingsFile::parse(path, &edited).map(|_| edited)
    };
    // A fault that was there before is named with its line in the file as it is.
    let edited = edit().map_err(|refused| SettingsFile::parse(path, &text).err().unwrap_or(refused))?;
    write_atomically(path, edited.as_bytes(), true)
}

/// Follows the symbolic links at `path`. Unlike `canonicalize`, the final target need not exist.
fn link_target(path: &Path) -> Result<PathBuf, CliError> {
    /// Linux's limit.
    const MAX_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&target) {
            Ok(to) => target = target.parent().unwrap_or(Path::new("")).join(to),
            Err(_) => return Ok(target),
        }
    }
    Err(CliError::io(path)(io::Error::new(io::ErrorKind::InvalidInput, "a loop of links")))
}

/// Returns the key of a setting in a table, which may be its alias.
fn find_key<'a>(table: &dyn TableLike, name: &'a str) -> &'a str {
    let alias = settings::find_setting(name).and_then(settings::Setting::alias);
    alias.filter(|alias| table.contains_key(alias)).unwrap_or(name)
}

/// Sets a key. An existing key keeps its position and the comments around its value.
pub fn set_key(table: &mut dyn TableLike, name: &str, text: &str) {
    let key = find_key(table, name);
    let mut value = toml_number(text).unwrap_or_else(|| Value::from(text));
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        None => drop(table.insert(key, Item::Value(value))),
    }
}

/// Refuses to print into the settings file itself: the shell has already emptied it.
///
/// # Errors
/// Fails if standard output is the settings file.
pub fn refuse_redirect(chosen: Option<&Path>) -> Result<(), CliError> {
    let Some(path) = chosen.map(Path::to_owned).or_else(file::user_file) else { return Ok(()) };
    let stdout = io::stdout().as_fd().try_clone_to_owned().and_then(|stdout| File::from(stdout).metadata());
    let (Ok(stdout), Ok(file)) = (stdout, fs::metadata(&path)) else { return Ok(()) };
    if stdout.is_file() && (stdout.dev(), stdout.ino()) == (file.dev(), file.ino()) {
        return Err(CliError::Usage(format!(
            "{}: this is the settings file itself, and the redirection `>` has emptied it: use `bokehcam config save` \
             to change it",
            path.display()
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_goes_in_where_it_was_and_all_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/config.toml");
        edit_file(&path, |document| {
            set_key(document.as_table_mut(), "rim", "0.5");
            Some(())
        })
        .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "rim = 0.5\n");
        let text = "# mine\nrim   = 0.9 # wide\n\n[presets.old] # dear\nrim = 0.8\n";
        fs::write(&path, text).unwrap();
        edit_file(&path, |document| {
            set_key(document.as_table_mut(), "rim", "0.1");
            set_key(document.as_table_mut(), "aperture", "heart");
            Some(())
        })
        .unwrap();
        let edited = fs::read_to_string(&path).unwrap();
        assert_eq!(edited, "# mine\nrim   = 0.1 # wide\naperture = \"heart\"\n\n[presets.old] # dear\nrim = 0.8\n");
    }

    #[test]
    fn links_are_followed_to_files_that_are_not_there_yet() {
        let folder = tempfile::tempdir().unwrap();
        let (link, real) = (folder.path().join("link.toml"), folder.path().join("dot/real.toml"));
        std::os::unix::fs::symlink("dot/real.toml", &link).unwrap();
        assert_eq!(link_target(&link).unwrap(), real);
        let looped = folder.path().join("loop");
        std::os::unix::fs::symlink("loop", &looped).unwrap();
        assert!(link_target(&looped).is_err());
    }
}
