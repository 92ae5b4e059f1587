//! Measured depth in which a person is the subject, whatever else is near: a network says where persons are.

use crate::depth::dilation::dilate;
use crate::depth::plate::Companion;
use crate::depth::{DepthError, DepthSource, Seen};
use crate::frame::{ColorImage, DepthMap, Mask};

/// A person is looked for so often, in nanoseconds of media time: the depth between is that of whoever is there by then.
const EVERY_NS: u64 = 200_000_000;
/// Share of the picture that is somebody's, at least: less is a face on a poster, or a mistake.
const LEAST_SHARE: f32 = 0.01;
/// Where a mask is this sure, no room is seen beside a person.
const SURE: f32 = 0.9;
/// So much of the height, from the top of each column of a mask, is head and shoulders: below, masks of persons have what they hold,
/// and what stands before them.
const HEAD: f32 = 1.0 / 6.0;
/// A head and shoulders are within so many dioptres: a quarter of a metre at one.
const BODY: f32 = 0.25;
/// What is so much farther than who it is part of was matched wrongly, as a knitted pullover is with itself.
const TOO_FAR: f32 = 1.25;
/// Share of a row within an outline that has their distance, at least: masks of persons have other things as well.
const THEIRS: f32 = 0.4;
/// Outlines of masks are this uncertain, in pixels of theirs.
const OUTLINE_PX: usize = 2;

/// Finds how far persons are in maps.
pub struct Persons {
    finder: Box<dyn Companion>,
    last_ns: Option<u64>,
    /// Columns and rows of the mask.
    size: (usize, usize),
    /// The pixels of the mask that are their heads and shoulders; none while there is nobody.
    places: Vec<u32>,
    /// Where the mask is not sure; for mending, with the outlines.
    outside: Vec<bool>,
    line: Vec<bool>,
    dioptres: Vec<f32>,
}

impl Persons {
    /// Those whom `finder` finds in the pictures.
    pub fn new(finder: Box<dyn Companion>) -> Self {
        let (places, outside, line) = (Vec::new(), Vec::new(), Vec::new());
        Self { finder, last_ns: None, size: (0, 0), places, outside, line, dioptres: Vec::new() }
    }

    /// Gives the map of the frame `seen` the distance of the person in it ([`DepthMap::person_m`]).
    pub fn mark(&mut self, seen: Seen, map: &mut DepthMap) {
        let time_ns = seen.stamp.time_ns;
        if self.last_ns.is_none_or(|last_ns| time_ns.abs_diff(last_ns) >= EVERY_NS) {
            self.last_ns = Some(time_ns);
            self.look(seen);
        }
        map.person_m = self.distance_m(map);
    }

    /// The same for a map that was matched, which has holes in persons: what is far behind a person, or not known, within their outlines
    /// in this very frame, gets their distance where enough beside it has.
    pub fn mend(&mut self, seen: Seen, map: &mut DepthMap) {
        self.look(seen);
        map.person_m = self.distance_m(map);
        let Some(person_m) = map.person_m else { return };
        let (columns, rows) = self.size;
        dilate(&mut self.outside, &mut self.line, columns, OUTLINE_PX);
        let (width, height) = (map.width as usize, map.height as usize);
        for (y, row) in map.metres.chunks_exact_mut(width.max(1)).enumerate() {
            let outside = &self.outside[y * rows / height * columns..][..columns];
            let is_theirs = |metres: f32| metres >= person_m / TOO_FAR && metres <= person_m * TOO_FAR;
            let mut from = 0;
            while from < width {
                let is_inside = |x: usize| !outside[x * columns / width];
                let run = (from..width).take_while(|&x| is_inside(x) == is_inside(from)).count();
                let pixels = &mut row[from..from + run];
                let theirs = pixels.iter().filter(|&&metres| is_theirs(metres)).count();
                if is_inside(from) && theirs as f32 >= THEIRS * run as f32 {
                    let wrong = pixels
                        .iter_mut()
                        .filter(|metres| !DepthMap::is_known(**metres) || **metres > TOO_FAR * person_m);
                    wrong.for_each(|metres| *metres = person_m);
                }
                from += run;
            }
        }
    }

