//! Searches the data folders of the user and the system for networks.

use std::env;
use std::path::PathBuf;

use super::{KnownNetwork, MAX_BYTES, Task};
use crate::files::{data, input};

/// Returns the folders, the user's own first: `bokehcam/models` in `$XDG_DATA_HOME`, in `share` next to the folder of
/// the program (as unpacked or installed), and in each of `$XDG_DATA_DIRS`.
pub fn model_folders() -> Vec<PathBuf> {
    let bundled = env::current_exe().ok().and_then(|program| Some(program.parent()?.parent()?.join("share")));
    let mut folders = Vec::new();
    for folder in data::user_data_dir()
        .into_iter()
        .chain(bundled)
        .chain(data::system_data_dirs())
        .map(|folder| folder.join("bokehcam/models"))
    {
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
}

/// Returns the installed known networks with their files, the best of each task first.
pub fn installed_networks() -> Vec<(&'static KnownNetwork, PathBuf)> {
    find_known_in(model_folders())
}

/// Returns the known networks in these folders with their files, the best of each task first.
fn find_known_in(folders: Vec<PathBuf>) -> Vec<(&'static KnownNetwork, PathBuf)> {
    let files = folders.into_iter().flat_map(|folder| {
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        files.sort();
        files
    });
    let has_known_size = |file: &PathBuf| {
        let is_network = file.extension().is_some_and(|extension| extension == "onnx" || extension == "tflite");
        is_network && file.metadata().is_ok_and(|metadata| KnownNetwork::is_known_size(metadata.len()))
    };
    let mut found: Vec<(&'static KnownNetwork, PathBuf)> = files
        .filter(has_known_size)
        .filter_map(|file| Some((KnownNetwork::identify(&input::read(&file, MAX_BYTES).ok()?)?, file)))
        .collect();
    let rank = |known: &KnownNetwork| super::KNOWN_NETWORKS.iter().position(|other| std::ptr::eq(other, known));
    found.sort_by_key(|(known, _)| rank(known));
    found.dedup_by_key(|(known, _)| known.sha256);
    found
}

/// Returns the best installed network for a task.
pub fn find_best(task: Task) -> Option<PathBuf> {
    find_best_in(model_folders(), task)
}

/// Returns the best known network for a task in these folders.
pub fn find_best_in(folders: Vec<PathBuf>, task: Task) -> Option<PathBuf> {
    find_known_in(folders).into_iter().find(|(known, _)| known.task == task).map(|(_, file)| file)
}
