//! The layouts of the KITTI benchmarks, odometry (one sequence) and stereo, and their derivatives: a folder per camera,
//! whose pictures are numbered and named alike in both, `calib.txt`, and `times.txt` with one time per line; raw drives,
//! with `timestamps.txt` and the calibration of their day; or single scenes, each with its calibration.

pub(super) mod calib;
mod scenes;
mod times;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::contents::{Contents, Layout, ListedFrame, PictureSource, RecordingFolder};
use super::error::RecordingError;
use super::folder::find_numbered_pictures;
use super::geometry::Geometry;
use super::list::{clear_unordered_times, refuse_faults};
use super::{Options, StereoGeometry, Unpaired};

/// Detected by the folders of the two cameras.
pub(super) const LAYOUT: Layout = Layout {
    name: "KITTI",
    expected_files: "image_2 and image_3, or image_0 and image_1",
    matches: is_kitti_folder,
    open,
};

/// The folders of the two cameras.
struct FolderPair {
    left: &'static str,
    right: &'static str,
    /// Number of the left camera in the calibration; the right one is the next.
    camera: Option<usize>,
}

/// Known pairs of folders; colour before grey.
const FOLDER_PAIRS: [FolderPair; 6] = [
    FolderPair { left: "image_2", right: "image_3", camera: Some(2) },
    FolderPair { left: "image_02/data", right: "image_03/data", camera: Some(2) },
    FolderPair { left: "colored_0", right: "colored_1", camera: Some(2) },
    FolderPair { left: "image_0", right: "image_1", camera: Some(0) },
    FolderPair { left: "image_00/data", right: "image_01/data", camera: Some(0) },
    FolderPair { left: "image_l", right: "image_r", camera: None },
];

const CALIBRATIONS: [&str; 2] = ["calib.txt", "calib_cam_to_cam.txt"];

fn is_kitti_folder(dir: &Path) -> bool {
    FOLDER_PAIRS.iter().any(|folders| dir.join(folders.left).is_dir())
}

/// Returns the number of the left camera whose folder contains the picture `left`.
pub(super) fn find_left_camera(left: &Path) -> Option<usize> {
    let folder = left.parent()?;
    FOLDER_PAIRS.iter().find(|folders| folder.ends_with(folders.left))?.camera
}

/// Lists the pictures of both cameras with their times, and reads the calibration.
fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let folders = find_folder_pair(dir)?;
    let names = find_numbered_pictures(&dir.join(folders.left))?;
    let right_names: HashSet<String> = find_numbered_pictures(&dir.join(folders.right))?.into_iter().collect();
    let known_names: HashSet<&String> = names.iter().collect();
    let right_alone: Vec<_> = right_names.iter().filter(|name| !known_names.contains(name)).collect();
    if !options.keep_going {
        let no_partner =
            |eye: &str, name: &String, other| RecordingError::NoPartner { path: dir.join(eye).join(name), other };
        if let Some(name) = names.iter().find(|name| !right_names.contains(*name)) {
            return Err(no_partner(folders.left, name, folders.right));
        }
        // Take the smallest, so that the message is reproducible: a `HashSet` has no order.
        if let Some(name) = right_alone.iter().min() {
            return Err(no_partner(folders.right, name, folders.left));
        }
    }

    let is_chosen_by_size = scenes::are_single(dir, &names);
    let (names, scenes_rig) = match is_chosen_by_size {
        true => {
            let scenes = scenes::choose(folder, folders.left, folders.camera, names, options)?;
            (scenes.names, scenes.rig)
        }
        false => (names, None),
    };
    let pictures = names.iter().map(|name| (name.as_str(), PathBuf::from(format!("{}/{name}", folders.left))));
    let list = times::find_list(dir, folders.left);
    let mut entries = times::timed_entries(dir, list.as_deref(), pictures.collect(), options)?;
    clear_unordered_times(entries.iter_mut());
    if !options.keep_going {
        refuse_faults(dir, entries.iter())?;
    }
    let frames = entries.into_iter().zip(&names).map(|(left, name)| ListedFrame {
        time_ns: left.time_ns,
        // The list of times does not name pictures: its line is cited only if the time itself is faulty.
        color: PictureSource { position: left.source.position.filter(|_| left.source.file.is_err()), ..left.source },
        right: Some(PictureSource::from_path(Path::new(folders.right).join(name))),
        depth: None,
    });
    // All drives of a day share one, in the folder of the day.
    let day = dir.join("..").join(CALIBRATIONS[1]);
    let calibration = CALIBRATIONS.iter().map(|name| dir.join(name)).find(|path| path.exists());
    let calibration = calibration.or_else(|| Some(day).filter(|file| folders.left.contains('/') && file.exists()));
    let rig = match calibration.filter(|_| scenes_rig.is_none()) {
        Some(path) => Some(Geometry::read_with(&path, |text| calib::parse(text, folders.camera))?.rig),
        None => scenes_rig,
    };
    Ok(Contents {
        frames: frames.collect(),
        stereo_geometry: Some(rig.map_or(StereoGeometry::Uncalibrated, StereoGeometry::Rectified)),
        is_chosen_by_size,
        unpaired: Unpaired { right: right_alone.len(), ..Unpaired::default() },
        has_times: list.is_some(),
        ..Contents::default()
    })
}

/// Returns the first pair of folders that both exist.
fn find_folder_pair(dir: &Path) -> Result<&'static FolderPair, RecordingError> {
    let has = |eye: &str| dir.join(eye).is_dir();
    if let Some(folders) = FOLDER_PAIRS.iter().find(|folders| has(folders.left) && has(folders.right)) {
        return Ok(folders);
    }
    let alone = FOLDER_PAIRS.iter().find(|folders| has(folders.left)).unwrap_or(&FOLDER_PAIRS[0]);
    Err(RecordingError::MissingEye { dir: dir.to_owned(), missing: alone.right, present: alone.left })
}
