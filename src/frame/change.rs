//! Changes from frame to frame that exceed the sensor's noise, found in the means of small tiles.
//!
//! The means over a square predict the result of any average over about that area, such as a blur or the input of a
//! network. They are of squared codes, which is near linear light, and are compared as luma and chroma in codes.

use std::ops::Range;

/// Side of a tile in pixels.
pub const TILE: usize = 8;
/// Means per tile: light of red, green and blue (squared codes, near linear light), and CoC in pixels.
const MEANS: usize = 4;
/// Change of luma and of chroma that counts, in codes of Y'CbCr, where the sensor has no noise.
const BOUND: [f32; 2] = [0.6, 1.0];
/// Largest bound on a noisy sensor.
const MAX_BOUND: [f32; 2] = [2.5, 4.0];
/// A change that counts exceeds the noise this many standard deviations.
const DEVIATIONS: f32 = 5.0;
/// Fraction of a normal distribution's absolute values below [`QUARTILE`] standard deviations.
const QUARTER: usize = 4;
const QUARTILE: f32 = 0.3186;
/// Thresholds on the difference, in codes of Y'CbCr, between the held content and the content that a kept result was
/// computed from; and on that of the CoC, as a fraction of its own threshold. They are lower, because held content has
/// less noise, and because a difference between neighbouring results would show as a seam, which blur hides in content.
const RESULT_BOUND: [f32; 2] = [0.4, 0.7];
const RESULT_COC_BOUND: f32 = 0.6;
/// Change of the CoC that counts, as a fraction of the smallest kept radius, and at least in pixels.
const COC_BOUND: (f32, f32) = (0.015, 0.1);
/// Fraction of the difference by which the known noise follows the measured one, upwards and downwards.
const NOISE_RISE: f32 = 1.0 / 16.0;
const NOISE_FALL: f32 = 1.0 / 4.0;
/// Buckets of each half of the histogram of changes, and buckets per code.
const BUCKETS: usize = 128;
const BUCKETS_PER_CODE: f32 = 32.0;
/// Largest side of the square that is averaged, in pixels.
const MAX_SIDE_PX: f32 = 256.0;
/// Tiles with less CoC, in pixels, are in focus: nothing of them is kept.
const IN_FOCUS_PX: f32 = 0.5;

/// Adds the squares of a row of samples, 8-bit RGB, to those of the rows above.
#[inline(always)]
pub fn add_squares(sums: &mut [u32], row: &[u8]) {
    for (sum, &code) in sums.iter_mut().zip(row) {
        *sum += u32::from(u16::from(code) * u16::from(code));
    }
}

/// Writes the means of a row of tiles, by channel, from the sums over its `rows` rows.
#[inline(always)]
pub fn average_squares(sums: &[u32], rows: usize, [red, green, blue]: [&mut [f32]; 3]) {
    let planes = red.iter_mut().zip(green).zip(blue);
    for (tile, ((red, green), blue)) in sums.chunks(TILE * 3).zip(planes) {
        let mut totals = [0u32; 3];
        for pixel in tile.as_chunks::<3>().0 {
            for (total, sum) in totals.iter_mut().zip(pixel) {
                *total += sum;
            }
        }
        let scale = 1.0 / (tile.len() / 3 * rows) as f32;
        (*red, *green, *blue) = (totals[0] as f32 * scale, totals[1] as f32 * scale, totals[2] as f32 * scale);
    }
}

/// Means of the tiles of a picture: plane by plane, row by row.
#[derive(Clone, Default)]
pub struct TileMeans {
    pub planes: [Vec<f32>; MEANS],
    pub across: usize,
    pub down: usize,
}

impl TileMeans {
    fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
        Self { planes: std::array::from_fn(|_| vec![0.0; across * down]), across, down }
    }

    /// Copies the marked units, `across` tiles wide, of some rows of tiles.
    fn copy_units(&mut self, from: &Self, rows: Range<usize>, across: usize, units: &[bool]) {
        for row in rows.start..rows.end.min(self.down) {
            let tiles = row * self.across..(row + 1) * self.across;
            for (from, to) in from.planes.iter().zip(&mut self.planes) {
                let (from, to) = (from[tiles.clone()].chunks(across), to[tiles.clone()].chunks_mut(across));
                for (_, (from, to)) in units.iter().zip(from.zip(to)).filter(|(unit, _)| **unit) {
                    to.copy_from_slice(from);
                }
            }
        }
    }

    /// Compares every tile, whatever its CoC.
    pub fn ignore_coc(&mut self) {
        self.planes[3].fill(f32::from(u8::MAX));
    }
}