    fn look(&mut self, seen: Seen) {
        self.places.clear();
        let Some(Mask { width, height, share }) = self.finder.persons(seen) else { return };
        let (columns, rows) = (*width as usize, *height as usize);
        self.size = (columns, rows);
        let head = (HEAD * rows as f32).ceil() as usize;
        for x in 0..columns {
            let theirs = (0..rows).map(|y| y * columns + x).skip_while(|&at| share[at] < SURE);
            let theirs = theirs.take(head).filter(|&at| share[at] >= SURE);
            self.places.extend(theirs.map(|at| at as u32));
        }
        self.outside.clear();
        self.outside.extend(share.iter().map(|&share| share < SURE));
        if (self.places.len() as f32) < LEAST_SHARE * share.len() as f32 {
            self.places.clear();
        }
    }

    /// How far most of their heads and shoulders are in a map, in metres; who is nearest has most.
    fn distance_m(&mut self, map: &DepthMap) -> Option<f32> {
        let Self { size: (columns, rows), places, dioptres, .. } = self;
        let within = |at: usize, of: usize, size: u32| (2 * at + 1) * size as usize / (2 * of);
        let metres = places.iter().map(|&at| {
            let (x, y) = (at as usize % *columns, at as usize / *columns);
            map.metres[within(y, *rows, map.height) * map.width as usize + within(x, *columns, map.width)]
        });
        dioptres.clear();
        dioptres.extend(metres.filter(|&metres| DepthMap::is_known(metres)).map(f32::recip));
        dioptres.sort_unstable_by(f32::total_cmp);
        let (mut from, mut most) = (0, 0..0);
        for to in 1..=dioptres.len() {
            while dioptres[to - 1] - dioptres[from] > BODY {
                from += 1;
            }
            if to - from > most.len() {
                most = from..to;
            }
        }
        (!most.is_empty()).then(|| 1.0 / dioptres[most.start + most.len() / 2])
    }
}

/// A source of depth whose maps have the distance of the person.
pub struct OnPersons {
    depth: Box<dyn DepthSource>,
    persons: Persons,
    is_wanted: bool,
    is_matched: bool,
}

impl OnPersons {
    /// The maps of `depth`, and in them the `persons`; of maps that were matched, their holes are mended ([`Persons::mend`]).
    pub fn new(depth: Box<dyn DepthSource>, persons: Persons, is_matched: bool) -> Self {
        Self { depth, persons, is_wanted: true, is_matched }
    }
}

impl DepthSource for OnPersons {
    fn rectify(&mut self, color: &mut ColorImage) {
        self.depth.rectify(color);
    }

    fn read(&mut self, seen: Seen, map: &mut DepthMap) -> Result<(), DepthError> {
        self.depth.read(seen, map)?;
        map.person_m = None;
        if self.is_matched {
            self.persons.mend(seen, map);
        } else if self.is_wanted {
            self.persons.mark(seen, map);
        }
        Ok(())
    }

