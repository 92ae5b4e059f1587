//! Focus on persons in measured depth: a network finds them, whatever else is nearer.

use crate::depth::dilation::dilate;
use crate::depth::plate::Companion;
use crate::depth::{DepthError, DepthSource, FrameInput};
use crate::frame::{DepthMap, Mask};

/// Interval of the person detection in media time; in between, the last mask is used on the new maps.
const DETECTION_INTERVAL_NS: u64 = 200_000_000;
/// Minimum fraction of the mask that makes a person: less is a face on a poster, or an error.
const MIN_FRACTION: f32 = 0.01;
/// Minimum mask value of pixels that surely show the person and not the room.
const MIN_SURE_ALPHA: f32 = 0.9;
/// Height of head and shoulders, from the top of each column of the mask, as a fraction of its height: further below,
/// masks include held objects, and objects in front of the person.
const HEAD_FRACTION: f32 = 1.0 / 6.0;
/// Depth range of head and shoulders, in dioptres: 25 cm at 1 m.
const BODY_DIOPTRES: f32 = 0.25;
/// Depth beyond the person's by this factor is a mismatch, as on the repetitive texture of a knitted pullover.
const MISMATCH_RATIO: f32 = 1.25;
/// Minimum fraction of a row within the outline at the person's distance: masks include other objects as well.
const MIN_PERSON_FRACTION: f32 = 0.4;
/// Uncertainty of mask outlines, in mask pixels.
const OUTLINE_PX: usize = 2;

/// Measures the distance of persons in depth maps.
pub struct PersonDistance {
    detector: Box<dyn Companion>,
    last_ns: Option<u64>,
    /// Columns and rows of the mask.
    size: (usize, usize),
    /// Mask pixels of heads and shoulders; empty if there is no person.
    head_pixels: Vec<u32>,
    /// Whether a mask pixel is not sure; dilated by [`Self::fill_holes`].
    outside: Vec<bool>,
    line: Vec<bool>,
    dioptres: Vec<f32>,
}

impl PersonDistance {
    /// Creates it for the persons that `detector` detects.
    pub fn new(detector: Box<dyn Companion>) -> Self {
        let (head_pixels, outside, line) = (Vec::new(), Vec::new(), Vec::new());
        Self { detector, last_ns: None, size: (0, 0), head_pixels, outside, line, dioptres: Vec::new() }
    }

    /// Sets [`DepthMap::person_m`], the person's distance in the frame `seen`.
    pub fn set_person_distance(&mut self, seen: FrameInput, map: &mut DepthMap) {
        let time_ns = seen.stamp.time_ns;
        if self.last_ns.is_none_or(|last_ns| time_ns.abs_diff(last_ns) >= DETECTION_INTERVAL_NS) {
            self.last_ns = Some(time_ns);
            self.detect_persons(seen);
        }
        map.person_m = self.measure_distance_m(map);
    }

    /// Sets [`DepthMap::person_m`] like [`Self::set_person_distance`], and repairs stereo mismatches: within the
    /// outline in this frame, depth that is unknown or far behind the person is set to the person's distance, in rows
    /// where enough has it.
    pub fn fill_holes(&mut self, seen: FrameInput, map: &mut DepthMap) {
        self.detect_persons(seen);
        map.person_m = self.measure_distance_m(map);
        let Some(person_m) = map.person_m else { return };
        let (columns, rows) = self.size;
        dilate(&mut self.outside, &mut self.line, columns, OUTLINE_PX);
        let (width, height) = (map.width as usize, map.height as usize);
        for (y, row) in map.metres.chunks_exact_mut(width.max(1)).enumerate() {
            let outside = &self.outside[y * rows / height * columns..][..columns];
            let is_person = |metres: f32| metres >= person_m / MISMATCH_RATIO && metres <= person_m * MISMATCH_RATIO;
            let mut from = 0;
            while from < width {
                let is_inside = |x: usize| !outside[x * columns / width];
                // The next run of pixels inside the outline, or outside of it.
                let run = (from..width).take_while(|&x| is_inside(x) == is_inside(from)).count();
                let pixels = &mut row[from..from + run];
                let person_pixels = pixels.iter().filter(|&&metres| is_person(metres)).count();
                if is_inside(from) && person_pixels as f32 >= MIN_PERSON_FRACTION * run as f32 {
                    let wrong = pixels
                        .iter_mut()
                        .filter(|metres| !DepthMap::is_known(**metres) || **metres > MISMATCH_RATIO * person_m);
                    wrong.for_each(|metres| *metres = person_m);
                }
                from += run;
            }
        }
    }

