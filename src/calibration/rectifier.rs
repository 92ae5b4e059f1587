//! Rectifies the pictures of both cameras, frame by frame.

use super::map::RemapTable;
use super::rectification::Rectification;
use super::{CalibrationError, StereoCalibration};
use crate::frame::{ColorImage, GrayImage};
use crate::optics::StereoRig;

/// Supported side lengths of pictures.
const SIDES_PX: std::ops::RangeInclusive<u32> = 2..=16384;

/// Rectifies pictures of one size. The maps are computed once; a frame allocates nothing.
#[derive(Clone, Debug)]
pub struct Rectifier {
    rectification: Rectification,
    maps: [RemapTable; 2],
}

impl Rectifier {
    /// Computes the maps of a calibration for pictures of `size` (columns, rows).
    ///
    /// # Errors
    /// Fails like [`Rectification::from_calibration`], or if a side is outside 2 to 16384 pixels.
    pub fn new(calibration: &StereoCalibration, size: (u32, u32)) -> Result<Self, CalibrationError> {
        if ![size.0, size.1].iter().all(|side| SIDES_PX.contains(side)) {
            return Err(CalibrationError::Size(size));
        }
        let rectification = Rectification::from_calibration(calibration, size)?;
        let cameras = calibration.scale_to(size)?.cameras;
        let maps = [0, 1].map(|side| {
            let camera = &cameras[side];
            let max_radius = camera.distortion.max_radius();
            RemapTable::new(size, |pixel_px| camera.project(rectification.pixel_direction(side, pixel_px), max_radius))
        });
        Ok(Self { rectification, maps })
    }

    /// Returns columns and rows of the pictures, before and after.
    pub fn size(&self) -> (u32, u32) {
        self.maps[0].size()
    }

    /// Returns the rig that converts disparities of the rectified pair to depth.
    pub fn rig(&self) -> StereoRig {
        self.rectification.rig()
    }

    /// Returns the rotations and the intrinsics of the rectified pair.
    pub fn rectification(&self) -> &Rectification {
        &self.rectification
    }

    /// Returns the maps of the left and of the right rectified picture, for other kinds of pictures, and for parts of
    /// pictures on several threads.
    pub fn maps(&self) -> &[RemapTable; 2] {
        &self.maps
    }

    /// Rectifies the left picture into `into`.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`Rectifier::size`].
    pub fn rectify_left(&self, from: &ColorImage, into: &mut ColorImage) {
        self.maps[0].remap_color(from, into);
    }

    /// Rectifies the right picture into `into`.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`Rectifier::size`].
    pub fn rectify_right(&self, from: &GrayImage, into: &mut GrayImage) {
        self.maps[1].remap_gray(from, into);
    }
}