/// Predicted luma, chroma (2) and CoC of each tile, of three pictures: the current frame, the **content** that is held
/// in its place, and the content from which the **result** was made.
pub struct Prediction {
    /// Means of the current frame, to be written before [`Prediction::predict`].
    pub means: TileMeans,
    /// Means of the held content.
    content: TileMeans,
    now: TileMeans,
    /// Of the previous frame, to measure the noise.
    before: TileMeans,
    held: TileMeans,
    made: TileMeans,
    scratch: Vec<f32>,
    /// Standard deviation of luma and chroma from frame to frame, in codes.
    noise: [f32; 2],
    /// Change that counts: luma, chroma (2) and CoC.
    bounds: [f32; MEANS],
    weights: Weights,
    has_before: bool,
}

impl Prediction {
    pub fn new(width: usize, height: usize) -> Self {
        let means = TileMeans::new(width, height);
        Self {
            scratch: vec![0.0; means.across * means.down],
            content: means.clone(),
            now: means.clone(),
            before: means.clone(),
            held: means.clone(),
            made: means.clone(),
            means,
            noise: [0.0; 2],
            bounds: [0.0; MEANS],
            weights: Weights::of_disc(0.0),
            has_before: false,
        }
    }

    /// Predicts the result of the surveyed frame for discs of `radius_px`, the smallest kept radius.
    #[inline(always)]
    pub fn predict(&mut self, radius_px: f32) {
        std::mem::swap(&mut self.now, &mut self.before);
        self.weights = Weights::of_disc(radius_px);
        predict_result(&self.means, self.weights, &mut self.scratch, &mut self.now);
        if self.has_before {
            self.measure_noise();
        }
        self.has_before = true;
        for k in 0..2 {
            let noise = DEVIATIONS * self.noise[k];
            // Far more than the largest bound is no noise: the camera moves.
            let bound = if noise > 2.0 * MAX_BOUND[k] { BOUND[k] } else { noise.clamp(BOUND[k], MAX_BOUND[k]) };
            self.bounds[k..][..1 + k].fill(bound);
        }
        self.bounds[3] = (COC_BOUND.0 * radius_px).max(COC_BOUND.1);
    }

