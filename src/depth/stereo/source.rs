//! Stereo as a source of depth: pairs are rectified if necessary, matched, and converted to metres.
//!
//! The blur needs only the disparity: with `z = f B / (d + doffs)`, the thin lens `c = c_inf (1 - z_f / z)` is `c =
//! (c_inf / d_f) (d_f - d)`, counted from the disparity of infinity, which is `(A / 2B) (d_f - d)` for an aperture of
//! diameter `A`. Focal length and baseline cancel out, so that an uncalibrated rig ([`StereoRig::default_for_width`])
//! blurs as well as a measured one; only its distances in metres are meaningless.

use super::check::{Verdict, check_pair};
use super::rectify::PairRectifier;
use super::{Effort, Matcher, Pair, Settings};
use crate::calibration::rectifier::Rectifier;
use crate::depth::{DepthError, DepthSource, FrameInput};
use crate::frame::{ColorImage, DepthMap, DisparityMap, GrayImage};
use crate::optics::StereoRig;

/// Disparities are clamped to at least this far above that of infinity: finer ones cannot be measured, and depth stays
/// finite.
const MIN_DISPARITY_PX: f32 = 1.0 / 16.0;

/// Maximum number of pairs checked until one is conclusive; each check takes the time of a few frames.
const MAX_CHECKS: u32 = 5;

/// Measured time per map by effort, relative to the full one: half the resolution has an eighth of the candidates, and
/// some costs are fixed.
const EFFORTS: [f64; 2] = [0.33, 1.0];

/// Margin in pixels above the largest disparity found, for objects that come nearer later.
const MARGIN_PX: u32 = 8;

type CreateMatcher = Box<dyn Fn(u32) -> Result<Box<dyn Matcher>, DepthError> + Send>;

/// Computes depth from the frames of a camera that delivers a right picture.
pub struct StereoDepth {
    source_name: String,
    rig: StereoRig,
    rectifier: Option<PairRectifier>,
    matcher: Box<dyn Matcher>,
    left: GrayImage,
    /// Destination of the rectified left picture, which is then swapped with the raw one.
    color: ColorImage,
    right: GrayImage,
    disparity: DisparityMap,
    disparities: u32,
    /// Makes a matcher with more candidate disparities.
    create_wider: Option<CreateMatcher>,
    /// Number of pairs that may still be checked for rectification.
    checks_left: u32,
}

impl StereoDepth {
    /// Creates a source that matches rectified pairs of `rig` with `matcher`, which has `disparities` candidates.
    /// `source_name` names the camera in messages.
    pub fn from_rectified(source_name: &str, rig: StereoRig, matcher: Box<dyn Matcher>, disparities: u32) -> Self {
        Self {
            source_name: source_name.to_owned(),
            rig,
            rectifier: None,
            matcher,
            left: GrayImage::default(),
            color: ColorImage::default(),
            right: GrayImage::default(),
            disparity: DisparityMap::default(),
            disparities,
            create_wider: None,
            checks_left: MAX_CHECKS,
        }
    }

    /// Creates a source that rectifies pairs with `rectifier`, left pictures included, on the GPU of the matcher if it
    /// has one.
    pub fn from_raw(source_name: &str, rectifier: Rectifier, matcher: Box<dyn Matcher>, disparities: u32) -> Self {
        let rig = rectifier.rig();
        let rectifier = PairRectifier::new(rectifier).with_device(matcher.device());
        Self { rectifier: Some(rectifier), ..Self::from_rectified(source_name, rig, matcher, disparities) }
    }

    /// Lets `create_wider` replace the matcher if the first pairs have larger disparities than it tries; without it,
    /// that is only logged.
    pub fn with_wider_matcher(
        self,
        create_wider: impl Fn(u32) -> Result<Box<dyn Matcher>, DepthError> + Send + 'static,
    ) -> Self {
        Self { create_wider: Some(Box::new(create_wider)), ..self }
    }