    fn detect_persons(&mut self, seen: FrameInput) {
        self.head_pixels.clear();
        let Some(Mask { width, height, alpha: alphas }) = self.detector.segment_persons(seen) else { return };
        let (columns, rows) = (*width as usize, *height as usize);
        self.size = (columns, rows);
        let head = (HEAD_FRACTION * rows as f32).ceil() as usize;
        for x in 0..columns {
            let person_pixels = (0..rows).map(|y| y * columns + x).skip_while(|&at| alphas[at] < MIN_SURE_ALPHA);
            let person_pixels = person_pixels.take(head).filter(|&at| alphas[at] >= MIN_SURE_ALPHA);
            self.head_pixels.extend(person_pixels.map(|at| at as u32));
        }
        self.outside.clear();
        self.outside.extend(alphas.iter().map(|&alpha| alpha < MIN_SURE_ALPHA));
        if (self.head_pixels.len() as f32) < MIN_FRACTION * alphas.len() as f32 {
            self.head_pixels.clear();
        }
    }

    /// Returns the distance of most head and shoulder pixels, in metres: the densest range of [`BODY_DIOPTRES`]
    /// dioptres. The nearest person has the most pixels.
    fn measure_distance_m(&mut self, map: &DepthMap) -> Option<f32> {
        let Self { size: (columns, rows), head_pixels, dioptres, .. } = self;
        let within = |at: usize, of: usize, size: u32| (2 * at + 1) * size as usize / (2 * of);
        let metres = head_pixels.iter().map(|&at| {
            let (x, y) = (at as usize % *columns, at as usize / *columns);
            map.metres[within(y, *rows, map.height) * map.width as usize + within(x, *columns, map.width)]
        });
        dioptres.clear();
        dioptres.extend(metres.filter(|&metres| DepthMap::is_known(metres)).map(f32::recip));
        dioptres.sort_unstable_by(f32::total_cmp);
        // A sliding window over the sorted values.
        let (mut from, mut most) = (0, 0..0);
        for to in 1..=dioptres.len() {
            while dioptres[to - 1] - dioptres[from] > BODY_DIOPTRES {
                from += 1;
            }
            if to - from > most.len() {
                most = from..to;
            }
        }
        (!most.is_empty()).then(|| 1.0 / dioptres[most.start + most.len() / 2])
    }
}

/// A depth source that adds the person's distance to the maps of another one.
pub struct PersonFocus {
    depth: Box<dyn DepthSource>,
    persons: PersonDistance,
    is_enabled: bool,
    is_stereo: bool,
}

impl PersonFocus {
    /// Creates it from the maps of `depth`; if they are from stereo matching (`is_stereo`), they are repaired
    /// ([`PersonDistance::fill_holes`]).
    pub fn new(depth: Box<dyn DepthSource>, persons: PersonDistance, is_stereo: bool) -> Self {
        Self { depth, persons, is_enabled: true, is_stereo }
    }
}

impl DepthSource for PersonFocus {
    fn inner(&self) -> Option<&dyn DepthSource> {
        Some(&*self.depth)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn DepthSource> {
        Some(&mut *self.depth)
    }

    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.depth.read(seen, map)?;
        map.person_m = None;
        if self.is_stereo {
            self.persons.fill_holes(seen, map);
        } else if self.is_enabled {
            self.persons.set_person_distance(seen, map);
        }
        Ok(())
    }

    fn set_focus_on_persons(&mut self, on: bool) {
        self.is_enabled = on;
    }

