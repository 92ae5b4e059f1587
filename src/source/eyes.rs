//! From the options about two eyes to depth from them.

use std::path::Path;

use super::calib::{self, Eyes};
use super::{SourceError, options};
use crate::calibration::rectification::Rectification;
use crate::calibration::rectifier::Rectifier;
use crate::capture::SourceInfo;
use crate::computing::Computing;
use crate::depth::stereo::source::StereoDepth;
use crate::depth::stereo::{Effort, Settings};
use crate::look::Look;
use crate::optics::StereoRig;
use crate::recording::Pair;

/// What two eyes are.
enum Stated {
    /// Their pictures are a rectified pair.
    Rectified(StereoRig),
    /// They are not; this makes them one.
    Raw(Box<Rectifier>),
}

impl options::Stereo {
    /// Refuses what is about two eyes, for a source that has one.
    ///
    /// # Errors
    /// There is such an option.
    pub fn refuse(&self) -> Result<(), SourceError> {
        let given = [
            (self.rectified, "--rectified"),
            (!self.calib.is_empty(), "--calib"),
            (self.focal_px.is_some(), "--focal-px"),
            (self.baseline_m.is_some(), "--baseline-m"),
            (self.doffs_px.is_some(), "--doffs-px"),
        ];
        match given.into_iter().find(|(given, _)| *given) {
            Some((_, name)) => Err(SourceError::Usage(format!(
                "{name} is for depth from two eyes: a source LEFT,RIGHT, a recording with both, or --side-by-side"
            ))),
            None => Ok(()),
        }
    }

    /// The geometry that the options spell out.
    fn rig(&self) -> Result<Option<StereoRig>, SourceError> {
        match (self.focal_px, self.baseline_m) {
            (Some(focal_px), Some(baseline_m)) => {
                Ok(Some(StereoRig { focal_px, baseline_m, doffs_px: self.doffs_px.unwrap_or(0.0), metric: true }))
            }
            (None, None) if self.doffs_px.is_none() => Ok(None),
            _ => Err(SourceError::Usage("the geometry of two eyes needs both --focal-px and --baseline-m".to_string())),
        }
    }

    /// What the two eyes are: what the options state, else what the source says. Nothing is guessed.
    fn state(&self, pair: &Pair, source_name: &str, size: (u32, u32)) -> Result<Stated, SourceError> {
        if let Some(rig) = self.rig()? {
            return match (self.rectified, pair) {
                (true, _) | (false, Pair::Rectified(_)) => Ok(Stated::Rectified(rig)),
                _ => Err(SourceError::Usage(
                    "--focal-px and --baseline-m are those of a rectified pair: add --rectified if this is one, or use \
                     --calib FILE"
                        .to_string(),
                )),
            };
        }
        let read = match self.calib.is_empty() {
            true => None,
            false => Some(match calib::read(&self.calib, Path::new(source_name), size)? {
                Eyes::Rectified { geometry, .. } => Pair::Rectified(geometry.rig),
                Eyes::Raw(calibration) => Pair::Raw(calibration),
            }),
        };
        match read.as_ref().unwrap_or(pair) {
            Pair::Rectified(rig) => Ok(Stated::Rectified(*rig)),
            Pair::Raw(calibration) => {
                let stated = if self.rectified {
                    Stated::Rectified(Rectification::of(calibration, size)?.rig())
                } else {
                    Stated::Raw(Box::new(Rectifier::new(calibration, size)?))
                };
                for note in calibration.notes(size) {
                    tracing::warn!("{note}");
                }
                Ok(stated)
            }
            Pair::Unstated if self.rectified => Ok(Stated::Rectified(StereoRig::assumed(size.0))),
            Pair::Unstated => Err(SourceError::Usage(
                "depth from two eyes needs --calib FILE, or --rectified if their pictures are rectified already"
                    .to_string(),
            )),
        }
    }
}

/// Depth from the two eyes of the source `info`, of which `pair` is known; of `disparities` where that is known, too.
///
/// # Errors
/// It is not stated what they are, a calibration cannot be used, or there is no such GPU.
pub fn open(
    info: &SourceInfo,
    pair: &Pair,
    disparities: Option<u32>,
    options: &options::Stereo,
    computing: &Computing,
) -> Result<StereoDepth, SourceError> {
    let stated = options.state(pair, &info.name, info.size)?;
    let disparities = options.max_disparity.unwrap_or_else(|| settled(disparities, info.size.0));
    let matcher = computing.matcher(disparities, Effort::Full, info.size)?;
    let (depth, how) = match stated {
        Stated::Raw(rectifier) => {
            (StereoDepth::of_raw(&info.name, *rectifier, matcher, disparities), "to be rectified")
        }
        Stated::Rectified(rig) => (StereoDepth::of_rectified(&info.name, rig, matcher, disparities), "rectified"),
    };
    let StereoRig { focal_px, baseline_m, doffs_px, metric } = *depth.rig();
    let known = if metric { "" } else { ", assumed" };
    tracing::info!(
        "{}: a pair, {how}: focal length {focal_px:.1} px, eyes {baseline_m:.4} m apart, doffs {doffs_px:.2} px{known}; \
         {disparities} disparities ({})",
        info.name,
        depth.describe()
    );
    Ok(depth)
}

/// Refuses a focus in metres where the eyes tell no distances.
///
/// # Errors
/// The focus or the lens needs metres, and `rig` has none.
pub fn check_focus(rig: &StereoRig, look: &Look) -> Result<(), SourceError> {
    let Some(needs) = look.needs_metres().filter(|_| !rig.metric) else { return Ok(()) };
    Err(SourceError::Usage(format!(
        "{needs} needs distances, and these two eyes tell none: give --calib FILE, or --focal-px and --baseline-m; \
         --focus auto or X,Y and --coc-at-infinity need none"
    )))
}

/// Disparities to try: as many as are known to occur, else those of a tenth of the picture's width.
fn settled(known: Option<u32>, width_px: u32) -> u32 {
    known.unwrap_or(width_px.div_ceil(10)).next_multiple_of(16).clamp(16, Settings::MOST_DISPARITIES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disparities_are_as_many_as_known_or_a_tenth_of_the_width() {
        let cases = [(Some(60), 640, 64), (Some(64), 640, 64), (Some(290), 640, 256), (Some(3), 640, 16)];
        for (known, width_px, disparities) in cases {
            assert_eq!(settled(known, width_px), disparities);
        }
        for (width_px, disparities) in [(40, 16), (640, 64), (641, 80), (1280, 128), (4000, 256)] {
            assert_eq!(settled(None, width_px), disparities);
        }
    }
}
