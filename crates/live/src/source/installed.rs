//! Searches the data folders of the user and the system for networks, and opens them.

use std::env;
use std::path::{Path, PathBuf};

use super::networks::Opened;
use super::options::{Order, Range};
use super::{NetworkFile, OpenRequest, SingleCameraDepth, SourceError};
use bokehcam_files::{data, input};
use bokehcam_networks::network::{KNOWN_NETWORKS, KnownNetwork, MAX_BYTES, Scaling, Task};
use bokehcam_networks::single_camera::{Hints, SingleCamera};

/// Names the folder of networks that takes the place of those beside the program.
const VARIABLE: &str = "BOKEHCAM_MODELS";

/// Returns the folders, the user's own first: `bokehcam/models` in `$XDG_DATA_HOME`, those of the program
/// (`program_folders`) or `$BOKEHCAM_MODELS` in their place, and `bokehcam/models` in each of `$XDG_DATA_DIRS`.
pub fn model_folders() -> Vec<PathBuf> {
    let of_data = |folder: PathBuf| folder.join("bokehcam/models");
    let of_program = match data::absolute_env_path(VARIABLE) {
        Some(folder) => vec![folder],
        None => env::current_exe().map_or_else(|_| Vec::new(), |program| program_folders(&program)),
    };
    let mut folders = Vec::new();
    for folder in data::user_data_dir()
        .map(of_data)
        .into_iter()
        .chain(of_program)
        .chain(data::system_data_dirs().into_iter().map(of_data))
    {
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
}

/// Returns the folders of a program's own networks: `share/bokehcam/models` beside its folder, as unpacked or installed;
/// and `models` in and beside its folder, as in a build, where `scripts/setup build` puts them. Only networks with a known
/// checksum are used, so that it does not matter who can write there.
fn program_folders(program: &Path) -> Vec<PathBuf> {
    let near: Vec<&Path> = program.ancestors().skip(1).take(2).collect();
    let installed = near.get(1).map(|folder| folder.join("share/bokehcam/models"));
    installed.into_iter().chain(near.iter().map(|folder| folder.join("models"))).collect()
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
    let rank = |known: &KnownNetwork| KNOWN_NETWORKS.iter().position(|other| std::ptr::eq(other, known));
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

/// Opens the networks `chosen`, for a look.
///
/// # Errors
/// A network is not installed or cannot be used.
pub(super) fn open_networks(chosen: &SingleCameraDepth, request: &OpenRequest) -> Result<Opened, SourceError> {
    let file = |chosen: &Option<NetworkFile>, task: Task| {
        match chosen {
        None => Ok(None),
        Some(NetworkFile::At(file)) => Ok(Some(file.clone())),
        Some(NetworkFile::Installed) => find_best(task).map(Some).ok_or_else(|| {
            SourceError::NotFound(format!(
                "--depth {task}: no network for it is installed: `bokehcam models get {known}`, or name a file: --depth {task}:FILE",
                known = KNOWN_NETWORKS.iter().find(|known| known.task == task).map_or("", |known| known.file),
                task = task.name()
            ))
        }),
    }
    };
    let (matte, mono) = (file(&chosen.matte, Task::Matte)?, file(&chosen.mono, Task::Mono)?);
    let options = &request.options.networks;
    let hints = Hints {
        scaling: options.network_range.map(scaling),
        bgr: options.network_order.map(|order| order == Order::Bgr),
    };
    let networks = SingleCamera::open(matte.as_deref(), mono.as_deref(), &hints)?;
    let about = networks.describe();
    Ok((Box::new(networks), about))
}

/// Returns the scaling of a picture's codes.
fn scaling(range: Range) -> Scaling {
    match range {
        Range::Unit => Scaling::UNIT,
        Range::Signed => Scaling::SIGNED,
        Range::Codes => Scaling::CODES,
        Range::Imagenet => Scaling::IMAGENET,
    }
}

/// Returns the best installed networks, if any.
pub fn find_each_best() -> SingleCameraDepth {
    let installed = installed_networks();
    let best =
        |task| installed.iter().find(|(known, _)| known.task == task).map(|(_, file)| NetworkFile::At(file.clone()));
    SingleCameraDepth { plate: None, matte: best(Task::Matte), mono: best(Task::Mono) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_finds_its_networks_where_packages_and_builds_put_them() {
        let folders = |program: &str| program_folders(Path::new(program));
        let is_in = |program: &str, folder: &str| folders(program).contains(&PathBuf::from(folder));
        assert!(is_in("/usr/local/bin/bokehcam", "/usr/local/share/bokehcam/models"));
        for program in ["/b/target/release/bokehcam", "/b/target/debug/bokehcam", "/b/target/bokehcam"] {
            assert!(is_in(program, "/b/target/models"), "{program}");
        }
        // Tests of a build are not the program.
        assert!(!is_in("/b/target/debug/deps/bokehcam-0123", "/b/target/models"));
        assert_eq!(folders("/"), Vec::<PathBuf>::new());
    }

    #[test]
    fn a_range_is_what_black_and_white_become() {
        for (range, black, white) in [
            (Range::Unit, 0.0, 1.0),
            (Range::Signed, -1.0, 1.0),
            (Range::Codes, 0.0, 255.0),
            // For red: (0 - 0.485) / 0.229 and (1 - 0.485) / 0.229.
            (Range::Imagenet, -2.117_904, 2.248_908),
        ] {
            let Scaling { mean, divisor } = scaling(range);
            for (code, expected) in [(0.0, black), (255.0, white)] {
                let became: f32 = (code - mean[0]) / divisor[0];
                assert!((became - expected).abs() < 1e-4, "{}: {code} became {became}", range.name());
            }
        }
    }
}
