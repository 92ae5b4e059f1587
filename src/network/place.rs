//! Where networks are looked for: the folders of the user and of the system for a program's data.

use std::env;
use std::path::PathBuf;

use super::{Known, MOST_BYTES, Task};
use crate::files::{data, input};

/// The folders, the user's own first: `bokehcam/models` in `$XDG_DATA_HOME`, in `share` beside the folder of the program, as
/// it was unpacked or installed, and in each of `$XDG_DATA_DIRS`.
pub fn folders() -> Vec<PathBuf> {
    let beside = env::current_exe().ok().and_then(|program| Some(program.parent()?.parent()?.join("share")));
    let mut folders = Vec::new();
    for folder in
        data::own().into_iter().chain(beside).chain(data::system()).map(|folder| folder.join("bokehcam/models"))
    {
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
}

/// The known networks that are installed, with their files: the best of each task first.
pub fn installed() -> Vec<(&'static Known, PathBuf)> {
    known_in(folders())
}

/// The known networks in these folders, with their files: the best of each task first.
fn known_in(folders: Vec<PathBuf>) -> Vec<(&'static Known, PathBuf)> {
    let files = folders.into_iter().flat_map(|folder| {
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        files.sort();
        files
    });
    let may_be_known = |file: &PathBuf| {
        let is_network = file.extension().is_some_and(|extension| extension == "onnx" || extension == "tflite");
        is_network && file.metadata().is_ok_and(|metadata| Known::any_has(metadata.len()))
    };
    let mut found: Vec<(&'static Known, PathBuf)> = files
        .filter(may_be_known)
        .filter_map(|file| Some((Known::of(&input::read(&file, MOST_BYTES).ok()?)?, file)))
        .collect();
    let rank = |known: &Known| super::KNOWN.iter().position(|other| std::ptr::eq(other, known));
    found.sort_by_key(|(known, _)| rank(known));
    found.dedup_by_key(|(known, _)| known.sha256);
    found
}

/// The best installed network of a task.
pub fn best(task: Task) -> Option<PathBuf> {
    best_in(folders(), task)
}

/// The best known network of a task in these folders.
pub fn best_in(folders: Vec<PathBuf>, task: Task) -> Option<PathBuf> {
    known_in(folders).into_iter().find(|(known, _)| known.task == task).map(|(_, file)| file)
}
