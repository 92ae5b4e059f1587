//! Focus distance: fixed, on the nearest large subject, at a point of the picture, or on an object that is tracked.
//!
//! The focus moves like a lens, in dioptres (1/m): it eases towards its target and ignores small changes.

mod hysteresis;
mod persons;
mod subject;
mod track;

use std::fmt;
use std::str::FromStr;

use hysteresis::Hysteresis;
pub use persons::{PersonDistance, PersonFocus};
use subject::SubjectFinder;
use track::ObjectTrack;

use crate::frame::DepthMap;

/// What the lens focuses on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FocusRule {
    /// A distance in metres, > 0.
    Metres(f32),
    /// A place in relative depth, linear in inverse depth: 0 is the nearest point, 1 the farthest.
    Relative(f32),
    /// The person that a mask shows; without one, the nearest large subject.
    Auto,
    /// A point, as fractions of width and height (0 to 1). In a map around a subject
    /// ([`subject_m`](DepthMap::subject_m)), the object at the point, as for [`FocusRule::Track`].
    Point {
        /// Fraction of the width, from the left.
        x: f32,
        /// Fraction of the height, from the top.
        y: f32,
    },
    /// The object at a point, as fractions of width and height (0 to 1), which is tracked from there.
    Track {
        /// Fraction of the width, from the left.
        x: f32,
        /// Fraction of the height, from the top.
        y: f32,
    },
}

/// Prefix of the point of a tracked object.
const TRACK: &str = "track:";

impl FromStr for FocusRule {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let within = |text: &str, most: f32| text.trim().parse().ok().filter(|number| (0.0..=most).contains(number));
        let point = |text: &str| text.split_once(',').and_then(|(x, y)| within(x, 1.0).zip(within(y, 1.0)));
        let rule = match text.strip_prefix(TRACK) {
            Some(at) => point(at).map(|(x, y)| Self::Track { x, y }),
            None if text == "auto" => Some(Self::Auto),
            None if text.contains(',') => point(text).map(|(x, y)| Self::Point { x, y }),
            None => within(text, f32::MAX).and_then(Self::from_number),
        };
        rule.ok_or_else(|| format!("use {ACCEPTED}"))
    }
}

/// What [`FocusRule`] is parsed from, for messages.
const ACCEPTED: &str = "METRES above 0 (in relative depth a place from 0, the nearest, to 1), auto, X,Y as fractions of \
                        width and height (0 to 1), or track:X,Y";

impl FocusRule {
    /// Returns the focus at a distance of relative depth whose farthest point is at `farthest`; both in units of the
    /// nearest.
    pub fn at_relative(distance: f32, farthest: f32) -> Self {
        let [depth, most] = [distance, farthest].map(|distance| 1.0 - DepthMap::metres_to_relative(distance));
        Self::Relative((depth / most.max(f32::EPSILON)).clamp(0.0, 1.0))
    }

    /// Reads a number, which [`FocusRule::for_depth`] gives its meaning; `None` if it has none.
    fn from_number(number: f32) -> Option<Self> {
        // There are no 0 m.
        let distance = || Some(number).filter(|&metres| DepthMap::is_known(metres)).map(Self::Metres);
        if number == 0.0 { Some(Self::Relative(0.0)) } else { distance() }
    }

    /// Returns the rule for depth in metres, or for relative depth, where a number from 0 to 1 is a place. `None` if the
    /// number has no meaning there.
    pub fn for_depth(self, is_relative: bool) -> Option<Self> {
        match self {
            Self::Metres(place) if is_relative => (place <= 1.0).then_some(Self::Relative(place)),
            Self::Relative(place) if !is_relative => (place > 0.0).then_some(Self::Metres(place)),
            rule => Some(rule),
        }
    }
}

impl fmt::Display for FocusRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Metres(number) | Self::Relative(number) => write!(f, "{number}"),
            Self::Point { x, y } => write!(f, "{x},{y}"),
            Self::Track { x, y } => write!(f, "{TRACK}{x},{y}"),
        }
    }
}

/// Focus distance before any depth is known: a person at a desk.
const FALLBACK_M: f32 = 1.0;
/// Time constant of the exponential easing, which covers 63 % of the way.
const TIME_CONSTANT_S: f64 = 0.25;
/// Hysteresis, as a relative change of the target: a resting focus starts to move above `START`, and rests below
/// `STOP`.
const START: f32 = 0.03;
const STOP: f32 = 0.005;

/// The focus from frame to frame: a function of the depth maps and their media times only.
#[derive(Debug)]
pub struct Focus {
    rule: FocusRule,
    subject: SubjectFinder,
    hysteresis: Hysteresis,
    track: Option<ObjectTrack>,
    window_m: Vec<f32>,
    lens: Option<EasedLens>,
}

#[derive(Clone, Copy, Debug)]
struct EasedLens {
    dioptres: f32,
    time_ns: u64,
    moving: bool,
}

