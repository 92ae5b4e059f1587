//! Two cameras beside each other: how each images the world, how they stand, and what makes their pictures a pair with
//! the same point in the same row.
//!
//! [`load`] reads a [`StereoCalibration`]; [`rectifier::Rectifier`] makes its pictures a rectified pair.

#[cfg(feature = "files")]
mod entries;
mod error;
#[cfg(feature = "files")]
pub mod euroc;
#[cfg(feature = "files")]
mod kalibr;
pub mod lens;
pub mod map;
#[cfg(feature = "files")]
mod opencv;
pub mod rectification;
pub mod rectifier;
#[cfg(feature = "files")]
mod yaml;

#[cfg(feature = "files")]
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec2, DVec3};

pub use error::{CalibrationError, Fault};
use rectification::Rectification;

/// How a lens bends the rays of a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's model, in its order: k1 k2 p1 p2 k3 k4 k5 k6 (radial, tangential, rational; unused ones are 0).
    RadialTangential([f64; 8]),
    /// Kannala and Brandt's fisheye: the angle to the axis becomes `t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9`.
    Equidistant([f64; 4]),
}

/// One camera as it was calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Columns and rows of the pictures that the numbers belong to; `None` where the file does not say.
    pub size: Option<(u32, u32)>,
    /// Focal lengths along columns and rows, in pixels, > 0.
    pub focal_px: DVec2,
    /// Column and row of the principal point; pixel centres are at whole numbers.
    pub center_px: DVec2,
    /// Its lens.
    pub distortion: Distortion,
}

/// Two cameras, and how the right one stands: `x_right = rotation * x_left + translation_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoCalibration {
    /// Left, then right.
    pub eyes: [Eye; 2],
    /// From the left camera's axes to the right one's.
    pub rotation: DMat3,
    /// The left camera's place in the right one's axes; about `(-baseline, 0, 0)`.
    pub translation_m: DVec3,
    /// The rectification that the file itself gives; otherwise it is computed.
    pub given: Option<Rectification>,
    /// Whether the file, which names no unit, had a translation longer than 2: it was then taken as millimetres.
    pub assumed_mm: bool,
}

/// Aspects this close are the same: sizes are whole pixels.
const SAME_ASPECT: f64 = 0.01;

/// Reads a calibration, recognised by content: OpenCV's FileStorage YAML (one file, or two; of `intrinsics.yml` and
/// `extrinsics.yml` one is enough where the other one lies beside it), Kalibr's camchain, or EuRoC's `sensor.yaml` of
/// the left and of the right camera.
///
/// # Errors
/// A file cannot be read, is none of these, has a key missing, or numbers that cannot be.
#[cfg(feature = "files")]
pub fn load(paths: &[&Path]) -> Result<StereoCalibration, CalibrationError> {
    if !(1..=2).contains(&paths.len()) {
        return Err(CalibrationError::Files(paths.len()));
    }
    let mut files = Vec::with_capacity(2);
    for path in paths {
        files.push(yaml::File::open(path)?);
    }
    let has = |key| files[0].root().get(key).is_some();
    match files.as_slice() {
        [left, right] if has("T_BS") => return euroc::from_files(left, right),
        [only] if has("T_BS") => return Err(CalibrationError::OneSensor(only.path().to_owned())),
        [chain, ..] if has("cam0") || has("cam1") => return kalibr::from_file(chain),
        _ => {}
    }
    if !opencv::is_known(&files) {
        return Err(CalibrationError::Unknown(paths[0].to_owned()));
    }
    if let (true, Some(other)) = (files.len() == 1 && opencv::is_partial(&files), companion(paths[0])) {
        files.push(yaml::File::open(&other)?);
    }
    opencv::from_files(&files)
}

#[cfg(feature = "files")]
/// The file beside `path` with `extrinsic` for `intrinsic` in its name, or the other way round, if there is one.
fn companion(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let other = if name.contains("intrinsic") {
        name.replace("intrinsic", "extrinsic")
    } else {
        name.replace("extrinsic", "intrinsic")
    };
    Some(path.with_file_name(&other)).filter(|other| other != path && other.is_file())
}

