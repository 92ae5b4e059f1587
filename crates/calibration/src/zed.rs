//! Reads the factory calibration of ZED cameras, `SN*.conf`: both cameras at several picture sizes, and the pose
//! between them, as Stereolabs' `zed-stereo-calibration` writes it: the baseline in millimetres and the rotation vector
//! RX CV RZ in radians.

use glam::{DMat3, DQuat, DVec3};

use super::entries;
use super::tree::{File, Value};
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};

/// Suffixes of the sections, with columns and rows of their pictures.
const MODES: [(&str, (u32, u32)); 7] = [
    ("VGA", (672, 376)),
    ("SVGA", (960, 600)),
    ("HD", (1280, 720)),
    ("FHD", (1920, 1080)),
    ("FHD1200", (1920, 1200)),
    ("2K", (2208, 1242)),
    ("4K", (3840, 2160)),
];
/// Remedy for a missing section or key.
const HINT: &str = "download the file again from calib.stereolabs.com";
const MM_PER_M: f64 = 1e3;

/// Returns the entry `key`, in upper or lower case.
fn find<'a>(map: Value<'a>, key: &str) -> Option<Value<'a>> {
    map.find(|name| name.eq_ignore_ascii_case(key))
}

fn require<'a>(map: Value<'a>, key: &str) -> Result<Value<'a>, CalibrationError> {
    find(map, key).ok_or_else(|| map.to_error(Fault::Missing { key: key.into(), hint: HINT }))
}

/// Whether the file has sections of this format.
pub(super) fn is_conf(file: &File) -> bool {
    file.root().find(|section| section.to_ascii_uppercase().starts_with("LEFT_CAM_")).is_some()
}

/// Reads the sections for the picture size nearest to `size` (columns, rows), or for the largest.
pub(super) fn from_file(file: &File, size: Option<(u32, u32)>) -> Result<StereoCalibration, CalibrationError> {
    let root = file.root();
    let distance = |&(_, mode): &(&str, (u32, u32))| {
        let (width, height) = size.unwrap_or((u32::MAX, u32::MAX));
        let ratio = |a: u32, b: u32| (f64::from(a) / f64::from(b)).ln().abs();
        ratio(width, mode.0) + ratio(height, mode.1)
    };
    let modes = MODES.into_iter().filter(|(name, _)| find(root, &format!("LEFT_CAM_{name}")).is_some());
    let (mode, size) = modes
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .ok_or_else(|| root.to_error(Fault::Missing { key: "LEFT_CAM_HD".into(), hint: HINT }))?;

    let stereo = require(root, "STEREO")?;
    // A rotation is of no picture size, so that another one's will do.
    let angle = |axis: &str| {
        let own = find(stereo, &format!("{axis}_{mode}"));
        let any = || stereo.find(|key| key.to_ascii_uppercase().starts_with(&format!("{axis}_")));
        own.or_else(any).ok_or_else(|| stereo.to_error(Fault::Missing { key: format!("{axis}_{mode}"), hint: HINT }))
    };
    let shift_mm = |axis: &str| {
        let value = find(stereo, axis).or_else(|| find(stereo, &format!("{axis}_{mode}")));
        value.map_or(Ok(0.0), |value| value.number())
    };
    let turn = DVec3::new(angle("RX")?.number()?, angle("CV")?.number()?, angle("RZ")?.number()?);
    if turn.length() > std::f64::consts::PI {
        return Err(stereo.to_error(Fault::Impossible { key: "RX CV RZ".into(), what: "is not a rotation in radians" }));
    }
    let baseline = require(stereo, "Baseline")?;
    let translation_mm = DVec3::new(-baseline.number()?, shift_mm("TY")?, shift_mm("TZ")?);
    Ok(StereoCalibration {
        cameras: [read_camera(root, "LEFT", mode, size)?, read_camera(root, "RIGHT", mode, size)?],
        rotation: DMat3::from_quat(DQuat::from_scaled_axis(turn)),
        translation_m: entries::require_baseline(baseline, translation_mm / MM_PER_M)?,
        stored_rectification: None,
        unit: LengthUnit::Stated,
    })
}

/// Reads a camera at one picture size. Its lens is in its section, or in one for all sizes.
fn read_camera(
    root: Value<'_>,
    side: &str,
    mode: &str,
    size: (u32, u32),
) -> Result<CameraIntrinsics, CalibrationError> {
    let section = require(root, &format!("{side}_CAM_{mode}"))?;
    let number = |key: &str| require(section, key)?.number();
    let (focal_px, center_px) =
        entries::parse_pinhole(section, [number("fx")?, number("fy")?, number("cx")?, number("cy")?])?;
    let lens = if find(section, "k1").is_some() { section } else { require(root, &format!("{side}_DISTO"))? };
    let mut coefficients = [0.0; 8];
    for (to, key) in coefficients.iter_mut().zip(["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]) {
        *to = find(lens, key).map_or(Ok(0.0), |value| value.number())?;
    }
    Ok(CameraIntrinsics {
        size: Some(size),
        focal_px,
        center_px,
        distortion: Distortion::RadialTangential(coefficients),
    })
}