    /// Measures the noise by the quarter of the tiles that differs least from the median change: what moves is not among
    /// them, and a change of the light is no noise.
    fn measure_noise(&mut self) {
        for (k, planes) in [0..1, 1..3].into_iter().enumerate() {
            let mut counts = [0usize; 2 * BUCKETS];
            let mut total = 0;
            for plane in planes {
                for (now, before) in self.now.planes[plane].iter().zip(&self.before.planes[plane]) {
                    let bucket = (now - before) * BUCKETS_PER_CODE + BUCKETS as f32;
                    counts[bucket.clamp(0.0, (2 * BUCKETS - 1) as f32) as usize] += 1;
                    total += 1;
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

    /// Marks the units, `across` tiles wide, of some rows of tiles where the frame differs from the held content.
    pub fn find_changed(&self, rows: Range<usize>, across: usize, units: &mut [bool]) {
        mark_different(&self.now, &self.held, &self.bounds, rows, across, units);
    }

    /// Replaces the held content of the marked units by the current frame's.
    pub fn hold(&mut self, rows: Range<usize>, across: usize, units: &[bool]) {
        self.content.copy_units(&self.means, rows, across, units);
    }

    /// Predicts the result of the held content.
    #[inline(always)]
    pub fn predict_held(&mut self) {
        predict_result(&self.content, self.weights, &mut self.scratch, &mut self.held);
    }

    /// Marks the units of some rows of tiles where the held content differs from the one the result was computed from.
    pub fn find_outdated(&self, rows: Range<usize>, across: usize, units: &mut [bool]) {
        let [luma, chroma] = RESULT_BOUND;
        let bounds = [luma, chroma, chroma, RESULT_COC_BOUND * self.bounds[3]];
        mark_different(&self.held, &self.made, &bounds, rows, across, units);
    }

    /// Notes that the results of the marked units are made of the held content.
    pub fn make(&mut self, rows: Range<usize>, across: usize, units: &[bool]) {
        self.made.copy_units(&self.held, rows, across, units);
    }

    /// Holds the current frame, and notes that all results are made of it.
    pub fn make_all(&mut self) {
        for (from, to) in [(&self.means, &mut self.content), (&self.now, &mut self.held), (&self.now, &mut self.made)] {
            from.planes.iter().zip(&mut to.planes).for_each(|(from, to)| to.copy_from_slice(from));
        }
    }
}

/// Averages means over about a disc, as luma, chroma (2) and CoC.
#[inline(always)]
fn predict_result(means: &TileMeans, weights: Weights, scratch: &mut [f32], out: &mut TileMeans) {
    let size = (out.across, out.down);
    for (means, out) in means.planes.iter().zip(&mut out.planes) {
        average(means, size, weights, scratch, out);
    }
    let [red, green, blue, _] = &mut out.planes;
    for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
        let (red, green, blue) = (r.sqrt(), g.sqrt(), b.sqrt());
        let luma = 0.299 * red + 0.587 * green + 0.114 * blue;
        (*r, *g, *b) = (luma, 0.564 * (blue - luma), 0.713 * (red - luma));
    }
}

/// Marks the units, `across` tiles wide, in or beside which any blurred tile of two predictions differs by more than
/// `bounds`: a prediction is of the middle of its tile, and a disc at its border, or a pixel of a coarse bin, reads the
/// next one.
fn mark_different(
    a: &TileMeans,
    b: &TileMeans,
    bounds: &[f32; MEANS],
    rows: Range<usize>,
    across: usize,
    units: &mut [bool],
) {
    for row in rows.start.saturating_sub(1)..(rows.end + 1).min(a.down) {
        let tiles = row * a.across..(row + 1) * a.across;
        let [a, b] = [a, b].map(|side| side.planes.each_ref().map(|plane| &plane[tiles.clone()]));
        for (unit, first) in units.iter_mut().zip((0..tiles.len()).step_by(across)) {
            *unit |= (first.saturating_sub(1)..(first + across + 1).min(tiles.len())).any(|tile| {
                let is_blurred = a[3][tile].abs().max(b[3][tile].abs()) > IN_FOCUS_PX;
                is_blurred && (0..MEANS).any(|plane| (a[plane][tile] - b[plane][tile]).abs() > bounds[plane])
            });
        }
    }
}

/// Weights of a row of tiles: 1 up to `whole` tiles away, `part` for the next one, 0 beyond.
#[derive(Clone, Copy)]
struct Weights {
    whole: usize,
    part: f32,
}

impl Weights {
    /// Returns the box with the variance of a disc, less that of a tile: `radius^2 / 4 = side^2 / 12 + TILE^2 / 12`.
    fn of_disc(radius_px: f32) -> Self {
        let tile = TILE as f32;
        let side = (3.0 * radius_px * radius_px - tile * tile).max(tile * tile).sqrt().min(MAX_SIDE_PX) / tile;
        let beyond = (side - 1.0) / 2.0;
        Self { whole: beyond as usize, part: beyond.fract() }
    }

    /// Returns the distances with their weights.
    fn iter(self) -> impl Iterator<Item = (usize, f32)> {
        (1..=self.whole).map(|distance| (distance, 1.0)).chain([(self.whole + 1, self.part)])
    }

    fn sum(self) -> f32 {
        (2 * self.whole + 1) as f32 + 2.0 * self.part
    }
}

/// Averages each value with its neighbours, along rows and columns; the outermost repeat.
#[inline(always)]
fn average(values: &[f32], (across, down): (usize, usize), weights: Weights, rows: &mut [f32], out: &mut [f32]) {
    let scale = 1.0 / (weights.sum() * weights.sum());
    for (sums, line) in rows.chunks_exact_mut(across).zip(values.chunks_exact(across)) {
        sums.copy_from_slice(line);
        for (distance, weight) in weights.iter() {
            let inner = across.saturating_sub(distance);
            let (first, last) = (weight * line[0], weight * line[across - 1]);
            sums[..inner].iter_mut().zip(&line[across - inner..]).for_each(|(sum, value)| *sum += weight * value);
            sums[inner..].iter_mut().for_each(|sum| *sum += last);
            sums[across - inner..].iter_mut().zip(&line[..inner]).for_each(|(sum, value)| *sum += weight * value);
            sums[..across - inner].iter_mut().for_each(|sum| *sum += first);
        }
    }
    for (y, out) in out.chunks_exact_mut(across).enumerate() {
        let line = |y: usize| &rows[y * across..][..across];
        out.copy_from_slice(line(y));
        for (distance, weight) in weights.iter() {
            let (above, below) = (line(y.saturating_sub(distance)), line((y + distance).min(down - 1)));
            for ((out, above), below) in out.iter_mut().zip(above).zip(below) {
                *out += weight * (above + below);
            }
        }
        out.iter_mut().for_each(|out| *out *= scale);
    }
}
