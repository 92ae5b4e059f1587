//! Where the lens is focused: at a distance, at the nearest large subject, or at a point of the picture.
//!
//! The focus moves like a lens, in dioptres (1/m): it eases towards its target and does not follow small changes.

use std::fmt;
use std::str::FromStr;

use crate::frame::DepthMap;

/// What the lens focuses on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FocusRule {
    /// A distance in metres, > 0.
    Metres(f32),
    /// The nearest subject that is large enough to be meant.
    Auto,
    /// A point, as fractions of width and height (0 to 1).
    Point {
        /// Fraction of the width, from the left.
        x: f32,
        /// Fraction of the height, from the top.
        y: f32,
    },
}

impl FromStr for FocusRule {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let within = |text: &str, most: f32| text.trim().parse().ok().filter(|number| (0.0..=most).contains(number));
        let rule = match text.split_once(',') {
            None if text == "auto" => Some(Self::Auto),
            None => within(text, f32::MAX).filter(|&metres| DepthMap::is_known(metres)).map(Self::Metres),
            Some((x, y)) => within(x, 1.0).zip(within(y, 1.0)).map(|(x, y)| Self::Point { x, y }),
        };
        rule.ok_or_else(|| "use METRES above 0, auto, or X,Y as fractions of width and height (0 to 1)".to_string())
    }
}

impl fmt::Display for FocusRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Metres(metres) => write!(f, "{metres}"),
            Self::Point { x, y } => write!(f, "{x},{y}"),
        }
    }
}

/// Used when nothing was ever known to focus on: the distance of somebody at a desk.
const FALLBACK_M: f32 = 1.0;
/// Time in which the focus covers 63 % of its way.
const TIME_CONSTANT_S: f64 = 0.25;
/// Relative change of the target that sets a resting focus moving, and the distance at which it rests again.
const START: f32 = 0.03;
const STOP: f32 = 0.005;

/// The focus from frame to frame: a function of the depth maps and their media times alone.
#[derive(Debug)]
pub struct Focus {
    rule: FocusRule,
    subject: Subject,
    loyalty: Loyalty,
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
    /// A lens that was not focused yet: the first frame sets it at once.
    pub fn new(rule: FocusRule) -> Self {
        Self { rule, subject: Subject::default(), loyalty: Loyalty::default(), window_m: Vec::new(), lens: None }
    }

    /// Focuses on something else: the lens moves there from where it is.
    pub fn follow(&mut self, rule: FocusRule) {
        if self.rule != rule {
            self.rule = rule;
            self.loyalty = Loyalty::default();
            self.lens.iter_mut().for_each(|lens| lens.moving = true);
        }
    }

    /// The focus distance in metres for a frame at `time_ns` of media time, from its depth as measured (not filled).
    /// Where the map knows nothing of the subject, the lens stays where it is.
    pub fn focus_m(&mut self, map: &DepthMap, time_ns: u64) -> f32 {
        let target_m = match self.rule {
            FocusRule::Metres(focus_m) => Some(focus_m),
            FocusRule::Auto if map.subject_m.is_some() => map.subject_m,
            FocusRule::Auto => {
                let Self { subject, loyalty, .. } = self;
                let found_m = subject.distance_m(map);
                found_m.map(|found_m| loyalty.choose_m(found_m, |dioptres| subject.is_there(dioptres), time_ns))
            }
            FocusRule::Point { x, y } => point_m(map, x, y, &mut self.window_m),
        };
        let Some(target_m) = target_m else {
            return self.lens.map_or(FALLBACK_M, |lens| 1.0 / lens.dioptres);
        };
        let target = 1.0 / target_m;
        let lens = self.lens.get_or_insert(EasedLens { dioptres: target, time_ns, moving: false });
        lens.ease(target, time_ns);
        // A distance that was asked for is kept to the last bit.
        if lens.dioptres == target { target_m } else { 1.0 / lens.dioptres }
    }
}

impl EasedLens {
    fn ease(&mut self, target: f32, time_ns: u64) {
        let elapsed_s = time_ns.saturating_sub(self.time_ns) as f64 / 1e9;
        self.time_ns = time_ns;
        let off = (target - self.dioptres).abs() / target;
        self.moving = off > if self.moving { STOP } else { START };
        if self.moving {
            let share = 1.0 - (-elapsed_s / TIME_CONSTANT_S).exp();
            self.dioptres += (target - self.dioptres) * share as f32;
        }
    }
}

/// Two distances this close together, in dioptres, are of one subject; and how fast it may move, in dioptres a second.
const SAME: f32 = 0.12;
const SPEED: f32 = 2.0;
/// While a subject is there, another one is turned to once it was there for so long: whoever passes by is not meant.
const PATIENCE_NS: u64 = 400_000_000;

