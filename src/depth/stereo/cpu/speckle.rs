//! The speckle filter: removes small components whose disparity differs from their surroundings, which are mismatches.
//!
//! twin: shaders/stereo/runs.wgsl, shaders/stereo/join.wgsl, shaders/stereo/sizes.wgsl, shaders/stereo/gaps.wgsl

use std::ops::Range;

use super::super::fixed::{MAX_SPECKLE_STEP, UNKNOWN};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};

/// Removes speckles, which are small connected components, found by union-find over runs of rows; owns its buffers.
///
/// Each band of rows has room for as many runs as it has pixels, and fills the first entries: so threads find the runs
/// and the components of their bands in parallel, before components that cross bands are joined.
#[derive(Debug, Default)]
pub struct SpeckleFilter {
    runs: Vec<Run>,
    /// For each run, the index of another run of its component, or its own.
    parents: Vec<u32>,
    /// For each run that is its own parent, the number of pixels of the component.
    pixels: Vec<u32>,
}

/// Connected pixels of row `y`: columns `start` to `end` (exclusive).
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    y: u32,
    start: u32,
    end: u32,
}

/// The runs and components of a band of rows.
struct Band<'a> {
    rows: Range<usize>,
    runs: &'a mut [Run],
    parents: &'a mut [u32],
    pixels: &'a mut [u32],
    /// Receives the index of the first run and of one past the last.
    run_range: &'a mut Range<usize>,
}

impl SpeckleFilter {
    /// Allocates for maps of this many pixels; nothing is allocated later.
    pub fn new(pixels: usize) -> Self {
        Self { runs: vec![Run::default(); pixels], parents: vec![0; pixels], pixels: vec![0; pixels] }
    }

    /// Sets all components of `map`, `width` columns wide, that have at most `max_pixels` to unknown.
    pub fn remove_speckles(&mut self, map: &mut [u16], width: usize, max_pixels: u32, workers: &mut ThreadPool) {
        let bands = Bands::new(map.len() / width, 1, workers);
        let mut run_range: [Range<usize>; MAX_ITEMS] = std::array::from_fn(|_| 0..0);
        let (runs, parents) = (bands.split(&mut self.runs, width), bands.split(&mut self.parents, width));
        let parts = bands.rows().zip(runs.zip(parents)).zip(bands.split(&mut self.pixels, width)).zip(&mut run_range);
        let items =
            parts.map(|(((rows, (runs, parents)), pixels), run_range)| Band { rows, runs, parents, pixels, run_range });
        workers.run_each(items, &|band| band.find_components(map, width));
        for pair in run_range.windows(2) {
            self.join_bands(&pair[0], &pair[1], map, width);
        }
        let Self { runs, parents, pixels } = self;
        let parts = bands.rows().zip(bands.split(map, width)).zip(&run_range);
        workers.run_each(parts, &|((rows, map), run_range)| {
            for place in run_range.clone() {
                if pixels[root_of(parents, place)] <= max_pixels {
                    let Run { y, start, end } = runs[place];
                    let row = (y as usize - rows.start) * width;
                    map[row + start as usize..row + end as usize].fill(UNKNOWN);
                }
            }
        });
    }

    /// Joins the components of a band and of the one below it, whose runs have these indices.
    fn join_bands(&mut self, above: &Range<usize>, below: &Range<usize>, map: &[u16], width: usize) {
        let Self { runs, parents, pixels } = self;
        let (upper, lower) = (&runs[above.clone()], &runs[below.clone()]);
        let Some(first) = lower.first() else { return };
        let first_row = &lower[..lower.partition_point(|run| run.y == first.y)];
        let skipped = upper.partition_point(|run| run.y + 1 < first.y);
        for_each_touching(&upper[skipped..], first_row, map, width, |a, b| {
            let (a, b) = (root_of(parents, above.start + skipped + a), root_of(parents, below.start + b));
            if a != b {
                parents[a.max(b)] = a.min(b) as u32;
                pixels[a.min(b)] += pixels[a.max(b)];
            }
        });
    }
}

impl Band<'_> {
    /// Finds the runs and components of the band.
    fn find_components(self, map: &[u16], width: usize) {
        let Self { rows, runs, parents, pixels, run_range } = self;
        let first = rows.start * width;
        let count = find_runs(rows, map, width, runs);
        *run_range = first..first + count;
        let (runs, parents, pixels) = (&runs[..count], &mut parents[..count], &mut pixels[..count]);
        // Parents are indices within the band at first.
        for (number, parent) in parents.iter_mut().enumerate() {
            *parent = number as u32;
        }
        for_each_touching(runs, runs, map, width, |a, b| {
            let (a, b) = (root_with_path_halving(parents, a), root_with_path_halving(parents, b));
            parents[a.max(b)] = a.min(b) as u32;
        });
        // From here on parents are global indices. They precede their children, so that theirs are already converted.
        pixels.fill(0);
        for number in 0..count {
            let parent = parents[number] as usize;
            let root = if parent == number { first + number } else { parents[parent] as usize };
            parents[number] = root as u32;
            pixels[root - first] += runs[number].end - runs[number].start;
        }
    }
}

