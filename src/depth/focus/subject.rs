//! Finds the nearest large subject of a depth map.

use crate::frame::DepthMap;

/// Cells of the disparity histogram, in dioptres, and the upper end of the last cell: 0.2 m.
const BINS: usize = 256;
const MAX_DIOPTRES: f32 = 5.0;
/// Half-width of a subject in cells: a head is about 0.25 m deep at 1 m.
const RADIUS: usize = 6;
/// Minimum fraction of the known pixels' weight that makes a subject large, and lower bound of the known weight as a
/// fraction of all: holes must not make small things large.
const MIN_SUBJECT_FRACTION: f32 = 0.10;
const MIN_KNOWN_FRACTION: f32 = 0.5;
/// Off-centre subjects are skipped: from this offset on, in half widths, if another subject behind is larger by the
/// factor `MIN_SIZE_RATIO` and closer to the centre by `MAX_OFFSET_RATIO`; for example leaves beside a person.
const MIN_OFF_CENTER: f32 = 0.3;
const MIN_SIZE_RATIO: f32 = 1.6;
const MAX_OFFSET_RATIO: f32 = 0.6;
/// Maximum number of sampled rows and columns.
const MAX_SAMPLES: usize = 160;

/// Finds the nearest large subject in a histogram over disparity, weighted towards the picture's centre.
#[derive(Debug)]
pub struct SubjectFinder {
    bins: [Bin; BINS],
    /// Total weight for comparison with [`MIN_SUBJECT_FRACTION`].
    total: f32,
    columns: Vec<f32>,
}

/// Weighted sums over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    weight: f32,
    /// Sum of weight x disparity, for a resolution finer than the cells.
    disparity: f32,
    /// Sum of weight x column, from -1 to 1.
    column: f32,
}

impl Bin {
    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.disparity += other.disparity;
        self.column += other.column;
    }

    fn dioptres(&self) -> f32 {
        self.disparity / self.weight
    }

    /// Returns the absolute mean offset from the centre, in half widths.
    fn mean_center_offset(&self) -> f32 {
        (self.column / self.weight).abs()
    }
}

impl Default for SubjectFinder {
    fn default() -> Self {
        Self { bins: [Bin::default(); BINS], total: 0.0, columns: Vec::new() }
    }
}

impl SubjectFinder {
    /// Returns the subject's distance in dioptres: the nearest large one's, or else the largest one's; `None` if no
    /// depth is known.
    pub fn find(&mut self, map: &DepthMap) -> Option<f32> {
        self.fill_histogram(map);
        if self.total == 0.0 {
            return None;
        }
        let window_sums = self.window_sums();
        let is_peak = |bin: &usize| is_peak(&window_sums, *bin);
        let is_large = |&bin: &usize| window_sums[bin].weight >= MIN_SUBJECT_FRACTION * self.total;
        let large = |below: usize| (0..below).rev().filter(is_peak).filter(is_large);
        // The farthest large peak is the background, which does not count as the larger subject.
        let background = (0..BINS).filter(is_peak).find(is_large);
        let is_off_center = |&bin: &usize| {
            let own = window_sums[bin];
            let outdoes = |other: Bin| {
                other.weight >= MIN_SIZE_RATIO * own.weight
                    && other.mean_center_offset() <= MAX_OFFSET_RATIO * own.mean_center_offset()
            };
            let is_between =
                |other: &usize| other + 2 * RADIUS < bin && background.is_some_and(|far| far + 2 * RADIUS < *other);
            own.mean_center_offset() >= MIN_OFF_CENTER
                && large(bin).filter(is_between).any(|other| outdoes(window_sums[other]))
        };
        let nearest = large(BINS).find(|bin| !is_off_center(bin));
        let largest = || (0..BINS).max_by(|&a, &b| window_sums[a].weight.total_cmp(&window_sums[b].weight));
        nearest.or_else(largest).map(|bin| window_sums[bin].dioptres())
    }

    fn window_sums(&self) -> [Bin; BINS] {
        std::array::from_fn(|bin| self.window_sum(bin))
    }

    /// Returns the distance of a remaining subject near `dioptres` in the last map, if at least half a large one is
    /// left.
    pub fn find_near(&self, dioptres: f32) -> Option<f32> {
        let around = Self::window(Self::bin_at(dioptres)).map(|bin| self.window_sum(bin));
        let most = around.max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        (self.total > 0.0 && most.weight >= 0.5 * MIN_SUBJECT_FRACTION * self.total).then(|| most.dioptres())
    }