    /// Checks a pair and its range of disparities, unless an earlier check was conclusive.
    fn check_rectification_and_range(&mut self, right: Option<&GrayImage>) -> Result<(), DepthError> {
        if self.checks_left == 0 {
            return Ok(());
        }
        let right = right.unwrap_or(&self.right);
        let (source_name, calibrated) = (&self.source_name, self.rectifier.is_some());
        // Twice the range, so that objects nearer than expected are found, too.
        let found = check_pair(&self.left, right, (2 * self.disparities).min(Settings::MAX_DISPARITIES))?;
        let clear = log_verdict(source_name, calibrated, found.verdict());
        self.checks_left = if clear { 0 } else { self.checks_left - 1 };
        let needed = (found.largest_px.ceil() as u32 + MARGIN_PX).next_multiple_of(16).min(Settings::MAX_DISPARITIES);
        if found.verdict() != Verdict::Rectified || found.largest_px < self.disparities as f32 {
            return Ok(());
        }
        let largest_px = found.largest_px;
        match &self.create_wider {
            Some(create_wider) => {
                (self.matcher, self.disparities) = (create_wider(needed)?, needed);
                tracing::info!(
                    "{source_name}: near objects have disparities of {largest_px:.0} px: {needed} are searched"
                );
            }
            None => tracing::warn!(
                "{source_name}: near objects have disparities of {largest_px:.0} px, more than the {} that are \
                 searched, and appear far away; use --max-disparity {needed}",
                self.disparities
            ),
        }
        Ok(())
    }

    /// Returns the cameras of the rectified pictures.
    pub fn rig(&self) -> &StereoRig {
        &self.rig
    }

    /// Describes the device or the CPU that matches.
    pub fn describe(&self) -> String {
        self.matcher.describe()
    }
}

/// Logs the verdict on a pair that is supposed to be rectified; `calibrated` says whether it was rectified here.
/// Returns false if the verdict is unclear.
fn log_verdict(source_name: &str, calibrated: bool, verdict: Verdict) -> bool {
    match verdict {
        Verdict::Rectified => tracing::info!("{source_name}: {verdict}"),
        Verdict::Misaligned { .. } if calibrated => tracing::warn!(
            "{source_name}: {verdict}, although it was rectified: the calibration does not match the present position \
             of the cameras; calibrate them again"
        ),
        Verdict::Misaligned { .. } => {
            tracing::warn!("{source_name}: {verdict}; rectify it with --calib FILE, and without --rectified");
        }
        Verdict::Swapped | Verdict::Identical => tracing::warn!("{source_name}: {verdict}"),
        Verdict::Unclear { .. } => {
            tracing::debug!("{source_name}: {verdict}");
            return false;
        }
    }
    true
}

impl DepthSource for StereoDepth {
    fn rectify(&mut self, color: &mut ColorImage) {
        if let Some(rectifier) = &mut self.rectifier {
            rectifier.rectify_left(color, &mut self.color);
            std::mem::swap(color, &mut self.color);
        }
    }

    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let Some(right) = seen.right else {
            return Err(DepthError::MissingRight { source_name: self.source_name.clone() });
        };
        self.left.set_luma_from(seen.color);
        let rectified = match &mut self.rectifier {
            Some(rectifier) => {
                rectifier.rectify_right(right, &mut self.right);
                None
            }
            None => Some(right),
        };
        self.check_rectification_and_range(rectified)?;
        let pair = Pair { left: &self.left, color: Some(seen.color), right: rectified.unwrap_or(&self.right) };
        self.matcher.compute_disparity(pair, &mut self.disparity)?;
        disparity_to_depth(&self.disparity, &self.rig, map);
        Ok(())
    }

    fn efforts(&self) -> &'static [f64] {
        &EFFORTS
    }

    fn set_effort(&mut self, effort: usize) {
        self.matcher.set_effort(if effort == 0 { Effort::Fast } else { Effort::Full });
    }
}