/// Stays with a subject while others come and go, so that the lens does not hunt between two of them.
#[derive(Debug, Default)]
struct Loyalty {
    subject: Option<Seen>,
    /// Another one, and since when it is there.
    rival: Option<(Seen, u64)>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    dioptres: f32,
    time_ns: u64,
}

impl Seen {
    fn is_same(self, found: Seen) -> bool {
        let elapsed_s = found.time_ns.saturating_sub(self.time_ns) as f32 / 1e9;
        (found.dioptres - self.dioptres).abs() <= SAME + SPEED * elapsed_s
    }
}

impl Loyalty {
    /// The distance to focus on where the nearest large subject is found at `found_m`.
    fn choose_m(&mut self, found_m: f32, is_there: impl Fn(f32) -> bool, time_ns: u64) -> f32 {
        let found = Seen { dioptres: 1.0 / found_m, time_ns };
        // One that is not where it was has moved, if by a leap.
        let stays = |subject: &Seen| !subject.is_same(found) && is_there(subject.dioptres);
        let Some(subject) = self.subject.filter(stays) else {
            (self.subject, self.rival) = (Some(found), None);
            return found_m;
        };
        // Time in which it was not seen is none in which it could move unseen.
        self.subject = Some(Seen { time_ns, ..subject });
        let since_ns = self.rival.filter(|(rival, _)| rival.is_same(found)).map_or(time_ns, |(_, since_ns)| since_ns);
        if time_ns.saturating_sub(since_ns) >= PATIENCE_NS {
            (self.subject, self.rival) = (Some(found), None);
            return found_m;
        }
        self.rival = Some((found, since_ns));
        1.0 / subject.dioptres
    }
}

/// Median of the known depths in a small window around a point; the window grows until it holds some.
fn point_m(map: &DepthMap, x: f32, y: f32, window_m: &mut Vec<f32>) -> Option<f32> {
    let (width, height) = (map.width as usize, map.height as usize);
    if width == 0 || height == 0 {
        return None;
    }
    let at = |fraction: f32, size: usize| ((fraction * size as f32) as usize).min(size - 1);
    let (x_px, y_px) = (at(x, width), at(y, height));
    let mut reach_px = (width.min(height) / 50).max(2);
    loop {
        window_m.clear();
        let columns = x_px.saturating_sub(reach_px)..(x_px + reach_px + 1).min(width);
        for row in y_px.saturating_sub(reach_px)..(y_px + reach_px + 1).min(height) {
            let row = &map.metres[row * width..][columns.clone()];
            window_m.extend(row.iter().copied().filter(|&z_m| DepthMap::is_known(z_m)));
        }
        if !window_m.is_empty() {
            let middle = window_m.len() / 2;
            return Some(*window_m.select_nth_unstable_by(middle, f32::total_cmp).1);
        }
        if reach_px >= width.max(height) {
            return None;
        }
        reach_px *= 2;
    }
}

/// Cells of the histogram over disparity (dioptres), and the disparity that its last cell ends at: 0.2 m.
const CELLS: usize = 256;
const NEAREST: f32 = 5.0;
/// A subject spans this many cells to either side of its peak: a head is some 0.25 m deep at 1 m.
const REACH: usize = 6;
/// Share of the weight of all known pixels that makes a subject large enough.
const LARGE: f32 = 0.10;
/// Rows and columns looked at, at most; more would only cost time.
const LOOKS: usize = 160;

/// Finds the nearest large subject in a histogram over disparity, in which the middle of the picture weighs most.
#[derive(Debug)]
struct Subject {
    weight: [f32; CELLS],
    /// Sum of weight x disparity, so that the distance is finer than the cells.
    moment: [f32; CELLS],
    total: f32,
}

impl Default for Subject {
    fn default() -> Self {
        Self { weight: [0.0; CELLS], moment: [0.0; CELLS], total: 0.0 }
    }
}

impl Subject {
    /// Distance of the subject; the largest one's when none is large; `None` without any known depth.
    fn distance_m(&mut self, map: &DepthMap) -> Option<f32> {
        let total = self.weigh(map);
        if total == 0.0 {
            return None;
        }
        let mass = |cell: usize| -> f32 { Self::window(cell).map(|c| self.weight[c]).sum() };
        let masses: [f32; CELLS] = std::array::from_fn(mass);
        let is_peak = |&cell: &usize| Self::window(cell).all(|c| masses[c] <= masses[cell]);
        let nearest = (0..CELLS).rev().filter(is_peak).find(|&cell| masses[cell] >= LARGE * total);
        let peak = nearest.or_else(|| (0..CELLS).max_by(|&a, &b| masses[a].total_cmp(&masses[b])))?;
        let moment: f32 = Self::window(peak).map(|c| self.moment[c]).sum();
        Some(masses[peak] / moment)
    }

