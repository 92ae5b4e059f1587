//! Stereo calibration: intrinsics and lens of both cameras, the pose between them, and the rectification of their
//! pictures.
//!
//! [`load_calibration`] reads a [`StereoCalibration`]; [`rectifier::Rectifier`] turns its pictures into a rectified
//! pair.

#[cfg(feature = "files")]
mod entries;
mod error;
#[cfg(feature = "files")]
pub mod euroc;
#[cfg(feature = "files")]
mod ini;
#[cfg(feature = "files")]
mod kalibr;
pub mod lens;
pub mod map;
#[cfg(feature = "files")]
mod opencv;
pub mod rectification;
pub mod rectifier;
#[cfg(feature = "files")]
mod tree;
#[cfg(feature = "files")]
mod xml;
#[cfg(feature = "files")]
mod yaml;

#[cfg(feature = "files")]
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec2, DVec3};

pub use error::{CalibrationError, Fault};
use rectification::Rectification;

/// Lens distortion of a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's model, in its order: k1 k2 p1 p2 k3 k4 k5 k6 (radial, tangential, rational; unused ones are 0).
    RadialTangential([f64; 8]),
    /// Kannala and Brandt's fisheye: the angle to the axis becomes `t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9`.
    Equidistant([f64; 4]),
}

/// Intrinsics and lens of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraIntrinsics {
    /// Columns and rows of the calibration pictures; `None` if the file does not state them.
    pub size: Option<(u32, u32)>,
    /// Focal lengths along columns and rows, in pixels, > 0.
    pub focal_px: DVec2,
    /// Column and row of the principal point; pixel centres are at integers.
    pub center_px: DVec2,
    /// Lens distortion.
    pub distortion: Distortion,
}

/// Two cameras, with the pose of the right one: `x_right = rotation * x_left + translation_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoCalibration {
    /// Left, then right.
    pub cameras: [CameraIntrinsics; 2],
    /// Rotation from the left camera's axes to the right one's.
    pub rotation: DMat3,
    /// Position of the left camera in the right one's axes; about `(-baseline, 0, 0)`.
    pub translation_m: DVec3,
    /// The rectification that the file contains; `None` to compute it.
    pub stored_rectification: Option<Rectification>,
    /// Whether the translation, which has no unit in the file, was longer than 2, so that millimetres are assumed.
    pub assumed_mm: bool,
}

/// Relative difference up to which aspects count as equal: sizes are in whole pixels.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Reads a calibration, whose format is recognised by content: OpenCV's FileStorage YAML (one file or two; of
/// `intrinsics.yml` and `extrinsics.yml` one suffices if the other is beside it), Kalibr's camchain, or EuRoC's
/// `sensor.yaml` of the left and of the right camera.
///
/// # Errors
/// Fails if a file is unreadable, of unknown format, or lacks a key, or if numbers are invalid.
#[cfg(feature = "files")]
pub fn load_calibration(paths: &[&Path]) -> Result<StereoCalibration, CalibrationError> {
    if !(1..=2).contains(&paths.len()) {
        return Err(CalibrationError::Files(paths.len()));
    }
    let mut files = Vec::with_capacity(2);
    for path in paths {
        files.push(tree::File::open(path)?);
    }
    let has = |key| files[0].root().get(key).is_some();
    match files.as_slice() {
        [left, right] if has("T_BS") => return euroc::from_files(left, right),
        [only] if has("T_BS") => return Err(CalibrationError::OneSensor(only.path().to_owned())),
        [chain, ..] if has("cam0") || has("cam1") => return kalibr::from_file(chain),
        _ => {}
    }
    if !opencv::is_opencv(&files) {
        return Err(CalibrationError::Unknown(paths[0].to_owned()));
    }
    if let (true, Some(other)) = (files.len() == 1 && opencv::is_partial(&files), find_companion_file(paths[0])) {
        files.push(tree::File::open(&other)?);
    }
    opencv::from_files(&files)
}

#[cfg(feature = "files")]
/// Returns the file beside `path` with `extrinsic` for `intrinsic` in its name, or the other way round, if it exists.
fn find_companion_file(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let other = if name.contains("intrinsic") {
        name.replace("intrinsic", "extrinsic")
    } else {
        name.replace("extrinsic", "intrinsic")
    };
    Some(path.with_file_name(&other)).filter(|other| other != path && other.is_file())
}

