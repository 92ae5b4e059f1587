//! Stereo calibration: intrinsics and lens of both cameras, the pose between them, and the rectification of their
//! pictures.
//!
//! [`rectifier::Rectifier`] turns its pictures into a rectified
//! pair. [`registration::Registration`] reprojects depth into the view of a colour camera.

mod error;
pub mod lens;
mod lens_model;
pub mod map;
pub mod rectification;
pub mod rectifier;
pub mod registration;

use glam::{DMat3, DQuat, DVec2, DVec3};

pub use error::{CalibrationError, Fault};
pub use lens_model::LensFault;
use rectification::Rectification;

/// Lens distortion of a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// OpenCV's model, in its order: k1 k2 p1 p2 k3 k4 k5 k6 (radial, tangential, rational; unused ones are 0).
    RadialTangential([f64; 8]),
    /// OpenCV's model with a thin prism and a tilted sensor: the eight of [`Self::RadialTangential`], then s1 s2 s3 s4,
    /// and the tilts about x and y in radians, at most 0.5.
    PrismTilted([f64; 14]),
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
    /// The origin of the translation's unit.
    pub unit: LengthUnit,
}

/// The origin of the unit of a translation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// The format or the user states it.
    Stated,
    /// Metres, assumed.
    AssumedMetres,
    /// Millimetres, assumed: no rig is so wide in metres.
    AssumedMillimetres,
}

/// A longer translation without a unit is in millimetres.
const MAX_BASELINE_M: f64 = 2.0;
/// Baselines that are plausible for a translation without a unit, taken as metres.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 0.005..=0.5;
/// Minimum plausible baseline for a translation without a unit, taken as millimetres: a shorter one is rather in
/// centimetres or in squares of the chessboard.
const MIN_PLAUSIBLE_MM: f64 = 20.0;

impl LengthUnit {
    /// Returns the unit to assume for a translation of this length.
    pub fn assume(length: f64) -> Self {
        if length > MAX_BASELINE_M { Self::AssumedMillimetres } else { Self::AssumedMetres }
    }

    /// Returns the unit in metres.
    pub fn metres(self) -> f64 {
        if self == Self::AssumedMillimetres { 1e-3 } else { 1.0 }
    }
}

/// Relative difference up to which aspects count as equal: sizes are in whole pixels.
const ASPECT_TOLERANCE: f64 = 0.01;

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

    /// Returns the same rig with this distance between the cameras, in metres, > 0; all depth scales with it.
    #[must_use]
    pub fn with_baseline_m(&self, baseline_m: f64) -> Self {
        let scale = baseline_m / self.baseline_m();
        let stored_rectification =
            self.stored_rectification.map(|given| Rectification { baseline_m: given.baseline_m * scale, ..given });
        Self { translation_m: self.translation_m * scale, stored_rectification, unit: LengthUnit::Stated, ..*self }
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
            unit: self.unit,
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
            *camera = camera.scaled(size, scale);
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

    /// Whether the unit is stated, or the one assumed gives a usual baseline.
    fn is_plausible(&self) -> bool {
        let baseline_m = self.baseline_m();
        match self.unit {
            LengthUnit::Stated => true,
            LengthUnit::AssumedMetres => PLAUSIBLE_M.contains(&baseline_m),
            LengthUnit::AssumedMillimetres => baseline_m <= *PLAUSIBLE_M.end() && baseline_m * 1e3 >= MIN_PLAUSIBLE_MM,
        }
    }

    /// Returns a warning for the user, in one line, if the assumed unit gives an unusual baseline.
    pub fn describe_doubt(&self) -> Option<String> {
        let unit = if self.unit == LengthUnit::AssumedMetres { "metres" } else { "millimetres" };
        let baseline_mm = self.baseline_m() * 1e3;
        (!self.is_plausible()).then(|| {
            format!(
                "the calibration states no unit, and in {unit} its baseline of {baseline_mm:.1} mm is implausible (it \
                 may be in centimetres, or in squares of the chessboard): measure the distance between the lenses, and \
                 give it with --baseline-m"
            )
        })
    }

    /// Returns the assumptions made for pictures of `size` (columns, rows), one line each for the user.
    pub fn describe_assumptions(&self, size: (u32, u32)) -> Vec<String> {
        let mut notes = Vec::new();
        if self.unit == LengthUnit::AssumedMillimetres && self.is_plausible() {
            let baseline_mm = self.baseline_m() * 1e3;
            notes.push(format!(
                "the calibration states no unit; assuming millimetres: a baseline of {baseline_mm:.1} mm"
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

/// Returns columns and rows as a vector.
fn sides_px((width, height): (u32, u32)) -> DVec2 {
    DVec2::new(f64::from(width), f64::from(height))
}

impl CameraIntrinsics {
    /// Returns the camera for pictures of `size` (columns, rows), scaled if the aspect is the same.
    ///
    /// # Errors
    /// Same as for [`StereoCalibration::scale_to`].
    pub fn scaled_to(&self, size: (u32, u32)) -> Result<Self, CalibrationError> {
        self.scale_factor(size).map(|scale| self.scaled(size, scale))
    }

    /// Returns the camera for pictures of `size`, which are scaled along columns and rows.
    fn scaled(&self, size: (u32, u32), scale: DVec2) -> Self {
        let (focal_px, center_px) = (self.focal_px * scale, scale_point_px(self.center_px, scale));
        Self { size: Some(size), focal_px, center_px, ..*self }
    }

    /// Returns the scale along columns and rows from the calibration pictures to those of `size`; 1 if their size is
    /// unknown and may be `size`.
    fn scale_factor(&self, size: (u32, u32)) -> Result<DVec2, CalibrationError> {
        let Some(calibrated) = self.size else {
            let fraction = self.center_px / sides_px(size);
            let is_plausible = fraction.min_element() >= 0.25 && fraction.max_element() <= 0.75;
            let refusal = CalibrationError::NoSize { center_px: self.center_px.into(), found: size };
            return if is_plausible { Ok(DVec2::ONE) } else { Err(refusal) };
        };
        let scale = sides_px(size) / sides_px(calibrated);
        let is_same = (scale.x / scale.y - 1.0).abs() <= ASPECT_TOLERANCE;
        if is_same { Ok(scale) } else { Err(CalibrationError::AspectRatio { calibrated, found: size }) }
    }
}
