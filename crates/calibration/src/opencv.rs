//! Reads OpenCV's FileStorage, in YAML, as its sample `stereo_calib` writes it: cameras, lenses and pose (M1 D1 M2 D2 R
//! T), the results of `stereoRectify` (R1 R2 P1 P2), or both, in one file or two.

use glam::DVec3;

use super::tree::{File, Value};
use super::{entries, stored};
use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam::calibration::{CameraIntrinsics, LengthUnit, StereoCalibration};

/// Largest difference between the rectification and the pose: of elements of the rotation, and of the translation
/// relative to its length.
const POSE_TOLERANCE: f64 = 0.02;
/// Remedy for a missing camera.
const CAMERA_HINT: &str = "name the file with M1 D1 M2 D2 (intrinsics.yml) as well";
/// Remedy for a missing lens.
const LENS_HINT: &str = "write the lens's coefficients, zeros where the pictures have no distortion";
/// Remedy for a missing pose.
const POSE_HINT: &str = "name the file with R and T, or R1 R2 P1 P2 (extrinsics.yml), as well";

/// Alternative names of an entry, in lower case and without punctuation.
type Names = &'static [&'static str];

const CAMERAS: [Names; 2] = [
    &["m1", "k1", "cameramatrix1", "cameramatrixleft", "leftcameramatrix", "kleft", "mleft"],
    &["m2", "k2", "cameramatrix2", "cameramatrixright", "rightcameramatrix", "kright", "mright"],
];
const LENSES: [Names; 2] = [
    &["d1", "distcoeffs1", "distcoeffsleft", "leftdistcoeffs", "distortioncoefficientsleft", "distortionleft", "dleft"],
    &[
        "d2",
        "distcoeffs2",
        "distcoeffsright",
        "rightdistcoeffs",
        "distortioncoefficientsright",
        "distortionright",
        "dright",
    ],
];
const ROTATION: Names = &["r", "rotation", "rotationmatrix"];
const TRANSLATION: Names = &["t", "translation", "translationvector"];
/// R1 and R2, which rotate from each camera's axes to the rectified ones.
const ROTATIONS: [Names; 2] = [&["r1", "rectificationleft", "rleft"], &["r2", "rectificationright", "rright"]];
const PROJECTIONS: [Names; 2] = [&["p1", "projectionleft", "pleft"], &["p2", "projectionright", "pright"]];
const MODEL: Names = &["distortionmodel"];
const SIZE: Names = &["imagesize", "size"];
const WIDTH: Names = &["imagewidth", "width"];
const HEIGHT: Names = &["imageheight", "height"];

fn find_entry<'a>(files: &'a [File], names: Names) -> Option<Value<'a>> {
    let matches_key = |key: &str| names.contains(&key.to_ascii_lowercase().replace(['_', '-', '.'], "").as_str());
    files.iter().find_map(|file| file.root().find(matches_key))
}

fn require_entry<'a>(
    files: &'a [File],
    names: Names,
    key: &str,
    hint: &'static str,
) -> Result<Value<'a>, CalibrationError> {
    let missing = || files[0].root().to_error(Fault::Missing { key: key.into(), hint });
    find_entry(files, names).ok_or_else(missing)
}

/// Whether the files have entries of this format.
pub(super) fn is_opencv(files: &[File]) -> bool {
    CAMERAS.into_iter().chain(ROTATIONS).any(|names| find_entry(files, names).is_some())
        || (find_entry(files, ROTATION).is_some() && find_entry(files, TRANSLATION).is_some())
}

/// Whether cameras or pose are missing, which may be in a second file.
pub(super) fn is_partial(files: &[File]) -> bool {
    find_entry(files, CAMERAS[0]).is_none()
        || (find_entry(files, ROTATION).is_none() && find_entry(files, ROTATIONS[0]).is_none())
}

/// Reads the calibration in `files`, at least one. The pose is R and T, or else computed from R1 R2 P1 P2; if both are
/// present they must agree.
pub(super) fn from_files(files: &[File]) -> Result<StereoCalibration, CalibrationError> {
    let size = read_size(files)?;
    let cameras = [read_camera(files, 0, size)?, read_camera(files, 1, size)?];
    let mut given = read_rectification(files)?;
    let (rotation, translation) = match given {
        Some((ref given, shift)) if find_entry(files, ROTATION).is_none() => stored::find_pose(given, shift),
        _ => {
            let rotation = require_entry(files, ROTATION, "R", POSE_HINT)?;
            let place = require_entry(files, TRANSLATION, "T", POSE_HINT)?;
            let translation = DVec3::from_array(place.parse_numbers::<3>(3, "3x1")?);
            (
                entries::parse_rotation(rotation, &rotation.parse_numbers::<9>(3, "3x3")?)?,
                entries::require_baseline(place, translation)?,
            )
        }
    };
    if let Some((given, shift)) = &given {
        let rotation_error = given.rotations[1] * rotation - given.rotations[0];
        let shift_error = given.rotations[1] * translation - DVec3::new(*shift, 0.0, 0.0);
        let is_same = rotation_error.to_cols_array().iter().all(|part| part.abs() < POSE_TOLERANCE);
        if !is_same || shift_error.length() > POSE_TOLERANCE * translation.length() {
            let value = require_entry(files, ROTATIONS[1], "R2", POSE_HINT)?;
            let what = "does not match R and T: R2 R must equal R1, and R2 T must be the shift of P2 along the columns";
            return Err(value.to_error(Fault::Impossible { key: value.key(), what }));
        }
    }
    let unit = LengthUnit::assume(translation.length());
    if let Some((given, _)) = &mut given {
        given.baseline_m *= unit.metres();
    }
    Ok(StereoCalibration {
        cameras,
        rotation,
        translation_m: translation * unit.metres(),
        stored_rectification: given.map(|(given, _)| given),
        unit,
    })
}

/// Returns columns and rows of the pictures, from either spelling; `None` if the files do not state them.
fn read_size(files: &[File]) -> Result<Option<(u32, u32)>, CalibrationError> {
    if let (Some(width), Some(height)) = (find_entry(files, WIDTH), find_entry(files, HEIGHT)) {
        let side = |value: Value<'_>| entries::parse_side(value, value.parse_count()?.into());
        return Ok(Some((side(width)?, side(height)?)));
    }
    find_entry(files, SIZE).map(entries::parse_size).transpose()
}

fn read_camera(files: &[File], side: usize, size: Option<(u32, u32)>) -> Result<CameraIntrinsics, CalibrationError> {
    let camera = require_entry(files, CAMERAS[side], ["M1", "M2"][side], CAMERA_HINT)?;
    let (focal_px, center_px) = entries::parse_camera_matrix(camera)?;
    let lens = require_entry(files, LENSES[side], ["D1", "D2"][side], LENS_HINT)?;
    Ok(CameraIntrinsics {
        size,
        focal_px,
        center_px,
        distortion: entries::parse_distortion(find_entry(files, MODEL), lens)?,
    })
}

/// Reads R1 R2 P1 P2; `None` if all four are missing.
fn read_rectification(files: &[File]) -> Result<Option<(Rectification, f64)>, CalibrationError> {
    if ROTATIONS.into_iter().chain(PROJECTIONS).all(|names| find_entry(files, names).is_none()) {
        return Ok(None);
    }
    let require = |names, key| require_entry(files, names, key, POSE_HINT);
    let rotations = [require(ROTATIONS[0], "R1")?, require(ROTATIONS[1], "R2")?];
    let projections = [require(PROJECTIONS[0], "P1")?, require(PROJECTIONS[1], "P2")?];
    stored::parse_rectification(rotations, projections).map(Some)
}
