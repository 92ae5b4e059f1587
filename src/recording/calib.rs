//! The `calib.txt` of a rectified pair: in the form of Middlebury and ETH3D, or in that of KITTI.

use std::path::Path;

use super::error::RecordingError;
use super::geometry::Geometry;
use super::{kitti, middlebury};

impl Geometry {
    /// Reads a calibration; its format is recognised by its content. A KITTI file has four cameras: the folder of the
    /// picture `left` selects the pair; if it is none of KITTI's, the colour cameras 2 and 3, else 0 and 1.
    ///
    /// # Errors
    /// It cannot be read, is of another kind, lacks a key, or has numbers that cannot be.
    pub fn read(file: &Path, left: &Path) -> Result<Self, RecordingError> {
        Self::read_as(file, |text| {
            if middlebury::calib::is_middlebury(text) {
                middlebury::calib::parse(text)
            } else {
                kitti::calib::parse(text, kitti::camera_of(left))
            }
        })
    }
}