impl Focus {
    /// Creates a focus whose first frame sets the distance at once.
    pub fn new(rule: FocusRule) -> Self {
        let (subject, hysteresis) = (SubjectFinder::default(), Hysteresis::default());
        Self { rule, subject, hysteresis, track: None, window_m: Vec::new(), lens: None }
    }

    /// Changes the rule: the lens moves from where it is.
    pub fn set_rule(&mut self, rule: FocusRule) {
        if self.rule != rule {
            self.rule = rule;
            (self.hysteresis, self.track) = (Hysteresis::default(), None);
            self.lens.iter_mut().for_each(|lens| lens.moving = true);
        }
    }

    /// Returns the focus distance in metres for a frame at media time `time_ns`, from its measured depth (holes not
    /// filled). If the map does not contain the subject, the lens stays where it is.
    pub fn focus_m(&mut self, map: &DepthMap, time_ns: u64) -> f32 {
        let target_m = match self.rule {
            FocusRule::Metres(focus_m) => Some(focus_m),
            FocusRule::Relative(place) => {
                let far = map.farthest_m().map_or(0.0, DepthMap::metres_to_relative);
                Some(DepthMap::relative_to_metres(1.0 - place * (1.0 - far)))
            }
            FocusRule::Auto if map.subject_m.is_some() => map.subject_m,
            FocusRule::Auto => {
                let Self { subject, hysteresis, .. } = self;
                let nearest = subject.find(map);
                let found = map.person_m.map(f32::recip).or(nearest);
                found.map(|found| {
                    1.0 / hysteresis.choose_subject(found, |dioptres| subject.find_near(dioptres), time_ns)
                })
            }
            FocusRule::Point { x, y } if map.subject_m.is_none() => median_depth_at(map, x, y, &mut self.window_m),
            // In a map around a subject the rest has one distance: a subject that leaves the point, or is not there yet,
            // must not make all of it sharp.
            FocusRule::Point { x, y } | FocusRule::Track { x, y } => {
                let track = self.track.get_or_insert_with(|| ObjectTrack::new([x, y]));
                let is_located = map.has_subject() != Some(false);
                is_located.then(|| track.locate(map, time_ns, &mut self.window_m)).flatten().map(f32::recip)
            }
        };
        let Some(target_m) = target_m else {
            return self.lens.map_or(FALLBACK_M, |lens| 1.0 / lens.dioptres);
        };
        let target = 1.0 / target_m;
        let lens = self.lens.get_or_insert(EasedLens { dioptres: target, time_ns, moving: false });
        lens.ease_towards(target, time_ns);
        // A fixed distance is returned exactly.
        if lens.dioptres == target { target_m } else { 1.0 / lens.dioptres }
    }
}

impl EasedLens {
    fn ease_towards(&mut self, target: f32, time_ns: u64) {
        let elapsed_s = time_ns.saturating_sub(self.time_ns) as f64 / 1e9;
        self.time_ns = time_ns;
        let off = (target - self.dioptres).abs() / target;
        self.moving = off > if self.moving { STOP } else { START };
        if self.moving {
            let fraction = 1.0 - (-elapsed_s / TIME_CONSTANT_S).exp();
            self.dioptres += (target - self.dioptres) * fraction as f32;
        }
    }
}