impl StereoCalibration {
    /// Returns half of the rotation between the cameras: applied in the right camera's axes, and its inverse in the
    /// left one's, it makes both look in the same direction.
    fn half_rotation(&self) -> DMat3 {
        DMat3::from_quat(DQuat::from_scaled_axis(DQuat::from_mat3(&self.rotation).to_scaled_axis() * -0.5))
    }

    /// Returns the position of the left camera in the right one's axes after [`Self::half_rotation`], in metres.
    fn half_rotated_translation_m(&self) -> DVec3 {
        self.half_rotation() * self.translation_m
    }

    /// Returns the distance between the cameras in metres.
    pub fn baseline_m(&self) -> f64 {
        self.translation_m.length()
    }

    /// Whether the left camera is on the right.
    pub fn is_swapped(&self) -> bool {
        self.half_rotated_translation_m().x > 0.0
    }

    /// Returns the same rig with left and right exchanged; the pictures must be exchanged as well.
    #[must_use]
    pub fn with_swapped_cameras(&self) -> Self {
        let [left, right] = self.cameras;
        let rotation = self.rotation.transpose();
        Self {
            cameras: [right, left],
            rotation,
            translation_m: -(rotation * self.translation_m),
            stored_rectification: self.stored_rectification.map(|given| given.with_swapped_cameras()),
            assumed_mm: self.assumed_mm,
        }
    }

    /// Returns the calibration for pictures of `size` (columns, rows), scaled if the aspect is the same. Without a size
    /// in the file it is assumed to be for `size` if the principal points are in the middle half of the pictures.
    ///
    /// # Errors
    /// Fails if the aspect differs, or the principal points are elsewhere.
    pub fn scale_to(&self, size: (u32, u32)) -> Result<Self, CalibrationError> {
        let mut scaled = *self;
        for (side, camera) in scaled.cameras.iter_mut().enumerate() {
            let scale = camera.scale_factor(size)?;
            camera.size = Some(size);
            camera.focal_px *= scale;
            camera.center_px = scale_point_px(camera.center_px, scale);
            if let Some(given) = &mut scaled.stored_rectification {
                given.centers_px[side] = scale_point_px(given.centers_px[side], scale);
                // Both cameras share one rectified focal length: it is scaled once.
                if side == 0 {
                    given.focal_px *= scale;
                }
            }
        }
        Ok(scaled)
    }

    /// Returns the assumptions made for pictures of `size` (columns, rows), one line each for the user.
    pub fn describe_assumptions(&self, size: (u32, u32)) -> Vec<String> {
        let mut notes = Vec::new();
        if self.assumed_mm {
            let baseline_m = self.baseline_m();
            notes.push(format!(
                "the calibration states no unit; assuming millimetres: a baseline of {baseline_m:.3} \
                                m"
            ));
        }
        let (width, height) = size;
        match self.cameras[0].size {
            None => notes.push(format!("the calibration states no picture size; assuming {width}x{height}")),
            Some(from) if from != size => {
                notes.push(format!("the calibration is for {}x{}; scaled to {width}x{height}", from.0, from.1));
            }
            Some(_) => {}
        }
        notes
    }
}

/// Scales a point with its picture, whose edges lie half a pixel outside the border pixels' centres.
fn scale_point_px(point_px: DVec2, scale: DVec2) -> DVec2 {
    (point_px + 0.5) * scale - 0.5
}

impl CameraIntrinsics {
    /// Returns the scale along columns and rows from the calibration pictures to those of `size`; 1 if their size is
    /// unknown and may be `size`.
    fn scale_factor(&self, size: (u32, u32)) -> Result<DVec2, CalibrationError> {
        let sides = |(width, height): (u32, u32)| DVec2::new(f64::from(width), f64::from(height));
        let Some(calibrated) = self.size else {
            let fraction = self.center_px / sides(size);
            let is_plausible = fraction.min_element() >= 0.25 && fraction.max_element() <= 0.75;
            let refusal = CalibrationError::NoSize { center_px: self.center_px.into(), found: size };
            return if is_plausible { Ok(DVec2::ONE) } else { Err(refusal) };
        };
        let scale = sides(size) / sides(calibrated);
        let is_same = (scale.x / scale.y - 1.0).abs() <= ASPECT_TOLERANCE;
        if is_same { Ok(scale) } else { Err(CalibrationError::AspectRatio { calibrated, found: size }) }
    }
}
