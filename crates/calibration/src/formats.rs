//! The formats of stereo calibrations: for messages, for `docs/recordings.md`, and to name what a file of none of them
//! lacks.

use std::collections::HashSet;
use std::path::Path;

use bokehcam::calibration::CalibrationError;
use bokehcam_files::input;

/// A format of stereo calibrations.
pub struct Format {
    /// The program, sensor or data set that it comes from.
    pub name: &'static str,
    /// Names of its files.
    pub files: &'static str,
    /// The entries by which it is known; a file has one of the groups.
    pub keys: &'static [&'static [&'static str]],
}

/// All formats that `--calib` reads. The last two are of pictures that are rectified.
pub const FORMATS: [Format; 8] = [
    Format {
        name: "OpenCV",
        files: "stereo.yml, or intrinsics.yml and extrinsics.yml",
        keys: &[&["M1", "D1", "M2", "D2", "R", "T"], &["M1", "D1", "M2", "D2", "R1", "R2", "P1", "P2"]],
    },
    Format {
        name: "ROS",
        files: "left.yaml and right.yaml",
        keys: &[
            &["camera_matrix", "distortion_coefficients", "rectification_matrix", "projection_matrix"],
            &["K", "D", "R", "P"],
        ],
    },
    Format {
        name: "Kalibr",
        files: "camchain.yaml",
        keys: &[&["cam0", "cam1", "T_cn_cnm1"], &["cam0", "cam1", "T_cam_imu"]],
    },
    Format {
        name: "EuRoC",
        files: "sensor.yaml of both cameras",
        keys: &[&["T_BS", "intrinsics", "distortion_coefficients"]],
    },
    Format { name: "ZED", files: "SN*.conf", keys: &[&["LEFT_CAM_HD", "RIGHT_CAM_HD", "STEREO"]] },
    Format {
        name: "OAK-D",
        files: "the camera's calibration as .json",
        keys: &[&["cameraData", "intrinsicMatrix", "distortionCoeff", "extrinsics"]],
    },
    Format {
        name: "Middlebury and ETH3D",
        files: "calib.txt",
        keys: &[&["cam0", "cam1", "baseline"], &["cam0", "doffs", "baseline"]],
    },
    Format { name: "KITTI", files: "calib.txt", keys: &[&["P2", "P3"], &["P0", "P1"]] },
];

/// Returns the error of a file of unknown format.
pub fn unknown_format(path: &Path) -> CalibrationError {
    let hint = find_similar(path).unwrap_or_default();
    CalibrationError::Unknown { path: path.to_owned(), hint, formats: list_formats() }
}

/// Returns all formats with the entries of their first group, in one line.
fn list_formats() -> String {
    let describe = |format: &Format| format!("{} ({})", format.name, format.keys[0].join(" "));
    FORMATS.iter().map(describe).collect::<Vec<_>>().join(", ")
}

/// Describes the best-matching format, with its present and missing entries; `None` below a third of the entries.
fn find_similar(path: &Path) -> Option<String> {
    let text = input::read(path, input::MAX_CALIBRATION_BYTES).ok()?;
    let text = String::from_utf8_lossy(&text);
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
    let words: HashSet<&str> = text.split(|c| !is_part(c)).collect();
    let is_found = |key: &&&str| words.contains(**key);
    let groups = FORMATS.iter().flat_map(|format| format.keys.iter().map(move |keys| (format.name, *keys)));
    let rated =
        groups.map(|(name, keys)| (keys.iter().filter(is_found).count() as f64 / keys.len() as f64, name, keys));
    let (_, name, keys) = rated.filter(|(fraction, ..)| *fraction >= 1.0 / 3.0).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (found, lacking): (Vec<&str>, Vec<&str>) = keys.iter().partition(|key| words.contains(**key));
    Some(match lacking.as_slice() {
        [] => format!("; it has {} of {name}, but in other places", found.join(" ")),
        _ => format!("; it has {} of {name}, and lacks {}", found.join(" "), lacking.join(" ")),
    })
}