/// Returns the median of the known depths in a small window around a point, which grows until it contains some.
fn median_depth_at(map: &DepthMap, x: f32, y: f32, window_m: &mut Vec<f32>) -> Option<f32> {
    let (width, height) = (map.width as usize, map.height as usize);
    if width == 0 || height == 0 {
        return None;
    }
    let at = |fraction: f32, size: usize| ((fraction * size as f32) as usize).min(size - 1);
    let (x_px, y_px) = (at(x, width), at(y, height));
    let mut radius_px = (width.min(height) / 50).max(2);
    loop {
        window_m.clear();
        let columns = x_px.saturating_sub(radius_px)..(x_px + radius_px + 1).min(width);
        for row in y_px.saturating_sub(radius_px)..(y_px + radius_px + 1).min(height) {
            let row = &map.metres[row * width..][columns.clone()];
            window_m.extend(row.iter().copied().filter(|&z_m| DepthMap::is_known(z_m)));
        }
        if !window_m.is_empty() {
            let middle = window_m.len() / 2;
            return Some(*window_m.select_nth_unstable_by(middle, f32::total_cmp).1);
        }
        if radius_px >= width.max(height) {
            return None;
        }
        radius_px *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_NS: u64 = 33_000_000;

    fn flat(metres: f32) -> DepthMap {
        DepthMap { width: 8, height: 8, metres: vec![metres; 64], ..DepthMap::default() }
    }

    /// A person at 1 m over `columns` of 64 columns, and the room at 3 m.
    fn beside(columns: usize) -> DepthMap {
        let metres = (0..64 * 64).map(|k| if k % 64 < columns { 1.0 } else { 3.0 });
        DepthMap { width: 64, height: 64, metres: metres.collect(), ..DepthMap::default() }
    }

    #[test]
    fn a_place_is_between_the_nearest_and_the_farthest_point() {
        let map = DepthMap { width: 4, height: 1, metres: vec![1.0, 0.0, 2.5, 1.6], ..DepthMap::default() };
        let focus_m = |place| Focus::new(FocusRule::Relative(place)).focus_m(&map, 0);
        assert!(focus_m(0.0) == 1.0 && (focus_m(1.0) - 2.5).abs() < 1e-5, "{}", focus_m(1.0));
        assert!((1.0 / focus_m(0.5) - 0.7).abs() < 1e-6, "halfway in inverse depth: {}", focus_m(0.5));
        for distance in [1.0, 1.6, 2.5] {
            let found_m = Focus::new(FocusRule::at_relative(distance, 2.5)).focus_m(&map, 0);
            assert!((found_m - distance).abs() < 1e-5, "{found_m}");
        }
        let unknown = DepthMap::new(4, 1);
        assert_eq!(Focus::new(FocusRule::Relative(1.0)).focus_m(&unknown, 0), DepthMap::relative_to_metres(0.0));
    }

    #[test]
    fn the_lens_does_not_hunt_between_two_subjects() {
        let mut focus = Focus::new(FocusRule::Auto);
        let found = |columns| 1.0 / SubjectFinder::default().find(&beside(columns)).unwrap();
        assert!(found(16) < 1.1 && found(9) > 2.9, "large enough, and not");
        for frame in 0..300u64 {
            // Alternates between large enough and too small, every few frames.
            let columns = if frame % 7 < 3 { 16 } else { 9 };
            let focus_m = focus.focus_m(&beside(columns), frame * FRAME_NS);
            assert!((focus_m - 1.0).abs() < 0.02, "{frame}: {focus_m}");
        }
    }

    #[test]
    fn it_turns_to_a_subject_that_stays_and_follows_one_that_moves() {
        let mut focus = Focus::new(FocusRule::Auto);
        for frame in 0..4 {
            focus.focus_m(&beside(16), frame * FRAME_NS);
        }
        let turned = (1..200u64).find(|&k| focus.focus_m(&beside(9), (3 + k) * FRAME_NS) > 1.05).unwrap() * FRAME_NS;
        assert!((400_000_000..600_000_000).contains(&turned), "{turned}");
        let settled_m = (200..300u64).map(|k| focus.focus_m(&flat(3.0), k * FRAME_NS)).last().unwrap();
        assert!((settled_m - 3.0).abs() < 0.03, "{settled_m}");
        // From 3 m to 1 m in a second: the error stays within the lens' own lag.
        for k in 0..30u64 {
            let at_m = 3.0 / (1.0 + 2.0 * k as f32 / 30.0);
            let focus_m = focus.focus_m(&flat(at_m), (300 + k) * FRAME_NS);
            assert!((1.0 / focus_m - 1.0 / at_m).abs() < 0.25, "{k}: {focus_m} for {at_m}");
        }
    }

    #[test]
    fn a_point_on_a_subject_stays_with_it_and_never_turns_to_the_room_by_itself() {
        // A subject over some columns of 16, and nothing known of the room.
        let around = |columns: std::ops::Range<usize>| {
            let metres = |k: usize| if columns.contains(&(k % 16)) { DepthMap::SUBJECT_M } else { DepthMap::FAR_M };
            let subject_m = Some(DepthMap::SUBJECT_M);
            DepthMap { subject_m, metres: (0..256).map(metres).collect(), ..DepthMap::new(16, 16) }
        };
        let (nobody, middle, aside) = (around(0..0), around(4..12), around(0..4));
        for rule in [FocusRule::Point { x: 0.5, y: 0.5 }, FocusRule::Track { x: 0.5, y: 0.5 }] {
            let mut focus = Focus::new(rule);
            let maps = [&nobody, &nobody, &middle, &aside, &nobody, &middle, &aside];
            for (frame, map) in maps.into_iter().flat_map(|map| [map; 30]).enumerate() {
                let focus_m = focus.focus_m(map, frame as u64 * FRAME_NS);
                assert!((focus_m - DepthMap::SUBJECT_M).abs() < 1e-3, "{rule:?}, frame {frame}: {focus_m}");
            }
        }
        // The room can be chosen beside a person.
        let focus_m = Focus::new(FocusRule::Point { x: 0.9, y: 0.5 }).focus_m(&middle, 0);
        assert!(focus_m > 100.0, "{focus_m}");
    }

    #[test]
    fn another_rule_moves_the_lens_from_where_it_is() {
        let mut focus = Focus::new(FocusRule::Metres(1.5));
        assert_eq!(focus.focus_m(&flat(4.0), 0), 1.5);
        focus.set_rule(FocusRule::Metres(3.0));
        let mut last_m = 1.5;
        for frame in 1..120u64 {
            let focus_m = focus.focus_m(&flat(4.0), frame * FRAME_NS);
            assert!(focus_m >= last_m && focus_m <= 3.0, "{frame}: {last_m} to {focus_m}");
            assert!(focus_m - last_m < 0.5, "it does not jump");
            last_m = focus_m;
        }
        assert!((last_m - 3.0).abs() < 0.02, "{last_m}");
    }
}
