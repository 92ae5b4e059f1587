//! Determines which files of a folder belong to its recording: those that its lists name.

use std::fs;
use std::path::Path;

use super::{ASSOCIATIONS, COLOR_LIST, DEPTH_LIST, is_picture, list};
use crate::recording::list::Entry;

const LISTS: [&str; 3] = [COLOR_LIST, DEPTH_LIST, ASSOCIATIONS];

/// Returns the lists that exist.
pub(super) fn find_lists(dir: &Path) -> impl Iterator<Item = String> {
    LISTS.into_iter().filter(|list| is_file(&dir.join(list))).map(str::to_owned)
}

/// Returns the PNG and JPEG pictures that the lists name and that exist, at most one folder deep. Skips faulty lists
/// and lines: pictures not found here are kept.
pub(super) fn find_pictures(dir: &Path) -> impl Iterator<Item = String> {
    let entries = |list: &'static str| -> Vec<Entry> {
        if !is_file(&dir.join(list)) {
            return Vec::new();
        }
        match list {
            ASSOCIATIONS => list::read_pairs(dir, list).unwrap_or_default().into_iter().flatten().collect(),
            list => list::read_list(dir, list).unwrap_or_default(),
        }
    };
    let named = LISTS.into_iter().flat_map(entries).filter_map(|entry| entry.source.file.ok());
    let named = named.filter(|file| is_picture(file) && file.components().count() <= 2 && is_file(&dir.join(file)));
    named.filter_map(|file| Some(file.components().as_path().to_str()?.to_owned())).collect::<Vec<_>>().into_iter()
}

/// Returns whether the path is a regular file, not a link to one.
fn is_file(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|there| there.is_file())
}
