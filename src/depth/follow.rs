//! Auto-framing: chooses the part of the picture to show, so that the subject stays in the middle.
//!
//! The position and the size of the subject are measured in the depth map. The crop follows them like a camera on a
//! fluid head: a critically damped spring that starts only once the subject has moved clearly, and comes to rest.

use crate::frame::DepthMap;
use crate::frame::crop::Crop;
use crate::optics::DepthCoc;

/// Range of inverse depth that counts as in focus, relative to the focal plane's.
const IN_FOCUS: std::ops::RangeInclusive<f32> = 0.8..=1.25;
/// Number of columns that are sampled.
const MAX_COLUMNS: usize = 160;
/// Minimum fraction of the sampled pixels that makes a subject.
const MIN_FRACTION: f32 = 0.005;
/// Quantiles of the in-focus pixels that bound the subject, across and down: outside are hands, chairs and noise. The
/// upper bound is lower, to keep the hair.
const BOUND_QUANTILES: [[f32; 2]; 2] = [[0.04, 0.96], [0.01, 0.96]];
/// Maximum width and height of the subject, and the headroom above it, as fractions of the crop.
const MAX_SUBJECT_SIDES: [f32; 2] = [0.75, 0.8];
const HEADROOM: f32 = 0.09;
/// Hysteresis: a resting crop starts to move when the error exceeds `START`, and rests again below `STOP`. Both are in
/// sides of the crop, or in the logarithm of the zoom.
const START: f32 = 0.07;
const STOP: f32 = 0.004;
/// Time constant of the spring; it settles within about five of them.
const TIME_CONSTANT_S: f32 = 0.2;
/// Frames further apart in media time are not consecutive: the crop is reset.
const MAX_GAP_NS: u64 = 2_000_000_000;

/// Computes the crop that follows the subject, frame after frame.
#[derive(Debug)]
pub struct AutoFraming {
    max_zoom: f32,
    columns: Vec<u32>,
    rows: Vec<u32>,
    target: [f32; 3],
    /// Current state and its derivative in 1/s: centre across and down (fractions), and logarithm of the zoom.
    place: [f32; 3],
    speed: [f32; 3],
    is_moving: bool,
    time_ns: Option<u64>,
}

impl AutoFraming {
    /// Creates a follower that zooms by at most `max_zoom`.
    pub fn new(max_zoom: f32) -> Self {
        Self {
            max_zoom,
            columns: Vec::new(),
            rows: Vec::new(),
            target: [0.0; 3],
            place: [0.0; 3],
            speed: [0.0; 3],
            is_moving: false,
            time_ns: None,
        }
    }

    /// Sets the maximum zoom from now on; the crop moves there from its current place.
    pub fn set_max_zoom(&mut self, max_zoom: f32) {
        self.max_zoom = max_zoom;
    }

    /// Returns the crop for the frame at `time_ns` of media time, whose depth map has no holes. The first frame sets it
    /// at once.
    pub fn update_crop(&mut self, map: &DepthMap, lens: &DepthCoc, time_ns: u64) -> Crop {
        let seen = self.find_target(map, lens);
        let follows = self.time_ns.filter(|&last_ns| (last_ns..=last_ns + MAX_GAP_NS).contains(&time_ns));
        let wanted = seen.unwrap_or(if follows.is_some() { self.target } else { crop_state(Crop::WHOLE) });
        match follows {
            None => (self.place, self.target, self.speed, self.is_moving) = (wanted, wanted, [0.0; 3], false),
            Some(last_ns) => {
                let distance = crop_distance(self.place, wanted);
                self.is_moving = distance > if self.is_moving { STOP } else { START };
                if self.is_moving {
                    self.target = wanted;
                    self.advance_spring((time_ns - last_ns) as f32 * 1e-9);
                } else {
                    self.speed = [0.0; 3];
                }
            }
        }
        self.time_ns = Some(time_ns);
        let [x, y, zoom] = self.place;
        Crop { center: [x, y], zoom: zoom.exp() }.clamp_inside()
    }

    /// Advances the spring by `passed_s` seconds.
    fn advance_spring(&mut self, passed_s: f32) {
        let rate = TIME_CONSTANT_S.recip();
        let decay = (-rate * passed_s).exp();
        for ((place, speed), target) in self.place.iter_mut().zip(&mut self.speed).zip(self.target) {
            // The exact solution of the critically damped spring: independent of the frame rate.
            let offset = *place - target;
            let pull = *speed + rate * offset;
            *place = target + (offset + pull * passed_s) * decay;
            *speed = (*speed - rate * pull * passed_s) * decay;
        }
    }

