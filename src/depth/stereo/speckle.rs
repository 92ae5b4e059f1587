//! The speckle filter: small islands whose disparity differs from all around them are mismatches, and become unknown.

use super::fixed::{ONE, UNKNOWN};

/// Neighbours that differ by more are not of one island.
const STEP: u16 = 2 * ONE;

/// Removes islands, found by union-find over runs of rows; owns the memory for it.
#[derive(Debug, Default)]
pub struct Speckles {
    runs: Vec<Run>,
    /// Of each run, another run of its island, or itself.
    parents: Vec<u32>,
    /// Of each run that is its own parent, the pixels of the island.
    pixels: Vec<u32>,
}

/// Columns `start` to `end` (exclusive) of row `y`, whose neighbours belong together.
#[derive(Clone, Copy, Debug)]
struct Run {
    y: u32,
    start: u32,
    end: u32,
}

impl Speckles {
    /// For maps of this many pixels: no memory is taken later.
    pub fn new(pixels: usize) -> Self {
        Self {
            runs: Vec::with_capacity(pixels),
            parents: Vec::with_capacity(pixels),
            pixels: Vec::with_capacity(pixels),
        }
    }

    /// Makes all islands of `map`, `width` columns, unknown that have at most `max_pixels`.
    pub fn remove(&mut self, map: &mut [u16], width: usize, max_pixels: u32) {
        self.find_runs(map, width);
        self.join_rows(map, width);
        self.pixels.clear();
        self.pixels.resize(self.runs.len(), 0);
        for run in 0..self.runs.len() {
            let root = self.root(run as u32);
            self.parents[run] = root;
            self.pixels[root as usize] += self.runs[run].end - self.runs[run].start;
        }
        for (run, &root) in self.runs.iter().zip(&self.parents) {
            if self.pixels[root as usize] <= max_pixels {
                let row = run.y as usize * width;
                map[row + run.start as usize..row + run.end as usize].fill(UNKNOWN);
            }
        }
    }

    /// Splits the rows into runs of known pixels without a step, each an island of its own at first.
    fn find_runs(&mut self, map: &[u16], width: usize) {
        self.runs.clear();
        for (y, row) in (0..).zip(map.chunks_exact(width)) {
            let mut start = 0;
            for x in 0..width {
                let goes_on = x + 1 < width && row[x + 1] != UNKNOWN && row[x].abs_diff(row[x + 1]) <= STEP;
                if row[x] == UNKNOWN {
                    start = x + 1;
                } else if !goes_on {
                    self.runs.push(Run { y, start: start as u32, end: x as u32 + 1 });
                    start = x + 1;
                }
            }
        }
        self.parents.clear();
        self.parents.extend(0..self.runs.len() as u32);
    }

    /// Joins the islands of runs in neighbouring rows that touch without a step.
    fn join_rows(&mut self, map: &[u16], width: usize) {
        // The first run that may touch the present one from the row above.
        let mut above = 0;
        for below in 0..self.runs.len() {
            let run = self.runs[below];
            // Runs are in the order of the rows, and of the columns in them.
            while self.runs[above].y + 1 < run.y
                || (self.runs[above].y + 1 == run.y && self.runs[above].end <= run.start)
            {
                above += 1;
            }
            let row = run.y as usize * width;
            for other in above..below {
                let Run { y, start, end } = self.runs[other];
                if y + 1 != run.y || start >= run.end {
                    break;
                }
                let shared = row + run.start.max(start) as usize..row + run.end.min(end) as usize;
                let (here, there) = (&map[shared.clone()], &map[shared.start - width..shared.end - width]);
                if here.iter().zip(there).any(|(here, there)| here.abs_diff(*there) <= STEP) {
                    let (a, b) = (self.root(below as u32), self.root(other as u32));
                    self.parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
    }

    /// The run that stands for the island of `run`; shortens the way to it for the next time.
    fn root(&mut self, mut run: u32) -> u32 {
        while self.parents[run as usize] != run {
            let parent = self.parents[run as usize];
            self.parents[run as usize] = self.parents[parent as usize];
            run = parent;
        }
        run
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn islands_go_by_their_pixels_and_slopes_are_one() {
        let (width, height) = (40usize, 30usize);
        // A slope, on it an island of 3x4 pixels, one of 4x4, and a U whose arms meet only below.
        let mut map: Vec<u16> = (0..width * height).map(|i| 640 + (i % width) as u16 * 60).collect();
        let mut put = |x: usize, y: usize, w: usize, h: usize| {
            for row in y..y + h {
                map[row * width + x..row * width + x + w].fill(9000);
            }
        };
        put(2, 2, 3, 4);
        put(10, 2, 4, 4);
        put(20, 2, 2, 5);
        put(26, 2, 2, 5);
        put(20, 7, 8, 1);
        let whole = map.clone();
        let mut speckles = Speckles::new(width * height);
        speckles.remove(&mut map, width, 15);
        let gone: Vec<usize> = (0..map.len()).filter(|&i| map[i] == UNKNOWN).collect();
        assert_eq!(gone.len(), 12);
        assert!(gone.iter().all(|&i| (2..5).contains(&(i % width)) && (2..6).contains(&(i / width))));
        assert!((0..map.len()).all(|i| map[i] == UNKNOWN || map[i] == whole[i]));
        speckles.remove(&mut map, width, 28);
        assert_eq!(map.iter().filter(|&&d| d == UNKNOWN).count(), 12 + 16 + 28);
    }
}
