//! Skips a network while its input hardly changes: its output would hardly change either.
//!
//! The means of small tiles are compared with those of the last input that was run. They are of squared codes, which is
//! near linear light, and are compared as luma and chroma in codes. A change counts if it exceeds the sensor's noise,
//! which is measured from picture to picture.

/// Maximum number of pictures in turn without a run, so that a change too slight to be detected is followed, too.
const MAX_SKIPPED: u32 = 15;
/// Side of a tile in pixels.
const TILE: usize = 8;
/// Change of luma and of chroma that counts, in codes of Y'CbCr, where the sensor has no noise.
const BOUND: [f32; 2] = [0.6, 1.0];
/// Largest bound on a noisy sensor.
const MAX_BOUND: [f32; 2] = [2.5, 4.0];
/// A change that counts exceeds the noise this many standard deviations.
const DEVIATIONS: f32 = 5.0;
/// Fraction of a normal distribution's absolute values below [`QUARTILE`] standard deviations.
const QUARTER: usize = 4;
const QUARTILE: f32 = 0.3186;
/// Fraction of the difference by which the known noise follows the measured one, upwards and downwards.
const NOISE_RISE: f32 = 1.0 / 16.0;
const NOISE_FALL: f32 = 1.0 / 4.0;
/// Buckets of each half of the histogram of changes, and buckets per code.
const BUCKETS: usize = 128;
const BUCKETS_PER_CODE: f32 = 32.0;

/// Luma and chroma (2) of each tile of an input, in codes.
type Tiles = Vec<[f32; 3]>;

/// Compares the inputs of a network.
pub struct StillnessDetector {
    /// Sums of squared codes of the row of tiles in progress, sample by sample.
    sums: Vec<u32>,
    height: usize,
    /// The input in progress, the one before it, and the last one that was run.
    now: Tiles,
    before: Tiles,
    run: Tiles,
    /// Standard deviation of luma and chroma from picture to picture, in codes.
    noise: [f32; 2],
    /// Pictures since the last run; `None` before the first.
    skipped: Option<u32>,
    /// Each tile's luma and chroma at its last change, and the pictures since.
    rests: Vec<([f32; 3], u32)>,
}

impl StillnessDetector {
    /// Creates the detector for inputs of `width` x `height` pixels.
    pub fn new((width, height): (usize, usize)) -> Self {
        let most = width.div_ceil(TILE) * height.div_ceil(TILE);
        let [now, before, run] = [(); 3].map(|()| Vec::with_capacity(most));
        Self {
            sums: vec![0; width * 3],
            height,
            now,
            before,
            run,
            noise: [0.0; 2],
            skipped: None,
            rests: Vec::with_capacity(most),
        }
    }

    /// Forgets the last run, for a new scene.
    pub fn reset(&mut self) {
        self.skipped = None;
        self.rests.clear();
    }

    /// Appends to `at_rest` whether each pixel of a mask of `width` x `height` has not changed for this many pictures, for
    /// inputs of `input` columns and rows.
    pub fn append_at_rest(
        &self,
        pictures: u32,
        input: (usize, usize),
        (width, height): (usize, usize),
        at_rest: &mut Vec<bool>,
    ) {
        let across = input.0.div_ceil(TILE);
        // Tile by tile: a division for each pixel takes as long as the rest of the mask's decisions.
        for y in 0..height {
            let first = y * input.1 / height / TILE * across;
            for column in 0..across {
                let end = ((column + 1) * TILE * width / input.0).min(width);
                let is_at_rest = self.rests.get(first + column).is_some_and(|(_, rested)| *rested >= pictures);
                at_rest.resize(y * width + end, is_at_rest);
            }
        }
    }

    /// Adds row `y` of an input, 8-bit RGB; rows come in order.
    pub fn add_row(&mut self, y: usize, row: &[u8]) {
        if y == 0 {
            std::mem::swap(&mut self.now, &mut self.before);
            self.now.clear();
        }
        for (sum, &code) in self.sums.iter_mut().zip(row) {
            *sum += u32::from(u16::from(code) * u16::from(code));
        }
        if (y + 1).is_multiple_of(TILE) || y + 1 == self.height {
            let rows = y % TILE + 1;
            self.now.extend(self.sums.chunks(TILE * 3).map(|tile| {
                let mut totals = [0u32; 3];
                for pixel in tile.as_chunks::<3>().0 {
                    for (total, sum) in totals.iter_mut().zip(pixel) {
                        *total += sum;
                    }
                }
                let scale = 1.0 / (tile.len() / 3 * rows) as f32;
                let [red, green, blue] = totals.map(|total| (total as f32 * scale).sqrt());
                let luma = 0.299 * red + 0.587 * green + 0.114 * blue;
                [luma, 0.564 * (blue - luma), 0.713 * (red - luma)]
            }));
            self.sums.fill(0);
        }
    }