    /// Returns the ideal crop around the subject; `None` if nothing is in focus.
    fn find_target(&mut self, map: &DepthMap, lens: &DepthCoc) -> Option<[f32; 3]> {
        let (width, height) = (map.width as usize, map.height as usize);
        let step = (width / MAX_COLUMNS).max(1);
        for (counts, side) in [(&mut self.columns, width), (&mut self.rows, height)] {
            counts.clear();
            counts.resize(side.div_ceil(step), 0);
        }
        let mut count = 0;
        for (row, y) in self.rows.iter_mut().zip((0..height).step_by(step)) {
            let metres = map.metres[y * width..][..width].iter().step_by(step);
            for (column, &metres) in self.columns.iter_mut().zip(metres) {
                let inverse = DepthMap::inverse_depth(metres);
                let is_in_focus =
                    lens.far_m() * inverse >= *IN_FOCUS.start() && lens.near_m() * inverse <= *IN_FOCUS.end();
                *column += u32::from(is_in_focus);
                *row += u32::from(is_in_focus);
            }
            count += *row;
        }
        if (count as f32) < MIN_FRACTION * (self.columns.len() * self.rows.len()) as f32 {
            return None;
        }
        let place = |counts: &[u32], quantile: f32| {
            let due = quantile * count as f32;
            let mut sum = 0.0;
            let at = counts.iter().position(|&count| {
                sum += count as f32;
                sum >= due
            });
            (at.unwrap_or_default() as f32 + 0.5) / counts.len() as f32
        };
        let [left, right] = BOUND_QUANTILES[0].map(|quantile| place(&self.columns, quantile));
        let [top, bottom] = BOUND_QUANTILES[1].map(|quantile| place(&self.rows, quantile));
        let zoom =
            (MAX_SUBJECT_SIDES[0] / (right - left).max(1e-3)).min(MAX_SUBJECT_SIDES[1] / (bottom - top).max(1e-3));
        let zoom = zoom.clamp(1.0, self.max_zoom);
        let middle = 0.5 * (top + bottom);
        // Centred on the subject, but with no more than the headroom above it.
        let below_headroom = top + (0.5 - HEADROOM) / zoom;
        Some(crop_state(Crop { center: [place(&self.columns, 0.5), middle.min(below_headroom)], zoom }.clamp_inside()))
    }
}

fn crop_state(Crop { center: [x, y], zoom }: Crop) -> [f32; 3] {
    [x, y, zoom.ln()]
}

/// Returns the distance between two crops, in sides of the crop.
fn crop_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let zoom = b[2].exp();
    let moved = zoom * (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    moved.max((a[2] - b[2]).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
    const PERIOD_NS: u64 = 33_333_333;

    /// A person whose head is at `x`, as a fraction of the width, before a wall; a lamp in front.
    fn person(x: f32) -> DepthMap {
        let (width, height) = (320, 180);
        let mut map = DepthMap::new(width, height);
        for (at, metres) in (0..).zip(&mut map.metres) {
            let (u, v) = ((at % width) as f32 / width as f32 - x, (at / width) as f32 / height as f32);
            let is_head = u.abs() < 0.06 && (0.3..0.55).contains(&v);
            let is_body = u.abs() < 0.12 && v >= 0.55;
            *metres = if is_head || is_body { 1.05 } else { 4.0 };
            if at % width > width - 20 {
                *metres = 0.4;
            }
        }
        map
    }

    #[test]
    fn the_first_frame_shows_the_subject_at_once_and_no_larger_than_was_said() {
        for most in [1.2, 1.5, 3.0] {
            let part = AutoFraming::new(most).update_crop(&person(0.4), &LENS, 7);
            assert!((part.center[0] - 0.4).abs() < 0.02 || part.zoom < 1.3, "{part:?}");
            assert!(part.zoom <= most + 1e-5 && part.zoom > 1.1);
            let top = part.center[1] - 0.5 / part.zoom;
            assert!((0.0..0.3).contains(&top), "the head is in it: {part:?}");
            assert_eq!(part, part.clamp_inside());
        }
    }

    #[test]
    fn it_glides_to_where_the_subject_went_without_passing_it_and_rests() {
        let mut follower = AutoFraming::new(1.6);
        let (before, after) = (person(0.44), person(0.56));
        let first = follower.update_crop(&before, &LENS, 0);
        let places: Vec<f32> = (1..90).map(|k| follower.update_crop(&after, &LENS, k * PERIOD_NS).center[0]).collect();
        assert!(places.is_sorted(), "{places:?}");
        let last = *places.last().unwrap();
        assert!((last - 0.56).abs() < 0.01 && first.center[0] < 0.45);
        let steps = || places.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(steps().fold(0.0, f32::max) < 0.02, "a small step each time");
        assert!(steps().skip(70).all(|step| step == 0.0), "it rests");
    }

    #[test]
    fn small_movements_and_frames_without_a_subject_leave_it_where_it_is() {
        let mut follower = AutoFraming::new(1.6);
        let first = follower.update_crop(&person(0.5), &LENS, 0);
        let empty = DepthMap { metres: vec![9.0; 320 * 180], ..DepthMap::new(320, 180) };
        for k in 1..60 {
            let map = if k % 7 == 0 { empty.clone() } else { person(0.5 + 0.02 * ((k % 3) as f32 - 1.0)) };
            assert_eq!(follower.update_crop(&map, &LENS, k * PERIOD_NS), first);
        }
        assert_eq!(AutoFraming::new(2.0).update_crop(&empty, &LENS, 0), Crop::WHOLE);
    }

    #[test]
    fn how_many_frames_there_are_makes_no_difference() {
        let places = |every: u64| {
            let mut follower = AutoFraming::new(1.6);
            follower.update_crop(&person(0.4), &LENS, 0);
            (1..=12 / every).map(|k| follower.update_crop(&person(0.6), &LENS, k * every * PERIOD_NS)).last().unwrap()
        };
        let (often, rarely) = (places(1), places(3));
        assert!((often.center[0] - rarely.center[0]).abs() < 1e-3, "{often:?} {rarely:?}");
    }
}
