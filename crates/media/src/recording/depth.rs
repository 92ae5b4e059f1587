//! The depth of a recording, in the view of its colour camera.

use std::mem;
use std::path::Path;

use image::metadata::Orientation;

use super::contents::DepthFormat;
use super::decode::{self, Scratch};
use super::depth_file::{Fit, has_same_view};
use super::error::{RecordingError, Result};
use super::fault::{PictureFault, ReadResult};
use super::upright::upright;
use super::{Recording, coded, depth_covers, depth_file, luma};
use bokehcam::calibration::registration::{Registration, RgbdCalibration};
use bokehcam::frame::DepthMap;
use bokehcam::optics::StereoRig;

impl Recording {
    /// Returns whether the frames have depth.
    pub fn has_depth(&self) -> bool {
        self.contents.depth.is_some()
    }

    /// Returns whether its depth is only relative.
    pub fn has_relative_depth(&self) -> bool {
        matches!(self.contents.depth, Some(DepthFormat::Inverse { .. }))
    }

    /// Returns whether its depth is in the units of [`Options::depth_scale`](super::Options::depth_scale), and not in
    /// units that it states itself.
    pub fn has_depth_in_units(&self) -> bool {
        matches!(self.contents.depth, Some(DepthFormat::Units(_)))
    }

    /// Returns the recording with its depth registered, if there are distances and a calibration: the depth camera looks
    /// from another place than the colour camera. The recording's own calibration is not used if it does not fit.
    ///
    /// # Errors
    /// A given calibration is invalid, or for pictures of another aspect.
    pub(super) fn register_depth(mut self, calibration: Option<RgbdCalibration>, is_given: bool) -> Result<Self> {
        let Some(calibration) = calibration.filter(|_| self.has_depth() && !self.has_relative_depth()) else {
            return Ok(self);
        };
        match self.create_registration(calibration) {
            Ok(registration) => self.depth_registration = Some(registration),
            Err(what) if is_given => {
                return Err(RecordingError::DepthCalibration { dir: self.folder.dir.clone(), what });
            }
            Err(what) => tracing::warn!(
                "{}: depth is taken as if it had the view of the colour camera, because its calibration does not fit: \
                 {what}; --depth-calibration replaces it",
                self.folder.dir.display()
            ),
        }
        Ok(self)
    }

    fn create_registration(&self, calibration: RgbdCalibration) -> Result<Registration, String> {
        let color = calibration.color.scaled_to(self.size).map_err(|error| error.to_string())?;
        let size = calibration.depth.size.unwrap_or_default();
        // Maps may have been scaled down since.
        let (mut scratch, mut first) = (Scratch::default(), DepthMap::default());
        let size = match self.decode_depth(0, size, &mut scratch, &mut first) {
            Ok(()) if depth_covers(first.size(), size) => first.size(),
            Ok(()) => {
                return Err(PictureFault::CalibratedSize { found: first.size(), calibrated: size }.to_string());
            }
            // Told when it is read.
            Err(_) => size,
        };
        Registration::new(RgbdCalibration { color, ..calibration }, size).map_err(|error| error.to_string())
    }

    /// Reads the depth of frame `index` in metres, 0 = unknown, into `into`. It covers the view of the colour picture
    /// with at most as many pixels.
    ///
    /// # Errors
    /// Same as for [`Recording::read_color`]; or the recording has no depth.
    pub fn read_depth(&self, index: usize, scratch: &mut Scratch, into: &mut DepthMap) -> Result<()> {
        let Some(registration) = &self.depth_registration else {
            self.decode_depth(index, self.size, scratch, into)?;
            return self.fit_depth(into).map_err(|fault| self.depth_fault(index, fault));
        };
        let mut measured = mem::take(&mut scratch.measured);
        let read = self.decode_depth(index, registration.size(), scratch, &mut measured);
        let (found, calibrated) = (measured.size(), registration.size());
        let read = match read {
            Ok(()) if found != calibrated => {
                Err(self.depth_fault(index, PictureFault::CalibratedSize { found, calibrated }))
            }
            read => read,
        };
        if read.is_ok() {
            registration.register(&measured, &mut scratch.drawn, into);
        }
        scratch.measured = measured;
        read
    }

    /// Fits depth to the size of the colour pictures. Other aspect ratios are not fitted without being asked, not even
    /// squares: a note of each frame would be needed.
    fn fit_depth(&self, map: &mut DepthMap) -> ReadResult {
        let (found, color) = (map.size(), self.size);
        if self.depth_fit.is_none() && !has_same_view(found, color) {
            return Err(PictureFault::DepthSize { found, color });
        }
        depth_file::fit_map(map, self.depth_fit, color).map(drop)
    }

    /// Returns the error of a fault in the depth of frame `index`. Without a depth map, the line of the colour picture is at
    /// fault.
    fn depth_fault(&self, index: usize, fault: PictureFault) -> RecordingError {
        let frame = &self.contents.frames[index];
        frame.depth.as_ref().unwrap_or(&frame.color).error(&self.folder.dir, fault)
    }

    /// Reads the depth of frame `index` as it was recorded, of the view of pictures of `size`.
    fn decode_depth(&self, index: usize, size: (u32, u32), scratch: &mut Scratch, into: &mut DepthMap) -> Result<()> {
        let no_depth = || RecordingError::NoDepth { dir: self.folder.dir.clone() };
        let form = self.contents.depth.as_ref().ok_or_else(no_depth)?;
        let frame = self.frame(index)?;
        let source = frame.depth.as_ref().unwrap_or(&frame.color);
        let read = match &self.contents.container {
            Some(container) => container.read_depth(index, size, scratch, into),
            None => {
                let path = self.folder.locate(source)?;
                // Maps of photos are turned as photos are.
                let tag = self.contents.are_photos.then(|| coded::read_orientation(&path).ok()).flatten();
                let turn = upright(tag.unwrap_or(Orientation::NoTransforms));
                let stored_size = turn.rotated_size(size);
                let read = match form {
                    DepthFormat::Units(units) | DepthFormat::StatedUnits(units) => {
                        decode::read_depth(&path, *units, scratch, into)
                    }
                    DepthFormat::Inverse { white_is_far, invalid } => {
                        luma::read_inverse_depth(&path, (*white_is_far, *invalid), scratch, into)
                    }
                    DepthFormat::Disparity(rig) => read_disparity(&path, rig, self.depth_fit, stored_size, into),
                };
                if !turn.is_identity() {
                    *into = turn.transform_map(mem::take(into), stored_size);
                }
                read
            }
        };
        read.map_err(|fault| self.depth_fault(index, fault))
    }
}

/// Reads disparities, in pixels of the map, as depth, which is fitted afterwards. The rig is for the colour picture of `color`
/// pixels.
fn read_disparity(
    path: &Path,
    rig: &StereoRig,
    fit: Option<Fit>,
    color: (u32, u32),
    into: &mut DepthMap,
) -> ReadResult {
    let map = depth_file::read_disparity(path)?;
    let [across, down] = [color.0 as f32 / map.width as f32, color.1 as f32 / map.height as f32];
    // What is cropped leaves the side that is not.
    let zoom = if fit == Some(Fit::Crop) { across.max(down) } else { across };
    *into = map.to_depth_map(|px| rig.depth_m(px * zoom));
    Ok(())
}