/// Converts disparity to depth. Unknown pixels stay 0; those at infinity, or beyond it by measurement error, get the
/// largest depth that can be measured.
pub fn disparity_to_depth(disparity: &DisparityMap, rig: &StereoRig, map: &mut DepthMap) {
    map.resize(disparity.width, disparity.height);
    let (focal_baseline, doffs_px) = (rig.focal_px * rig.baseline_m, rig.doffs_px);
    for (z_m, &d_px) in map.metres.iter_mut().zip(&disparity.px) {
        let known = (d_px > 0.0) & (d_px < f32::INFINITY);
        let known_m = focal_baseline / (d_px + doffs_px).max(MIN_DISPARITY_PX);
        *z_m = if known { known_m } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2, DVec3};

    use super::*;
    use crate::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};
    use crate::depth::stereo::MatchError;
    use crate::frame::Stamp;
    use crate::optics::DepthCoc;

    const STAMP: Stamp = Stamp { index: 0, time_ns: 0, captured_ns: None };

    /// Returns the difference of the two pictures as their disparity.
    struct Difference(Effort);

    impl Matcher for Difference {
        fn describe(&self) -> String {
            "difference".to_owned()
        }
        fn set_effort(&mut self, effort: Effort) {
            self.0 = effort;
        }
        fn compute_disparity(&mut self, pair: Pair, into: &mut DisparityMap) -> Result<(), MatchError> {
            let Pair { left, right, .. } = pair;
            if left.size() != right.size() {
                return Err(MatchError::Sizes { left: left.size(), right: right.size() });
            }
            into.resize(left.width, left.height);
            let factor = if self.0 == Effort::Full { 1.0 } else { 0.5 };
            for (px, (&left, &right)) in into.px.iter_mut().zip(left.luma.iter().zip(&right.luma)) {
                *px = (f32::from(left) - f32::from(right)) * factor;
            }
            Ok(())
        }
    }

    const RIG: StereoRig = StereoRig { focal_px: 100.0, baseline_m: 0.1, doffs_px: 5.0, metric: true };

    fn gray(luma: &[u8]) -> GrayImage {
        GrayImage { width: luma.len() as u32, height: 1, luma: luma.to_vec() }
    }

    fn color(luma: &[u8]) -> ColorImage {
        ColorImage { width: luma.len() as u32, height: 1, rgb: luma.iter().flat_map(|&y| [y; 3]).collect() }
    }

    #[test]
    fn disparity_becomes_metres_and_what_is_unknown_stays_so() {
        let disparity = DisparityMap { width: 6, height: 1, px: vec![5.0, 15.0, 0.0, f32::NAN, f32::INFINITY, 0.01] };
        let mut map = DepthMap::default();
        disparity_to_depth(&disparity, &RIG, &mut map);
        assert_eq!(map.metres[..5], [1.0, 0.5, 0.0, 0.0, 0.0]);
        assert!((map.metres[5] - 10.0 / 5.01).abs() < 1e-5);
        // Infinity lies at 5 px: disparities up to there are known, and clamped to the largest depth.
        disparity_to_depth(&disparity, &StereoRig { doffs_px: -5.0, ..RIG }, &mut map);
        assert_eq!(map.metres, [160.0, 1.0, 0.0, 0.0, 0.0, 160.0]);
    }

    #[test]
    fn the_blur_is_affine_in_the_disparity_whatever_the_rig() {
        let disparity = DisparityMap { width: 5, height: 1, px: vec![4.0, 8.0, 16.0, 24.0, 32.0] };
        for rig in [RIG, StereoRig::default_for_width(640), StereoRig { focal_px: 721.5, baseline_m: 0.54, ..RIG }] {
            let mut map = DepthMap::default();
            disparity_to_depth(&disparity, &rig, &mut map);
            let coc = DepthCoc { coc_at_infinity_px: 12.0, focus_m: map.metres[2], range_m: 0.0, max_coc_px: 100.0 };
            let in_focus_px = 16.0 + rig.doffs_px;
            for (&d_px, &z_m) in disparity.px.iter().zip(&map.metres) {
                let expected_px = 12.0 / in_focus_px * (16.0 - d_px);
                assert!((coc.coc_px(z_m) - expected_px).abs() < 1e-4, "{rig:?} {d_px}");
            }
        }
    }

    #[test]
    fn a_rectified_pair_is_matched_as_it_is() {
        let mut source = StereoDepth::from_rectified("two eyes", RIG, Box::new(Difference(Effort::Full)), 16);
        let (mut picture, mut map) = (color(&[25, 55, 10]), DepthMap::default());
        source.rectify(&mut picture);
        assert_eq!(picture, color(&[25, 55, 10]));
        let right = gray(&[20, 40, 10]);
        source.read(FrameInput { stamp: STAMP, color: &picture, right: Some(&right) }, &mut map).unwrap();
        assert_eq!(map.metres, [1.0, 0.5, 0.0]);
        let efforts = source.efforts();
        assert!(efforts.is_sorted() && efforts.last() == Some(&1.0));
        source.set_effort(0);
        source.read(FrameInput { stamp: STAMP, color: &picture, right: Some(&right) }, &mut map).unwrap();
        assert_eq!(map.metres[1], 10.0 / 12.5);
    }

    #[test]
    fn a_raw_pair_is_rectified_and_so_is_its_picture() {
        let size = (64, 48);
        let camera = |center_y_px| CameraIntrinsics {
            size: Some(size),
            focal_px: DVec2::splat(60.0),
            center_px: DVec2::new(32.0, center_y_px),
            distortion: Distortion::RadialTangential([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        };
        // The right camera sees everything some rows further up.
        let calibration = StereoCalibration {
            cameras: [camera(24.0), camera(20.0)],
            rotation: DMat3::IDENTITY,
            translation_m: DVec3::new(-0.1, 0.0, 0.0),
            stored_rectification: None,
            unit: LengthUnit::Stated,
        };
        let rectifier = Rectifier::new(&calibration, size).unwrap();
        let ramp: Vec<u8> = (0..64 * 48).map(|at| 40 + 3 * (at / 64) as u8).collect();
        let raw = ColorImage { width: 64, height: 48, rgb: ramp.iter().flat_map(|&y| [y; 3]).collect() };
        let raw_right = GrayImage { width: 64, height: 48, luma: ramp };
        let (mut left, mut right) = (ColorImage::default(), GrayImage::default());
        rectifier.rectify_left(&raw, &mut left);
        rectifier.rectify_right(&raw_right, &mut right);
        assert_ne!(left, raw);

        let mut source = StereoDepth::from_raw("two eyes", rectifier, Box::new(Difference(Effort::Full)), 16);
        let (mut picture, mut map) = (raw.clone(), DepthMap::default());
        source.rectify(&mut picture);
        assert_eq!(picture, left);
        source.read(FrameInput { stamp: STAMP, color: &picture, right: Some(&raw_right) }, &mut map).unwrap();
        let middle = 24 * 64 + 32;
        let difference_px = f32::from(left.rgb[3 * middle]) - f32::from(right.luma[middle]);
        assert_eq!(map.metres[middle], if difference_px > 0.0 { source.rig().depth_m(difference_px) } else { 0.0 });
        assert!(source.rig().metric && (source.rig().baseline_m - 0.1).abs() < 1e-6);
    }

    #[test]
    fn one_eye_and_unequal_eyes_are_named() {
        let mut source = StereoDepth::from_rectified("two eyes", RIG, Box::new(Difference(Effort::Full)), 16);
        let (picture, mut map) = (color(&[25, 55]), DepthMap::default());
        let error = source.read(FrameInput { stamp: STAMP, color: &picture, right: None }, &mut map).unwrap_err();
        assert!(matches!(&error, DepthError::MissingRight { .. }) && error.to_string().contains("two eyes"), "{error}");
        let right = gray(&[1, 2, 3]);
        let error =
            source.read(FrameInput { stamp: STAMP, color: &picture, right: Some(&right) }, &mut map).unwrap_err();
        assert!(error.to_string().contains("2x1") && error.to_string().contains("3x1"), "{error}");
    }
}