impl StereoCalibration {
    /// Half of the rotation between the eyes: applied in the right eye's axes, and its inverse in the left one's, it
    /// makes both look the same way.
    fn half_turn(&self) -> DMat3 {
        DMat3::from_quat(DQuat::from_scaled_axis(DQuat::from_mat3(&self.rotation).to_scaled_axis() * -0.5))
    }

    /// The left camera's place in the right one's axes after [`Self::half_turn`], in metres.
    fn halfway_m(&self) -> DVec3 {
        self.half_turn() * self.translation_m
    }

    /// Distance of the eyes in metres.
    pub fn baseline_m(&self) -> f64 {
        self.translation_m.length()
    }

    /// Whether the camera that is called left stands on the right.
    pub fn is_swapped(&self) -> bool {
        self.halfway_m().x > 0.0
    }

    /// The same rig with left and right exchanged; the pictures are to be exchanged as well.
    #[must_use]
    pub fn exchanged(&self) -> Self {
        let [left, right] = self.eyes;
        let rotation = self.rotation.transpose();
        Self {
            eyes: [right, left],
            rotation,
            translation_m: -(rotation * self.translation_m),
            given: self.given.map(|given| given.exchanged()),
            assumed_mm: self.assumed_mm,
        }
    }

    /// The calibration for pictures of `size` (columns, rows): scaled to it where the aspect is the same. One that
    /// names no size is taken to be for `size` if the principal points lie in the middle half of the pictures.
    ///
    /// # Errors
    /// Neither holds.
    pub fn at(&self, size: (u32, u32)) -> Result<Self, CalibrationError> {
        let mut scaled = *self;
        for (side, eye) in scaled.eyes.iter_mut().enumerate() {
            let scale = eye.scale_to(size)?;
            eye.size = Some(size);
            eye.focal_px *= scale;
            eye.center_px = scaled_px(eye.center_px, scale);
            if let Some(given) = &mut scaled.given {
                given.centers_px[side] = scaled_px(given.centers_px[side], scale);
                // Both eyes share one focal length: it is scaled once.
                if side == 0 {
                    given.focal_px *= scale;
                }
            }
        }
        Ok(scaled)
    }

    /// What was assumed for pictures of `size` (columns, rows), a line each for the user; empty if nothing was.
    pub fn notes(&self, size: (u32, u32)) -> Vec<String> {
        let mut notes = Vec::new();
        if self.assumed_mm {
            let baseline_m = self.baseline_m();
            notes.push(format!("the calibration names no unit; taken as millimetres: a baseline of {baseline_m:.3} m"));
        }
        let (width, height) = size;
        match self.eyes[0].size {
            None => notes.push(format!("the calibration names no picture size; taken as {width}x{height}")),
            Some(from) if from != size => {
                notes.push(format!("the calibration is for {}x{}; scaled to {width}x{height}", from.0, from.1));
            }
            Some(_) => {}
        }
        notes
    }
}

/// A place in a picture after the picture was scaled: its edges, half a pixel outside, go onto each other.
fn scaled_px(point_px: DVec2, scale: DVec2) -> DVec2 {
    (point_px + 0.5) * scale - 0.5
}

impl Eye {
    /// Scale along columns and rows from the pictures it was calibrated with to those of `size`; 1 where their size is
    /// not known and may be `size`.
    fn scale_to(&self, size: (u32, u32)) -> Result<DVec2, CalibrationError> {
        let sides = |(width, height): (u32, u32)| DVec2::new(f64::from(width), f64::from(height));
        let Some(calibrated) = self.size else {
            let share = self.center_px / sides(size);
            let is_plausible = share.min_element() >= 0.25 && share.max_element() <= 0.75;
            let refusal = CalibrationError::NoSize { center_px: self.center_px.into(), found: size };
            return if is_plausible { Ok(DVec2::ONE) } else { Err(refusal) };
        };
        let scale = sides(size) / sides(calibrated);
        let is_same = (scale.x / scale.y - 1.0).abs() <= SAME_ASPECT;
        if is_same { Ok(scale) } else { Err(CalibrationError::Shape { calibrated, found: size }) }
    }
}
