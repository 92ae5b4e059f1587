//! Files of stereo calibrations. [`load_calibration`] reads a [`StereoCalibration`] from any of the
//! [formats](formats::FORMATS).

mod entries;
pub mod euroc;
pub mod formats;
mod ini;
mod kalibr;
mod oak;
mod opencv;
mod ros;
mod stored;
mod tree;
mod yaml;
mod zed;

use std::path::{Path, PathBuf};

use bokehcam::calibration::{CalibrationError, StereoCalibration};

/// Entries of ORB-SLAM's settings.
const ORB_SLAM_KEYS: [&str; 3] = ["Camera1.fx", "Camera.fx", "LEFT.K"];

/// Reads a calibration like [`load_calibration_for`], for pictures of unknown size: from a file for several sizes, the
/// largest.
///
/// # Errors
/// Fails like [`load_calibration_for`].
pub fn load_calibration(paths: &[&Path]) -> Result<StereoCalibration, CalibrationError> {
    load_calibration_for(paths, None)
}

/// Reads a calibration for pictures of `size` (columns, rows). The content decides which of the [`formats::FORMATS`] it
/// is. Where one has two files, one suffices if the other is beside it: `intrinsics.yml` and `extrinsics.yml`, or
/// `left.yaml` and `right.yaml` of ROS.
///
/// # Errors
/// Fails if a file is unreadable, of unknown format, or lacks a key, or if numbers are invalid.
pub fn load_calibration_for(paths: &[&Path], size: Option<(u32, u32)>) -> Result<StereoCalibration, CalibrationError> {
    if !(1..=2).contains(&paths.len()) {
        return Err(CalibrationError::Files(paths.len()));
    }
    let mut files = Vec::with_capacity(2);
    for path in paths {
        files.push(tree::File::open(path)?);
    }
    let has = |key| files[0].root().get(key).is_some();
    let one_camera = |format| Err(CalibrationError::OneCamera { path: paths[0].to_owned(), format });
    match files.as_slice() {
        [left, right] if has("T_BS") => return euroc::from_files(left, right),
        [_] if has("T_BS") => return one_camera("sensor.yaml"),
        [chain, ..] if has("cam0") || has("cam1") => return kalibr::from_file(chain),
        [conf, ..] if zed::is_conf(conf) => return zed::from_file(conf, size),
        [json, ..] if has("cameraData") => return oak::from_file(json),
        [one, other] if ros::is_camera_info(one) => return ros::from_files(one, other),
        [one] if ros::is_camera_info(one) => {
            return match find_companion_file(paths[0], ["left", "right"]) {
                Some(other) => ros::from_files(one, &tree::File::open(&other)?),
                None => one_camera("camera_info"),
            };
        }
        _ => {}
    }
    if !opencv::is_opencv(&files) {
        let is_orb_slam = |file: &tree::File| file.root().find(|key| ORB_SLAM_KEYS.contains(&key)).is_some();
        return Err(match files.iter().any(is_orb_slam) {
            true => CalibrationError::Unconverted { path: paths[0].to_owned(), format: "ORB-SLAM's format" },
            false => formats::unknown_format(paths[0]),
        });
    }
    let companion = find_companion_file(paths[0], ["intrinsic", "extrinsic"]);
    if let (true, Some(other)) = (files.len() == 1 && opencv::is_partial(&files), companion) {
        files.push(tree::File::open(&other)?);
    }
    opencv::from_files(&files)
}

/// Returns the file beside `path` with the second word for the first in its name, or the other way round, if it exists.
fn find_companion_file(path: &Path, [one, other]: [&str; 2]) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let companion = if name.contains(one) { name.replace(one, other) } else { name.replace(other, one) };
    Some(path.with_file_name(&companion)).filter(|companion| companion != path && companion.is_file())
}
