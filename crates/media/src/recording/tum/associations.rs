//! Finds the file that pairs colour with depth: it has several usual names.

use std::fs;
use std::path::Path;

use super::{ASSOCIATIONS, COLOR_LIST, DEPTH_LIST, is_picture, list::split_pair};
use crate::recording::list::split_lines;
use bokehcam_files::input;

/// Usual names, in order of preference.
const NAMES: [&str; 6] =
    [ASSOCIATIONS, "association.txt", "associate.txt", "associated.txt", "assoc.txt", "rgbd_assoc.txt"];

/// Maximum number of texts in a folder that are searched for pairs: more are data of another kind, such as poses.
const MAX_TEXTS: usize = 8;

/// Returns the name of the list of pairs in `dir`, or several if it is ambiguous. Without a usual name and without
/// other lists, it is the text whose first line is a pair of pictures, such as `fr1_desk.txt`.
pub(super) fn find_associations(dir: &Path) -> Vec<String> {
    if let Some(name) = NAMES.into_iter().find(|name| dir.join(name).exists()) {
        return vec![name.to_owned()];
    }
    if [COLOR_LIST, DEPTH_LIST].iter().any(|list| dir.join(list).exists()) {
        return Vec::new();
    }
    let names = fs::read_dir(dir).into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut lists: Vec<String> = names.filter(|name| name.ends_with(".txt")).take(MAX_TEXTS + 1).collect();
    if lists.len() > MAX_TEXTS {
        return Vec::new();
    }
    lists.retain(|name| begins_with_pair(&dir.join(name)));
    lists.sort_unstable();
    lists
}

/// Returns whether the first line of a text, comments apart, names two pictures as pairs do.
fn begins_with_pair(text: &Path) -> bool {
    let Ok(bytes) = input::read(text, input::MAX_TEXT_BYTES) else { return false };
    let first = split_lines(&bytes).next().and_then(|(_, line)| split_pair(line.ok()?).ok());
    first.is_some_and(|[_, file, _, other]| [file, other].iter().all(|file| is_picture(Path::new(file))))
}