    /// Whether the input hardly differs from that of the last run; if not, a run follows.
    pub fn is_still(&mut self) -> bool {
        if self.before.len() == self.now.len() {
            self.measure_noise();
        }
        let bound = |k: usize| {
            let noise = DEVIATIONS * self.noise[k];
            // Far more than the largest bound is no noise: the camera moves.
            if noise > 2.0 * MAX_BOUND[k] { BOUND[k] } else { noise.clamp(BOUND[k], MAX_BOUND[k]) }
        };
        let bounds = [bound(0), bound(1), bound(1)];
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|plane| (a[plane] - b[plane]).abs() > bounds[plane]);
        self.rests.resize(self.now.len(), ([0.0; 3], 0));
        for ((before, pictures), now) in self.rests.iter_mut().zip(&self.now) {
            match differs((now, before)) {
                true => (*before, *pictures) = (*now, 0),
                false => *pictures += 1,
            }
        }
        let is_due = self.skipped.is_none_or(|skipped| skipped >= MAX_SKIPPED) || self.run.len() != self.now.len();
        let runs = is_due || self.now.iter().zip(&self.run).any(differs);
        if runs {
            self.run.clone_from(&self.now);
        }
        self.skipped = Some(if runs { 0 } else { self.skipped.unwrap_or(0) + 1 });
        !runs
    }

    /// Measures the noise by the quarter of the tiles that differs least from the median change: what moves is not among
    /// them, and a change of the light is no noise.
    fn measure_noise(&mut self) {
        for (k, planes) in [0..1, 1..3].into_iter().enumerate() {
            let mut counts = [0usize; 2 * BUCKETS];
            let total = self.now.len() * planes.len();
            for (now, before) in self.now.iter().zip(&self.before) {
                for plane in planes.clone() {
                    let bucket = (now[plane] - before[plane]) * BUCKETS_PER_CODE + BUCKETS as f32;
                    counts[bucket.clamp(0.0, (2 * BUCKETS - 1) as f32) as usize] += 1;
                }
            }
            let mut below = 0;
            let median = counts.iter().position(|&count| {
                below += count;
                2 * below >= total
            });
            let median = median.unwrap_or(BUCKETS);
            let mut within = counts[median];
            let quartile = (1..BUCKETS).find(|&distance| {
                let is_enough = within * QUARTER >= total;
                let beside = [median.checked_sub(distance), Some(median + distance)];
                within += beside.into_iter().flatten().filter_map(|bucket| counts.get(bucket)).sum::<usize>();
                is_enough
            });
            let noise = (quartile.unwrap_or(BUCKETS) as f32 - 0.5) / BUCKETS_PER_CODE / QUARTILE;
            let follow = match self.noise[k] {
                0.0 => 1.0,
                known if noise < known => NOISE_FALL,
                _ => NOISE_RISE,
            };
            self.noise[k] += (noise - self.noise[k]) * follow;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 36);

    fn is_still(detector: &mut StillnessDetector, code: impl Fn(usize, usize) -> u8) -> bool {
        for y in 0..SIZE.1 {
            let row: Vec<u8> = (0..SIZE.0 * 3).map(|at| code(at / 3, y)).collect();
            detector.add_row(y, &row);
        }
        detector.is_still()
    }

    #[test]
    fn still_inputs_are_skipped_for_a_while_and_changed_ones_not() {
        let mut detector = StillnessDetector::new(SIZE);
        let room = |x: usize, y: usize| (40 + 2 * x + y) as u8;
        let run: Vec<bool> = (0..40).map(|_| !is_still(&mut detector, room)).collect();
        let runs: Vec<usize> = (0..run.len()).filter(|&k| run[k]).collect();
        assert_eq!(runs, [0, 16, 32], "{run:?}");
        assert!(!is_still(&mut detector, |x, y| if x > 50 && y > 30 { 90 } else { room(x, y) }), "a corner changed");
        // A drift too slow to be seen from picture to picture adds up.
        let mut still = 0;
        for step in 0..30 {
            still += u32::from(is_still(&mut detector, |x, y| room(x, y).saturating_add(step / 3)));
        }
        assert!(still < 25, "{still}");
        detector.reset();
        assert!(!is_still(&mut detector, room));
    }
}