    fn window_sum(&self, bin: usize) -> Bin {
        let mut window_sum = Bin::default();
        self.bins[Self::window(bin)].iter().for_each(|bin| window_sum.add(bin));
        window_sum
    }

    fn bin_at(dioptres: f32) -> usize {
        ((dioptres * (BINS as f32 / MAX_DIOPTRES)) as usize).min(BINS - 1)
    }

    fn window(bin: usize) -> std::ops::Range<usize> {
        bin.saturating_sub(RADIUS)..(bin + RADIUS + 1).min(BINS)
    }

    /// Fills the histogram.
    fn fill_histogram(&mut self, map: &DepthMap) {
        self.bins.fill(Bin::default());
        let (width, height) = (map.width as usize, map.height as usize);
        let (mut known, mut all) = (0.0, 0.0);
        let step = width.div_ceil(MAX_SAMPLES).max(1);
        self.columns.clear();
        self.columns.extend((0..width).step_by(step).map(|x| center_offset(x, width)));
        for y in (0..height).step_by(height.div_ceil(MAX_SAMPLES).max(1)) {
            let row_weight = 1.0 - 0.9 * center_offset(y, height).powi(2);
            let row = map.metres[y * width..][..width].iter().step_by(step);
            for (&metres, &column) in row.zip(&self.columns) {
                // A person's column is more certain than the row.
                let weight = row_weight * (1.0 - 0.95 * column * column).powi(2);
                all += weight;
                if DepthMap::is_known(metres) {
                    let disparity = 1.0 / metres;
                    let one = Bin { weight, disparity: weight * disparity, column: weight * column };
                    self.bins[Self::bin_at(disparity)].add(&one);
                    known += weight;
                }
            }
        }
        self.total = if known > 0.0 { known.max(MIN_KNOWN_FRACTION * all) } else { 0.0 };
    }
}

fn is_peak(window_sums: &[Bin; BINS], bin: usize) -> bool {
    SubjectFinder::window(bin).all(|other| window_sums[other].weight <= window_sums[bin].weight)
}

/// Returns a pixel's position relative to the centre, from -1 to 1.
fn center_offset(at_px: usize, size_px: usize) -> f32 {
    (at_px as f32 + 0.5) / size_px as f32 * 2.0 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room at 5 m, a person in the middle at 1.2 m, and leaves at 0.55 m from the left up to column `until`.
    fn leaves(until: f32, is_known: impl Fn(usize) -> bool) -> DepthMap {
        let (width, height) = (160, 90);
        let metres = |at: usize| {
            let (x, y) = ((at % width) as f32 / width as f32, (at / width) as f32 / height as f32);
            match () {
                () if !is_known(at) => 0.0,
                () if x < until && y > 0.5 => 0.55,
                () if (x - 0.5).abs() < 0.06 && (0.2..0.55).contains(&y) => 1.2,
                () if (x - 0.5).abs() < 0.18 && y >= 0.55 => 1.25,
                () => 5.0,
            }
        };
        DepthMap { metres: (0..width * height).map(metres).collect(), ..DepthMap::new(width as u32, height as u32) }
    }

    #[test]
    fn leaves_at_a_side_are_not_the_subject_however_much_of_the_room_is_unknown() {
        for until in [0.1, 0.2, 0.25, 0.3, 0.35] {
            for every in [1, 2, 3, 7] {
                // Only far depth is unknown, as where stereo matching fails.
                let whole = leaves(until, |_| true);
                let map = leaves(until, |at| whole.metres[at] < 2.0 || at % every == 0);
                let found_m = 1.0 / SubjectFinder::default().find(&map).unwrap();
                assert!((found_m - 1.22).abs() < 0.05, "{until} {every}: {found_m}");
            }
        }
    }

    #[test]
    fn who_comes_to_the_middle_is_the_subject_though_somebody_larger_is_behind() {
        let mut map = leaves(0.0, |_| true);
        for (at, metres) in map.metres.iter_mut().enumerate() {
            if (0.4..0.55).contains(&((at % 160) as f32 / 160.0)) && at / 160 > 30 {
                *metres = 0.6;
            }
        }
        let found_m = 1.0 / SubjectFinder::default().find(&map).unwrap();
        assert!((found_m - 0.6).abs() < 0.02, "{found_m}");
    }
}