    fn seek(&mut self, ahead_ns: i64) {
        self.persons.last_ns = None;
        self.persons.detector.seek(ahead_ns);
        self.depth.seek(ahead_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::focus::{Focus, FocusRule};
    use crate::frame::{ColorImage, Stamp};

    /// A room at 4 m, a shelf at 0.8 m in the middle third of the picture, and a person at 1.6 m on the left, behind a
    /// table that masks include.
    struct Room {
        looks: u32,
        mask: Mask,
    }

    const SIZE: (u32, u32) = (96, 60);

    impl Room {
        fn new(person: bool) -> Self {
            let mut mask = Mask::default();
            mask.resize(24, 12);
            for (at, alphas) in mask.alpha.iter_mut().enumerate() {
                let (x, y) = (at % 24, at / 24);
                *alphas = if person && (x < 8 && y > 1 || x < 9 && y > 7) { 1.0 } else { 0.3 };
            }
            Self { looks: 0, mask }
        }
    }

    impl DepthSource for Room {
        fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
            map.resize(SIZE.0, SIZE.1);
            for (at, metres) in map.metres.iter_mut().enumerate() {
                *metres = match at as u32 % SIZE.0 {
                    0..36 if at as u32 / SIZE.0 >= 40 => 0.8,
                    // The person approaches by 1 mm a frame.
                    0..32 => 1.6 - 0.001 * seen.stamp.index as f32,
                    36..68 => 0.8,
                    _ => 4.0,
                };
            }
            Ok(())
        }
    }

    impl Companion for Room {
        fn segment_persons(&mut self, _: FrameInput) -> Option<&Mask> {
            self.looks += 1;
            assert!(self.looks < 20, "not with every frame");
            Some(&self.mask)
        }

        fn measure_background(&mut self, _: &ColorImage, _: &Mask, _: &mut DepthMap) {
            unreachable!("depth is measured")
        }
    }

    /// Returns the focus distance after two seconds, with or without a person.
    fn focus_m(person: bool, is_enabled: bool) -> f32 {
        let mut source =
            PersonFocus::new(Box::new(Room::new(person)), PersonDistance::new(Box::new(Room::new(person))), false);
        source.set_focus_on_persons(is_enabled);
        let (mut map, mut focus, color) =
            (DepthMap::default(), Focus::new(FocusRule::Auto), ColorImage::new(SIZE.0, SIZE.1));
        let focused = (0..60).map(|index| {
            let time_ns = index as u64 * 33_000_000;
            let seen = FrameInput { stamp: Stamp { index, time_ns, captured_ns: None }, color: &color, right: None };
            source.read(seen, &mut map).unwrap();
            focus.focus_m(&map, time_ns)
        });
        focused.last().unwrap()
    }

    #[test]
    fn a_person_is_the_subject_although_something_large_is_nearer_in_the_middle() {
        let (person_m, shelf_m) = (focus_m(true, true), focus_m(false, true));
        assert!((person_m - 1.54).abs() < 0.05, "{person_m}: followed between two looks");
        assert!((shelf_m - 0.8).abs() < 0.02, "{shelf_m}: what is near and large, where nobody is");
        assert_eq!(focus_m(true, false), shelf_m);
    }

    #[test]
    fn what_is_matched_far_behind_a_person_is_theirs_within_their_outlines() {
        struct Holes(Room);
        impl DepthSource for Holes {
            fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
                self.0.read(seen, map)?;
                for (at, metres) in map.metres.iter_mut().enumerate() {
                    let (x, y) = (at as u32 % SIZE.0, at as u32 / SIZE.0);
                    match (x, y) {
                        (8..14, 20..30) => *metres = 3.5,
                        (14..16, 20..30) => *metres = 0.0,
                        // Nearer pixels are kept, and unknown ones outside the person too.
                        (2..6, 30..36) => *metres = 0.4,
                        (70..80, 20..30) => *metres = 0.0,
                        _ => {}
                    }
                }
                Ok(())
            }
        }
        let (color, mut map) = (ColorImage::new(SIZE.0, SIZE.1), DepthMap::default());
        let seen = FrameInput { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color: &color, right: None };
        let mut source =
            PersonFocus::new(Box::new(Holes(Room::new(true))), PersonDistance::new(Box::new(Room::new(true))), true);
        source.read(seen, &mut map).unwrap();
        let at = |x: u32, y: u32| map.metres[(y * SIZE.0 + x) as usize];
        assert!((at(10, 25) - 1.6).abs() < 0.05 && (at(15, 25) - 1.6).abs() < 0.05, "{} {}", at(10, 25), at(15, 25));
        assert_eq!([at(4, 33), at(75, 25), at(90, 5), at(34, 5)], [0.4, 0.0, 4.0, 4.0]);
        source.persons = PersonDistance::new(Box::new(Room::new(false)));
        source.read(seen, &mut map).unwrap();
        assert_eq!(
            [map.metres[(25 * SIZE.0 + 10) as usize], map.metres[(25 * SIZE.0 + 15) as usize]],
            [3.5, 0.0],
            "nobody"
        );
    }
}