    fn efforts(&self) -> &'static [f64] {
        self.depth.efforts()
    }

    fn set_effort(&mut self, effort: usize) {
        self.depth.set_effort(effort);
    }

    fn may_be_shared(&self) -> bool {
        self.depth.may_be_shared()
    }

    fn knows_background(&self) -> bool {
        self.depth.knows_background()
    }

    fn look_for_persons(&mut self, on: bool) {
        self.is_wanted = on;
    }

    fn jump(&mut self, ahead_ns: i64) {
        self.persons.last_ns = None;
        self.persons.finder.jump(ahead_ns);
        self.depth.jump(ahead_ns);
    }

    fn rest(&mut self) {
        self.depth.rest();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::focus::{Focus, FocusRule};
    use crate::frame::Stamp;

    /// A room at 4 m, a shelf of a third of the picture in its middle at 0.8 m, and somebody at its left at 1.6 m, behind a table
    /// that masks take for theirs.
    struct Room {
        looks: u32,
        mask: Mask,
    }

    const SIZE: (u32, u32) = (96, 60);

    impl Room {
        fn new(person: bool) -> Self {
            let mut mask = Mask::default();
            mask.resize(24, 12);
            for (at, share) in mask.share.iter_mut().enumerate() {
                let (x, y) = (at % 24, at / 24);
                *share = if person && (x < 8 && y > 1 || x < 9 && y > 7) { 1.0 } else { 0.3 };
            }
            Self { looks: 0, mask }
        }
    }

    impl DepthSource for Room {
        fn read(&mut self, seen: Seen, map: &mut DepthMap) -> Result<(), DepthError> {
            map.resize(SIZE.0, SIZE.1);
            for (at, metres) in map.metres.iter_mut().enumerate() {
                *metres = match at as u32 % SIZE.0 {
                    0..36 if at as u32 / SIZE.0 >= 40 => 0.8,
                    // Who comes nearer, by 1 mm a frame.
                    0..32 => 1.6 - 0.001 * seen.stamp.index as f32,
                    36..68 => 0.8,
                    _ => 4.0,
                };
            }
            Ok(())
        }
    }

    impl Companion for Room {
        fn persons(&mut self, _: Seen) -> Option<&Mask> {
            self.looks += 1;
            assert!(self.looks < 20, "not with every frame");
            Some(&self.mask)
        }

        fn measure_behind(&mut self, _: &ColorImage, _: &Mask, _: &mut DepthMap) {
            unreachable!("depth is measured")
        }
    }

    /// Where the lens is after two seconds, with somebody there or not.
    fn focus_m(person: bool, is_wanted: bool) -> f32 {
        let mut source = OnPersons::new(Box::new(Room::new(person)), Persons::new(Box::new(Room::new(person))), false);
        source.look_for_persons(is_wanted);
        let (mut map, mut focus, color) =
            (DepthMap::default(), Focus::new(FocusRule::Auto), ColorImage::new(SIZE.0, SIZE.1));
        let focused = (0..60).map(|index| {
            let time_ns = index as u64 * 33_000_000;
            let seen = Seen { stamp: Stamp { index, time_ns, captured_ns: None }, color: &color, right: None };
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
            fn read(&mut self, seen: Seen, map: &mut DepthMap) -> Result<(), DepthError> {
                self.0.read(seen, map)?;
                for (at, metres) in map.metres.iter_mut().enumerate() {
                    let (x, y) = (at as u32 % SIZE.0, at as u32 / SIZE.0);
                    match (x, y) {
                        (8..14, 20..30) => *metres = 3.5,
                        (14..16, 20..30) => *metres = 0.0,
                        // Nearer, and without.
                        (2..6, 30..36) => *metres = 0.4,
                        (70..80, 20..30) => *metres = 0.0,
                        _ => {}
                    }
                }
                Ok(())
            }
        }
        let (color, mut map) = (ColorImage::new(SIZE.0, SIZE.1), DepthMap::default());
        let seen = Seen { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color: &color, right: None };
        let mut source =
            OnPersons::new(Box::new(Holes(Room::new(true))), Persons::new(Box::new(Room::new(true))), true);
        source.read(seen, &mut map).unwrap();
        let at = |x: u32, y: u32| map.metres[(y * SIZE.0 + x) as usize];
        assert!((at(10, 25) - 1.6).abs() < 0.05 && (at(15, 25) - 1.6).abs() < 0.05, "{} {}", at(10, 25), at(15, 25));
        assert_eq!([at(4, 33), at(75, 25), at(90, 5), at(34, 5)], [0.4, 0.0, 4.0, 4.0]);
        source.persons = Persons::new(Box::new(Room::new(false)));
        source.read(seen, &mut map).unwrap();
        assert_eq!(
            [map.metres[(25 * SIZE.0 + 10) as usize], map.metres[(25 * SIZE.0 + 15) as usize]],
            [3.5, 0.0],
            "nobody"
        );
    }
}
