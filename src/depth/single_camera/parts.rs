//! The connected parts of a mask, of persons and of what is behind them.

use std::ops::Range;

/// Pixels of one kind that are connected by their sides.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The part that this one turned out to be joined to, or itself.
    joined_to: u32,
    pub is_person: bool,
    /// How many pixels it has.
    pub pixels: u32,
    /// In how many of them something is so that was asked for.
    pub found: u32,
    /// Whether it reaches the border of the picture.
    pub is_open: bool,
}

/// Pixels of one kind beside each other in a row.
#[derive(Clone, Debug)]
struct Run {
    pixels: Range<usize>,
    part: u32,
}

/// Finds parts, run by run; owns the memory for it.
#[derive(Debug, Default)]
pub struct Parts {
    runs: Vec<Run>,
    parts: Vec<Part>,
}

impl Parts {
    /// Finds the parts of a mask so wide, and in how many of the pixels of each `is_so`.
    pub fn find(&mut self, persons: &[bool], width: usize, is_so: impl Fn(usize) -> bool) {
        let Self { runs, parts } = self;
        runs.clear();
        parts.clear();
        let mut above = 0..0;
        for (y, row) in persons.chunks_exact(width.max(1)).enumerate() {
            let (began, mut start) = (runs.len(), y * width);
            for same in row.chunk_by(|a, b| a == b) {
                let pixels = start..start + same.len();
                start = pixels.end;
                let at_side = pixels.start.is_multiple_of(width) || pixels.end.is_multiple_of(width);
                let mut part = parts.len() as u32;
                parts.push(Part {
                    joined_to: part,
                    is_person: same[0],
                    pixels: same.len() as u32,
                    found: pixels.clone().map(|at| u32::from(is_so(at))).sum(),
                    is_open: at_side || y == 0 || (y + 1) * width == persons.len(),
                });
                // Those above that end before this one are past for all that follow, too.
                above.start +=
                    runs[above.clone()].iter().take_while(|run| run.pixels.end + width <= pixels.start).count();
                let beside = runs[above.clone()].iter().take_while(|run| run.pixels.start + width < pixels.end);
                for run in beside.filter(|run| persons[run.pixels.start] == same[0]) {
                    part = join(parts, part, run.part);
                }
                runs.push(Run { pixels, part });
            }
            above = began..runs.len();
        }
    }

    /// All parts.
    pub fn all(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().enumerate().filter(|(at, part)| part.joined_to as usize == *at).map(|(_, part)| part)
    }

    /// Pixels beside each other, and the part that they are of.
    pub fn runs(&self) -> impl Iterator<Item = (Range<usize>, &Part)> {
        self.runs.iter().map(|run| (run.pixels.clone(), &self.parts[whole(&self.parts, run.part) as usize]))
    }
}

/// The part that this one is joined to in the end.
fn whole(parts: &[Part], mut part: u32) -> u32 {
    while parts[part as usize].joined_to != part {
        part = parts[part as usize].joined_to;
    }
    part
}

/// Joins two parts, and returns what they are together: the older one, so that chains stay short.
fn join(parts: &mut [Part], a: u32, b: u32) -> u32 {
    let (a, b) = (whole(parts, a), whole(parts, b));
    let (old, young) = (a.min(b), a.max(b));
    if old != young {
        let Part { pixels, found, is_open, .. } = parts[young as usize];
        parts[young as usize].joined_to = old;
        let all = &mut parts[old as usize];
        (all.pixels, all.found, all.is_open) = (all.pixels + pixels, all.found + found, all.is_open || is_open);
    }
    old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_connected_by_sides_and_holes_are_parts_of_their_own() {
        // A ring that is open below, a hole in a block, and a corner that only touches another.
        let picture = [
            "..........", //
            ".###..###.",
            ".#.#..#.#.",
            ".#.#..###.",
            "....##....",
            "....##....",
        ];
        let persons: Vec<bool> = picture.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let mut parts = Parts::default();
        parts.find(&persons, 10, |at| at % 10 < 5);
        let mut found: Vec<_> =
            parts.all().map(|part| (part.is_person, part.pixels, part.found, part.is_open)).collect();
        found.sort_unstable();
        let background = persons.iter().filter(|is| !**is).count() as u32 - 1;
        let left = (0..60).filter(|at| at % 10 < 5 && !persons[*at]).count() as u32;
        assert_eq!(
            found,
            [
                (false, 1, 0, false),
                (false, background, left, true),
                (true, 4, 2, true),
                (true, 7, 7, false),
                (true, 8, 0, false)
            ]
        );
        let covered: usize =
            parts.runs().map(|(pixels, part)| pixels.filter(|&at| persons[at] == part.is_person).count()).sum();
        assert_eq!(covered, persons.len());
    }
}