    /// Whether something is left at this distance of a subject that was large enough, in the map that was looked at last.
    fn is_there(&self, dioptres: f32) -> bool {
        let mass: f32 = Self::window(Self::cell(dioptres)).map(|cell| self.weight[cell]).sum();
        mass >= 0.5 * LARGE * self.total
    }

    fn cell(dioptres: f32) -> usize {
        ((dioptres * (CELLS as f32 / NEAREST)) as usize).min(CELLS - 1)
    }

    fn window(cell: usize) -> std::ops::Range<usize> {
        cell.saturating_sub(REACH)..(cell + REACH + 1).min(CELLS)
    }

    /// Fills the histogram; returns its sum.
    fn weigh(&mut self, map: &DepthMap) -> f32 {
        self.weight.fill(0.0);
        self.moment.fill(0.0);
        let (width, height) = (map.width as usize, map.height as usize);
        let mut total = 0.0;
        for y in (0..height).step_by(height.div_ceil(LOOKS).max(1)) {
            let row = &map.metres[y * width..][..width];
            for x in (0..width).step_by(width.div_ceil(LOOKS).max(1)) {
                if DepthMap::is_known(row[x]) {
                    let disparity = 1.0 / row[x];
                    let cell = Self::cell(disparity);
                    let weight = centre_weight(x, width) * centre_weight(y, height);
                    self.weight[cell] += weight;
                    self.moment[cell] += weight * disparity;
                    total += weight;
                }
            }
        }
        self.total = total;
        total
    }
}

/// A parabola: 1 in the middle, 0.1 at the border.
fn centre_weight(at_px: usize, size_px: usize) -> f32 {
    let off = (at_px as f32 + 0.5) / size_px as f32 * 2.0 - 1.0;
    1.0 - 0.9 * off * off
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_NS: u64 = 33_000_000;

    fn flat(metres: f32) -> DepthMap {
        DepthMap { width: 8, height: 8, metres: vec![metres; 64], ..DepthMap::default() }
    }

    /// Somebody at 1 m over so many of 64 columns, and the room at 3 m.
    fn beside(columns: usize) -> DepthMap {
        let metres = (0..64 * 64).map(|k| if k % 64 < columns { 1.0 } else { 3.0 });
        DepthMap { width: 64, height: 64, metres: metres.collect(), ..DepthMap::default() }
    }

    #[test]
    fn the_lens_does_not_hunt_between_two_subjects() {
        let mut focus = Focus::new(FocusRule::Auto);
        let found = |columns| Subject::default().distance_m(&beside(columns)).unwrap();
        assert!(found(16) < 1.1 && found(9) > 2.9, "large enough, and not");
        for frame in 0..300u64 {
            // Now large enough, now not, for a few frames each.
            let columns = if frame % 7 < 3 { 16 } else { 9 };
            let focus_m = focus.focus_m(&beside(columns), frame * FRAME_NS);
            assert!((focus_m - 1.0).abs() < 0.02, "{frame}: {focus_m}");
        }
    }

    #[test]
    fn it_turns_to_a_subject_that_stays_and_follows_one_that_moves() {
        let mut focus = Focus::new(FocusRule::Auto);
        focus.focus_m(&beside(16), 0);
        let turned = (1..200u64).find(|&k| focus.focus_m(&beside(9), k * FRAME_NS) > 1.05).unwrap() * FRAME_NS;
        assert!((PATIENCE_NS..PATIENCE_NS + 200_000_000).contains(&turned), "{turned}");
        let settled_m = (200..300u64).map(|k| focus.focus_m(&flat(3.0), k * FRAME_NS)).last().unwrap();
        assert!((settled_m - 3.0).abs() < 0.03, "{settled_m}");
        // From 3 m to 1 m in a second: never more than what the lens' own inertia makes of it.
        for k in 0..30u64 {
            let at_m = 3.0 / (1.0 + 2.0 * k as f32 / 30.0);
            let focus_m = focus.focus_m(&flat(at_m), (300 + k) * FRAME_NS);
            assert!((1.0 / focus_m - 1.0 / at_m).abs() < 0.25, "{k}: {focus_m} for {at_m}");
        }
    }

    #[test]
    fn another_rule_moves_the_lens_from_where_it_is() {
        let mut focus = Focus::new(FocusRule::Metres(1.5));
        assert_eq!(focus.focus_m(&flat(4.0), 0), 1.5);
        focus.follow(FocusRule::Metres(3.0));
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
