//! The geometry of a rectified pair, whatever the format of its `calib.txt`.

use std::path::Path;

use super::error::{RecordingError, Result};
use super::fault::GeometryFault;
use bokehcam::optics::StereoRig;
use bokehcam_files::input;

/// Relative difference of the focal lengths that counts as rounding.
const FOCAL_TOLERANCE: f64 = 1e-3;

/// The geometry of a rectified pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Focal length, baseline and difference of the principal points.
    pub rig: StereoRig,
    /// Width and height of the pictures that it is for, if stated.
    pub size: Option<(u32, u32)>,
    /// Number of disparities to search, from 0, if stated: a multiple of 16.
    pub disparity_count: Option<u32>,
}

/// A fault, and its line from 1 if it is in a single one.
pub(super) type GeometryError = (Option<u32>, GeometryFault);

impl Geometry {
    /// Reads a calibration file in the format of `parse`.
    pub(super) fn read_with(file: &Path, parse: impl Fn(&str) -> Result<Self, GeometryError>) -> Result<Self> {
        let text = input::read_text(file, input::MAX_CALIBRATION_BYTES)
            .map_err(RecordingError::io("read the calibration", file))?;
        parse(&text).map_err(|(line, fault)| RecordingError::Geometry { file: file.to_owned(), line, fault })
    }

    /// Scales the geometry to pictures of `size`. `file` is its source, for the message.
    ///
    /// # Errors
    /// The pictures have another aspect ratio.
    pub fn scaled_to(mut self, file: &Path, size: (u32, u32)) -> Result<Self> {
        let Some(of) = self.size.filter(|&of| of != size) else { return Ok(self) };
        let [width, height, of_width, of_height] = [size.0, size.1, of.0, of.1].map(u64::from);
        // Compare the aspect ratios by cross-multiplication, with a tolerance of one pixel.
        if (width * of_height).abs_diff(height * of_width) > of_width.max(of_height).max(width).max(height) {
            let fault = GeometryFault::Size { of, pictures: size };
            return Err(RecordingError::Geometry { file: file.to_owned(), line: None, fault });
        }
        let zoom = size.0 as f32 / of.0 as f32;
        self.rig.focal_px *= zoom;
        self.rig.doffs_px *= zoom;
        self.disparity_count =
            self.disparity_count.map(|count| ((count as f32 * zoom).ceil() as u32).next_multiple_of(16));
        self.size = Some(size);
        Ok(self)
    }
}

/// Creates a rectified rig from two focal lengths (left, right), the baseline, and `doffs_px`, the column of the right
/// principal point minus that of the left one. Fails if the focal lengths differ or the baseline is not > 0.
pub(super) fn create_rig(focal_px: [f64; 2], doffs_px: f64, baseline_m: f64) -> Result<StereoRig, GeometryFault> {
    let [left_px, right_px] = focal_px;
    if (left_px - right_px).abs() > FOCAL_TOLERANCE * left_px {
        return Err(GeometryFault::UnequalFocal(left_px, right_px));
    }
    if baseline_m < 0.0 {
        return Err(GeometryFault::Swapped(-baseline_m));
    }
    let rig =
        StereoRig { focal_px: left_px as f32, baseline_m: baseline_m as f32, doffs_px: doffs_px as f32, metric: true };
    // As `f32`, a tiny baseline is 0.
    if rig.baseline_m > 0.0 { Ok(rig) } else { Err(GeometryFault::NoBaseline) }
}

/// Parses `N` numbers separated by white space, brackets, commas and semicolons. Returns `None` if there are more or
/// fewer, or one is not finite.
pub(super) fn parse_numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let is_separator = |c: char| c.is_whitespace() || matches!(c, '[' | ']' | ';' | ',');
    let words = text.split(is_separator).filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> =
        words.map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_is_scaled_with_its_pictures_and_refused_for_others() {
        let rig = StereoRig { focal_px: 1000.0, baseline_m: 0.2, doffs_px: 30.0, metric: true };
        let full = Geometry { rig, size: Some((2000, 1001)), disparity_count: Some(96) };
        let scaled_to = |geometry: Geometry, size| geometry.scaled_to(Path::new("calib.txt"), size);
        let half = scaled_to(full, (1000, 500)).unwrap();
        assert_eq!((half.rig.focal_px, half.rig.doffs_px, half.disparity_count), (500.0, 15.0, Some(48)));
        // The same point: half the disparity, equal distance.
        assert_eq!(half.rig.depth_m(20.0), full.rig.depth_m(40.0));
        assert_eq!(scaled_to(full, (2000, 1001)).unwrap(), full);
        let refused = scaled_to(full, (1000, 700)).unwrap_err().to_string();
        assert!(refused.starts_with("calib.txt: made for pictures of 2000x1001, but these are 1000x700"), "{refused}");
        let for_any = Geometry { size: None, ..full };
        assert_eq!(scaled_to(for_any, (7, 9)).unwrap(), for_any);
    }
}
