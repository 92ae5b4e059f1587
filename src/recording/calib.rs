//! The `calib.txt` of a rectified pair: in the form of Middlebury and ETH3D, or in that of KITTI.

use std::path::Path;

use super::error::RecordingError;
use super::geometry::Geometry;
use super::{kitti, middlebury};

impl Geometry {
    /// Reads a calibration; its form is told by its content. Of KITTI's four cameras those are taken in whose folder
    /// the picture `left` is; where that tells nothing, the colour cameras 2 and 3, else 0 and 1.
    ///
    /// # Errors
    /// It cannot be read, is of another kind, lacks a key, or has numbers that cannot be.
    pub fn read(file: &Path, left: &Path) -> Result<Self, RecordingError> {
        Self::read_as(file, |text| {
            if middlebury::calib::is_one(text) {
                middlebury::calib::parse(text)
            } else {
                kitti::calib::parse(text, kitti::camera_of(left))
            }
        })
    }
}
