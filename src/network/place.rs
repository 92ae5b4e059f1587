//! Searches the data folders of the user and the system for networks.

use std::env;
use std::path::PathBuf;

use super::{Known, MAX_BYTES, Task};
use crate::files::{data, input};

/// Returns the folders, the user's own first: `bokehcam/models` in `$XDG_DATA_HOME`, in `share` next to the folder of
/// the program (as unpacked or installed), and in each of `$XDG_DATA_DIRS`.
pub fn folders() -> Vec<PathBuf> {
    let bundled = env::current_exe().ok().and_then(|program| Some(program.parent()?.parent()?.join("share")));
    let mut folders = Vec::new();
    for folder in
        data::own().into_iter().chain(bundled).chain(data::system()).map(|folder| folder.join("bokehcam/models"))
    {
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
}

/// Returns the installed known networks with their files, the best of each task first.
pub fn installed() -> Vec<(&'static Known, PathBuf)> {
    known_in(folders())
}

/// Returns the known networks in these folders with their files, the best of each task first.
fn known_in(folders: Vec<PathBuf>) -> Vec<(&'static Known, PathBuf)> {
    let files = folders.into_iter().flat_map(|folder| {
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        files.sort();
        files
    });
    let may_be_known = |file: &PathBuf| {
        let is_network = file.extension().is_some_and(|extension| extension == "onnx" || extension == "tflite");
        is_network && file.metadata().is_ok_and(|metadata| Known::any_has_size(metadata.len()))
    };
    let mut found: Vec<(&'static Known, PathBuf)> = files
        .filter(may_be_known)
        .filter_map(|file| Some((Known::of(&input::read(&file, MAX_BYTES).ok()?)?, file)))
        .collect();
    let rank = |known: &Known| super::KNOWN.iter().position(|other| std::ptr::eq(other, known));
    found.sort_by_key(|(known, _)| rank(known));
    found.dedup_by_key(|(known, _)| known.sha256);
    found
}

/// Returns the best installed network for a task.
pub fn best(task: Task) -> Option<PathBuf> {
    best_in(folders(), task)
}

/// Returns the best known network for a task in these folders.
pub fn best_in(folders: Vec<PathBuf>, task: Task) -> Option<PathBuf> {
    known_in(folders).into_iter().find(|(known, _)| known.task == task).map(|(_, file)| file)
}
