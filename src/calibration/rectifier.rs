//! Both eyes' pictures made a rectified pair, frame by frame.

use super::map::Map;
use super::rectification::Rectification;
use super::{CalibrationError, StereoCalibration};
use crate::frame::{ColorImage, GrayImage};
use crate::optics::StereoRig;

/// The pictures that can be rectified have sides of these lengths.
const SIDES_PX: std::ops::RangeInclusive<u32> = 2..=16384;

/// Rectifies pictures of one size. The maps are computed once; a frame allocates nothing.
#[derive(Clone, Debug)]
pub struct Rectifier {
    rectification: Rectification,
    maps: [Map; 2],
}

impl Rectifier {
    /// The maps of a calibration for pictures of `size` (columns, rows).
    ///
    /// # Errors
    /// As [`Rectification::of`], and when a side has less than 2 pixels.
    pub fn new(calibration: &StereoCalibration, size: (u32, u32)) -> Result<Self, CalibrationError> {
        if ![size.0, size.1].iter().all(|side| SIDES_PX.contains(side)) {
            return Err(CalibrationError::Size(size));
        }
        let rectification = Rectification::of(calibration, size)?;
        let eyes = calibration.at(size)?.eyes;
        let maps = [0, 1].map(|side| {
            let eye = &eyes[side];
            let reach = eye.distortion.reach();
            Map::new(size, |pixel_px| eye.project(rectification.direction(side, pixel_px), reach))
        });
        Ok(Self { rectification, maps })
    }

    /// Columns and rows of the pictures, before and after.
    pub fn size(&self) -> (u32, u32) {
        self.maps[0].size()
    }

    /// From disparities of the rectified pair to depth.
    pub fn rig(&self) -> StereoRig {
        self.rectification.rig()
    }

    /// How the eyes were turned, and what they see now.
    pub fn rectification(&self) -> &Rectification {
        &self.rectification
    }

    /// Where the pixels of the left and of the right rectified picture come from: for other kinds of pictures, and for
    /// parts of pictures on several threads.
    pub fn maps(&self) -> &[Map; 2] {
        &self.maps
    }

    /// The left picture, rectified, into `into`.
    ///
    /// # Panics
    /// When `from` has not the size [`Rectifier::size`].
    pub fn left(&self, from: &ColorImage, into: &mut ColorImage) {
        self.maps[0].color(from, into);
    }

    /// The right picture, rectified, into `into`.
    ///
    /// # Panics
    /// When `from` has not the size [`Rectifier::size`].
    pub fn right(&self, from: &GrayImage, into: &mut GrayImage) {
        self.maps[1].gray(from, into);
    }
}
