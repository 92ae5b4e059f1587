//! Reads the `calib.txt` of a rectified pair, in the format of Middlebury and ETH3D or of KITTI.

use std::path::Path;

use super::error::RecordingError;
use super::geometry::Geometry;
use super::{kitti, middlebury};

impl Geometry {
    /// Reads a calibration; the content decides its format. A KITTI file has four cameras: the folder of the picture
    /// `left` selects the pair; if it is not a KITTI folder, the colour cameras 2 and 3, or else 0 and 1.
    ///
    /// # Errors
    /// The file is unreadable, of another format, lacks a key, or has invalid numbers.
    pub fn read(file: &Path, left: &Path) -> Result<Self, RecordingError> {
        Self::read_with(file, |text| {
            if middlebury::calib::is_middlebury(text) {
                middlebury::calib::parse(text)
            } else {
                kitti::calib::parse(text, kitti::find_left_camera(left))
            }
        })
    }
}
