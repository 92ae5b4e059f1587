//! Sets up stereo depth: geometry from options, calibration or recording, then rectifier and matcher.

use std::path::Path;

use super::calib::{self, PairCalibration};
use super::{SourceError, options};
use crate::capture::SourceInfo;
use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::stereo::source::StereoDepth;
use bokehcam::depth::stereo::{Effort, Settings};
use bokehcam::optics::StereoRig;
use bokehcam_media::recording::StereoGeometry;

/// The geometry of two cameras, sufficient for stereo matching.
enum Geometry {
    /// The pictures are rectified.
    Rectified(StereoRig),
    /// The pictures must be rectified first.
    Raw(Box<Rectifier>),
}

impl options::Stereo {
    /// Rejects stereo options for a source with one camera.
    ///
    /// # Errors
    /// One of them is given.
    pub fn reject_options(&self) -> Result<(), SourceError> {
        let given = [
            (self.rectified, "--rectified"),
            (!self.calib.is_empty(), "--calib"),
            (self.focal_px.is_some(), "--focal-px"),
            (self.baseline_m.is_some(), "--baseline-m"),
            (self.doffs_px.is_some(), "--doffs-px"),
        ];
        match given.into_iter().find(|(given, _)| *given) {
            Some((_, name)) => Err(SourceError::Usage(format!(
                "{name} is for stereo depth: use two cameras LEFT,RIGHT, a recording of two cameras, or --side-by-side"
            ))),
            None => Ok(()),
        }
    }

    /// Returns the stereo geometry of `--focal-px`, `--baseline-m` and `--doffs-px`, if given.
    fn rig_from_options(&self) -> Result<Option<StereoRig>, SourceError> {
        match (self.focal_px, self.baseline_m) {
            (Some(focal_px), Some(baseline_m)) => {
                Ok(Some(StereoRig { focal_px, baseline_m, doffs_px: self.doffs_px.unwrap_or(0.0), metric: true }))
            }
            (None, None) if self.doffs_px.is_none() => Ok(None),
            // It replaces the calibration's.
            (None, Some(_)) if self.doffs_px.is_none() && !self.calib.is_empty() => Ok(None),
            _ => Err(SourceError::Usage("the stereo geometry needs both --focal-px and --baseline-m".to_string())),
        }
    }

    /// Determines the geometry from the numbers in the options, else from `--calib`, else from the source (`pair`).
    /// Whether pictures are rectified is never guessed: matching raw ones gives plausible but wrong depth.
    fn resolve_geometry(
        &self,
        pair: &StereoGeometry,
        source_name: &str,
        size: (u32, u32),
    ) -> Result<Geometry, SourceError> {
        if let Some(rig) = self.rig_from_options()? {
            return match (self.rectified, pair) {
                (true, _) | (false, StereoGeometry::Rectified(_)) => Ok(Geometry::Rectified(rig)),
                _ => Err(SourceError::Usage(
                    "--focal-px and --baseline-m describe a rectified pair: add --rectified if the pictures are \
                     rectified, or use --calib FILE"
                        .to_string(),
                )),
            };
        }
        let from_file = match self.calib.is_empty() {
            true => None,
            false => {
                Some(match calib::read_pair_calibration(&self.calib, Path::new(source_name), size, self.baseline_m)? {
                    PairCalibration::Rectified { geometry, .. } => StereoGeometry::Rectified(geometry.rig),
                    PairCalibration::Raw(calibration) => StereoGeometry::Raw(calibration),
                })
            }
        };
        match from_file.as_ref().unwrap_or(pair) {
            StereoGeometry::Rectified(rig) => Ok(Geometry::Rectified(*rig)),
            StereoGeometry::Raw(calibration) => {
                // Rectified already with this calibration: only its geometry is needed.
                let stated = if self.rectified {
                    Geometry::Rectified(Rectification::from_calibration(calibration, size)?.rig())
                } else {
                    Geometry::Raw(Box::new(Rectifier::new(calibration, size)?))
                };
                for note in calibration.describe_doubt().into_iter().chain(calibration.describe_assumptions(size)) {
                    tracing::warn!("{note}");
                }
                Ok(stated)
            }
            StereoGeometry::Uncalibrated if self.rectified => {
                Ok(Geometry::Rectified(StereoRig::default_for_width(size.0)))
            }
            StereoGeometry::Uncalibrated => Err(SourceError::Usage(
                "stereo depth needs --calib FILE, or --rectified if the pictures are rectified already".to_string(),
            )),
        }
    }
}

/// Sets up stereo matching for the source `info`. `pair` is the geometry that the source states, and `disparities` the
/// number of disparities, if known.
///
/// # Errors
/// The geometry is not stated, a calibration is invalid, or the requested GPU does not exist.
pub fn open_stereo(
    info: &SourceInfo,
    pair: &StereoGeometry,
    disparities: Option<u32>,
    options: &options::Stereo,
    computing: &ComputeOptions,
) -> Result<StereoDepth, SourceError> {
    let stated = options.resolve_geometry(pair, &info.name, info.size)?;
    // An unknown number of disparities is found out during the run.
    let is_known = options.max_disparity.is_some() || disparities.is_some();
    let disparities = options.max_disparity.unwrap_or_else(|| default_disparities(disparities, info.size.0));
    let matcher = computing.create_matcher(disparities, Effort::Full, info.size)?;
    let (depth, how) = match stated {
        Geometry::Raw(rectifier) => {
            (StereoDepth::from_raw(&info.name, *rectifier, matcher, disparities), "to be rectified")
        }
        Geometry::Rectified(rig) => (StereoDepth::from_rectified(&info.name, rig, matcher, disparities), "rectified"),
    };
    let StereoRig { focal_px, baseline_m, doffs_px, metric } = *depth.rig();
    let note = if metric { "" } else { ", assumed" };
    tracing::info!(
        "{}: a stereo pair, {how}: focal length {focal_px:.1} px, cameras {:.1} mm apart, doffs {doffs_px:.2} \
         px{note}; {disparities} disparities ({})",
        info.name,
        baseline_m * 1e3,
        depth.describe()
    );
    let (computing, size) = (computing.clone(), info.size);
    Ok(match is_known {
        true => depth,
        false => depth.with_wider_matcher(move |disparities| computing.create_matcher(disparities, Effort::Full, size)),
    })
}

/// Returns the number of disparities to search: the known number, or else a tenth of the picture's width.
fn default_disparities(known: Option<u32>, width_px: u32) -> u32 {
    known.unwrap_or(width_px.div_ceil(10)).next_multiple_of(16).clamp(16, Settings::MAX_DISPARITIES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disparities_are_as_many_as_known_or_a_tenth_of_the_width() {
        let cases = [(Some(60), 640, 64), (Some(64), 640, 64), (Some(290), 640, 256), (Some(3), 640, 16)];
        for (known, width_px, disparities) in cases {
            assert_eq!(default_disparities(known, width_px), disparities);
        }
        for (width_px, disparities) in [(40, 16), (640, 64), (641, 80), (1280, 128), (4000, 256)] {
            assert_eq!(default_disparities(None, width_px), disparities);
        }
    }
}
