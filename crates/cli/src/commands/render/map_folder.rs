//! The depth maps or masks of many pictures.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::CliError;
use bokehcam_files::place;

/// Maps or masks of many pictures: a folder, by the names of the pictures.
pub(super) struct MapFolder<'a> {
    option: &'static str,
    dir: &'a Path,
    /// What may follow a picture's name.
    suffixes: &'static [&'static str],
    by_stem: HashMap<OsString, Vec<PathBuf>>,
}

impl<'a> MapFolder<'a> {
    /// Lists the folder `dir` that `option` names.
    ///
    /// # Errors
    /// It is no folder, or cannot be read.
    pub fn read(option: &'static str, dir: &'a Path, suffixes: &'static [&'static str]) -> Result<Self, CliError> {
        if !dir.is_dir() {
            let what = "for many pictures this is a folder, with one file for each, of the same name";
            return Err(CliError::Usage(format!("{option} {}: {what}", dir.display())));
        }
        let mut by_stem: HashMap<OsString, Vec<PathBuf>> = HashMap::new();
        for entry in fs::read_dir(dir).map_err(CliError::io(dir))? {
            let path = entry.map_err(CliError::io(dir))?.path();
            let stem = path.file_stem().unwrap_or_default().to_owned();
            by_stem.entry(stem).or_default().push(path);
        }
        Ok(Self { option, dir, suffixes, by_stem })
    }

    /// Returns the file of a picture.
    ///
    /// # Errors
    /// The folder has no such file, or several.
    pub fn find(&self, picture: &Path) -> Result<PathBuf, CliError> {
        let stem = picture.file_stem().unwrap_or_default();
        let files = self.suffixes.iter().chain(&[""]).find_map(|suffix| {
            let mut name = stem.to_owned();
            name.push(suffix);
            let others = self.by_stem.get(&name)?.iter().filter(|path| !place::paths_overlap(path, picture));
            Some(others.collect::<Vec<_>>()).filter(|files| !files.is_empty())
        });
        let fail = |what: String| Err(CliError::Usage(format!("{} {}: {what}", self.option, self.dir.display())));
        match files.as_deref() {
            Some([file]) => Ok((*file).clone()),
            Some([one, other, ..]) => {
                fail(format!("{} and {} are both for this picture: leave one", one.display(), other.display()))
            }
            _ => fail(format!("nothing there is for this picture, as its name is not {}.*", stem.display())),
        }
    }
}