/// Splits rows into runs of known pixels without a step; returns their number.
fn find_runs(rows: Range<usize>, map: &[u16], width: usize, runs: &mut [Run]) -> usize {
    let mut count = 0;
    for y in rows {
        let row = &map[y * width..(y + 1) * width];
        let mut start = 0;
        for x in 0..width {
            let goes_on = x + 1 < width && row[x + 1] != UNKNOWN && row[x].abs_diff(row[x + 1]) <= MAX_SPECKLE_STEP;
            if row[x] == UNKNOWN {
                start = x + 1;
            } else if !goes_on {
                runs[count] = Run { y: y as u32, start: start as u32, end: x as u32 + 1 };
                count += 1;
                start = x + 1;
            }
        }
    }
    count
}

/// Calls `join` with the indices of each run of `above` and run of `below` that are in adjacent rows and touch without
/// a step. Runs are sorted by row, then column.
fn for_each_touching(above: &[Run], below: &[Run], map: &[u16], width: usize, mut join: impl FnMut(usize, usize)) {
    // The first run that may touch the current one.
    let mut first = 0;
    for (number, run) in below.iter().enumerate() {
        while above.get(first).is_some_and(|a| a.y + 1 < run.y || (a.y + 1 == run.y && a.end <= run.start)) {
            first += 1;
        }
        let row = run.y as usize * width;
        for (other, &Run { y, start, end }) in above.iter().enumerate().skip(first) {
            if y + 1 != run.y || start >= run.end {
                break;
            }
            let shared = row + run.start.max(start) as usize..row + run.end.min(end) as usize;
            let (here, there) = (&map[shared.clone()], &map[shared.start - width..shared.end - width]);
            if here.iter().zip(there).any(|(here, there)| here.abs_diff(*there) <= MAX_SPECKLE_STEP) {
                join(other, number);
            }
        }
    }
}

/// Returns the root of the component of `run`.
fn root_of(parents: &[u32], mut run: usize) -> usize {
    while parents[run] as usize != run {
        run = parents[run] as usize;
    }
    run
}

/// Returns the root of the component of `run`, and halves the path to it.
fn root_with_path_halving(parents: &mut [u32], mut run: usize) -> usize {
    while parents[run] as usize != run {
        let parent = parents[run] as usize;
        parents[run] = parents[parent];
        run = parent;
    }
    run
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn islands_go_by_their_pixels_and_slopes_are_one() {
        let (width, height) = (40usize, 30usize);
        // A slope, on it a component of 3x4 pixels, one of 4x4, and a U whose arms meet only below.
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
        let mut speckles = SpeckleFilter::new(width * height);
        let mut workers = ThreadPool::new("test", 2);
        speckles.remove_speckles(&mut map, width, 15, &mut workers);
        let gone: Vec<usize> = (0..map.len()).filter(|&i| map[i] == UNKNOWN).collect();
        assert_eq!(gone.len(), 12);
        assert!(gone.iter().all(|&i| (2..5).contains(&(i % width)) && (2..6).contains(&(i / width))));
        assert!((0..map.len()).all(|i| map[i] == UNKNOWN || map[i] == whole[i]));
        speckles.remove_speckles(&mut map, width, 28, &mut workers);
        assert_eq!(map.iter().filter(|&&d| d == UNKNOWN).count(), 12 + 16 + 28);
    }
    /// Reference implementation by flood fill.
    fn removed(map: &[u16], width: usize, max_pixels: usize) -> Vec<u16> {
        let mut out = map.to_vec();
        let mut seen = vec![false; map.len()];
        for from in 0..map.len() {
            let (mut component, mut at) = (vec![from], 0);
            if map[from] == UNKNOWN || std::mem::replace(&mut seen[from], true) {
                continue;
            }
            while let Some(&here) = component.get(at) {
                at += 1;
                let (x, y) = (here % width, here / width);
                let beside = [(x > 0).then(|| here - 1), (x + 1 < width).then_some(here + 1)];
                let others = [(y > 0).then(|| here - width), Some(here + width).filter(|&below| below < map.len())];
                for next in beside.into_iter().chain(others).flatten() {
                    let touches = map[next] != UNKNOWN && map[next].abs_diff(map[here]) <= MAX_SPECKLE_STEP;
                    if touches && !std::mem::replace(&mut seen[next], true) {
                        component.push(next);
                    }
                }
            }
            if component.len() <= max_pixels {
                component.into_iter().for_each(|pixel| out[pixel] = UNKNOWN);
            }
        }
        out
    }

    #[test]
    fn islands_reach_from_band_to_band_whatever_the_threads() {
        let (width, height) = (50, 370);
        let mut state = 1u32;
        let mut next = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        // Three levels and unknown pixels, in patches; some rows are empty.
        let mut map = vec![0; width * height];
        for k in 0..map.len() {
            let other = if next(3) == 0 { k.saturating_sub(width) } else { k.saturating_sub(1) };
            map[k] = if next(4) > 0 { map[other] } else { [0, 200, 400, UNKNOWN][next(4) as usize] };
        }
        map[120 * width..123 * width].fill(UNKNOWN);
        for max_pixels in [5, 40] {
            let expected = removed(&map, width, max_pixels as usize);
            assert!(expected != map);
            for threads in [1, 2, 5] {
                let mut workers = ThreadPool::new("test", threads);
                let mut speckles = SpeckleFilter::new(map.len());
                // Fills the buffers with the remains of another map.
                speckles.remove_speckles(&mut map.clone(), width, 3, &mut workers);
                let mut ours = map.clone();
                speckles.remove_speckles(&mut ours, width, max_pixels, &mut workers);
                assert!(ours == expected, "{threads} threads, {max_pixels} pixels");
            }
        }
    }
}
