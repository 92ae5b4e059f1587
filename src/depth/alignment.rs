//! Photometric and geometric alignment of an earlier picture of the same background, such as a plate, with the current
//! one: a gain per channel for exposure and white balance, and a shift for small movements of the camera.

use std::iter::StepBy;
use std::ops::Range;

use super::reduced;
use super::tap::Tap;

/// Darker or brighter pixels are not used for gains.
const MIN_VALUE: f32 = 24.0;
const MAX_VALUE: f32 = reduced::MAX_VALUE - 8.0;
/// Number of bins of the histogram of ratios, and bins per factor of two.
const BINS: usize = 512;
const PER_OCTAVE: f32 = 128.0;
/// Sampling step in pixels of the gain estimation.
const SAMPLING_STEP: usize = 3;
/// Minimum fraction of the pixels that must show the background, as its reciprocal.
const MIN_BACKGROUND_DIVISOR: usize = 12;
/// Rate at which a gain follows that of a frame; relative differences above [`MAX_EASED`] are followed at once.
const RATE: f32 = 0.25;
const MAX_EASED: f32 = 0.03;
/// Largest difference of pixels used for the shift.
const MAX_DIFFERENCE: f32 = 24.0;
/// Largest step of the shift per frame, and the smallest one applied, in downsampled pixels.
const MAX_STEP: f32 = 1.0;
const MIN_STEP: f32 = 0.02;
/// Minimum mean texture for a shift.
const MIN_TEXTURE: f32 = 0.05;

/// Gain and shift from the plate to the current picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Factor per channel.
    pub gain: [f32; 3],
    /// Position of a point now minus that in the plate, right and down, in downsampled pixels.
    pub shift: [f32; 2],
}

impl Default for Alignment {
    fn default() -> Self {
        Self { gain: [1.0; 3], shift: [0.0; 2] }
    }
}

/// Estimates alignments; owns its buffers.
#[derive(Debug, Default)]
pub struct Aligner {
    histogram: Vec<u32>,
    /// The plate, shifted.
    shifted: Vec<[f32; 3]>,
    shifted_by: Option<[f32; 2]>,
}

impl Aligner {
    /// Returns the plate as shifted by the last call of [`Aligner::shift_plate`].
    pub fn shifted_plate(&self) -> &[[f32; 3]] {
        &self.shifted
    }

    /// Invalidates the shifted plate, after a change of the plate.
    pub fn invalidate(&mut self) {
        self.shifted_by = None;
    }

    /// Shifts the plate with bilinear interpolation.
    pub fn shift_plate(&mut self, plate: &[[f32; 3]], (width, height): (usize, usize), shift: [f32; 2]) {
        if self.shifted_by == Some(shift) && self.shifted.len() == plate.len() {
            return;
        }
        self.shifted_by = Some(shift);
        self.shifted.clear();
        if shift == [0.0; 2] {
            self.shifted.extend_from_slice(plate);
            return;
        }
        for y in 0..height {
            let Tap { first, second, weight: down } = Tap::at(y as f32 - shift[1], height);
            let (above, below) = (&plate[first * width..][..width], &plate[second * width..][..width]);
            for x in 0..width {
                let Tap { first: left, second: right, weight: along } = Tap::at(x as f32 - shift[0], width);
                self.shifted.push(std::array::from_fn(|p| {
                    let first = above[left][p] + (above[right][p] - above[left][p]) * along;
                    let second = below[left][p] + (below[right][p] - below[left][p]) * along;
                    first + (second - first) * down
                }));
            }
        }
    }

    /// Moves `alignment` a step towards that of `now`, from the pixels of some rows that are not `is_foreground`.
    pub fn update(
        &mut self,
        now: &[[f32; 3]],
        is_foreground: &[bool],
        (width, rows): (usize, StepBy<Range<usize>>),
        alignment: &mut Alignment,
    ) {
        for p in 0..3 {
            if let Some(gain) = self.estimate_gain(now, is_foreground, (width, rows.clone()), p) {
                let correction = gain / alignment.gain[p] - 1.0;
                alignment.gain[p] *= 1.0 + if correction.abs() > MAX_EASED { correction } else { RATE * correction };
            }
        }
        let step = self.estimate_shift(now, is_foreground, (width, rows), alignment.gain);
        if let Some([across, down]) = step.filter(|[across, down]| across.hypot(*down) >= MIN_STEP) {
            alignment.shift[0] += across.clamp(-MAX_STEP, MAX_STEP);
            alignment.shift[1] += down.clamp(-MAX_STEP, MAX_STEP);
        }
    }

    /// Returns the median of now / plate in channel `p`, which a minority of foreground does not change; `None` if too
    /// little background is visible.
    fn estimate_gain(
        &mut self,
        now: &[[f32; 3]],
        is_foreground: &[bool],
        (width, rows): (usize, StepBy<Range<usize>>),
        p: usize,
    ) -> Option<f32> {
        self.histogram.clear();
        self.histogram.resize(BINS, 0);
        let (mut count, pixels) = (0, rows.len() * width);
        let all = rows.flat_map(|row| (row * width..(row + 1) * width).step_by(SAMPLING_STEP));
        for at in all.filter(|&at| !is_foreground[at]) {
            let (now, plate) = (&now[at], &self.shifted[at]);
            if now[p].min(plate[p]) > MIN_VALUE && now[p].max(plate[p]) < MAX_VALUE {
                let bin = (now[p] / plate[p]).log2() * PER_OCTAVE + BINS as f32 / 2.0;
                self.histogram[(bin as usize).min(BINS - 1)] += 1;
                count += 1;
            }
        }
        if count == 0 || count < pixels / SAMPLING_STEP / MIN_BACKGROUND_DIVISOR {
            return None;
        }
        let mut below = 0;
        let half = count as f32 / 2.0;
        self.histogram.iter().zip(0..).find_map(|(&inside, bin)| {
            below += inside;
            let is_median = below as f32 >= half;
            let within = 1.0 - (below as f32 - half) / (inside.max(1)) as f32;
            is_median.then(|| ((bin as f32 + within - BINS as f32 / 2.0) / PER_OCTAVE).exp2())
        })
    }

    /// Returns the shift by least squares over the optical flow constraint (Lucas and Kanade 1981), in the green
    /// channel.
    fn estimate_shift(
        &self,
        now: &[[f32; 3]],
        is_foreground: &[bool],
        (width, rows): (usize, StepBy<Range<usize>>),
        gain: [f32; 3],
    ) -> Option<[f32; 2]> {
        let (mut sums, mut count) = ([0.0f32; 5], 0);
        let (height, pixels) = (self.shifted.len() / width.max(1), rows.len() * width);
        for y in rows.filter(|&y| y > 0 && y + 1 < height) {
            for x in 1..width.max(1) - 1 {
                let at = y * width + x;
                let value = |at: usize| gain[1] * self.shifted[at][1];
                let rest = now[at][1] - value(at);
                if is_foreground[at] || rest.abs() > MAX_DIFFERENCE {
                    continue;
                }
                let across = 0.5 * (value(at + 1) - value(at - 1));
                let down = 0.5 * (value(at + width) - value(at - width));
                // Normal equations of the optical flow constraint: gradient . shift = -difference.
                let terms = [across * across, across * down, down * down, -across * rest, -down * rest];
                (0..5).for_each(|k| sums[k] += terms[k]);
                count += 1;
            }
        }
        let [xx, xy, yy, x, y] = sums;
        let determinant = xx * yy - xy * xy;
        let least = MIN_TEXTURE * count as f32;
        (count > pixels / MIN_BACKGROUND_DIVISOR && determinant > least * least)
            .then(|| [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (80, 60);

    fn scene(shift: [f32; 2], gain: [f32; 3]) -> Vec<[f32; 3]> {
        let wave = |x: f32, y: f32| 110.0 + 30.0 * (x * 0.31).sin() + 25.0 * (y * 0.23 + x * 0.05).cos();
        let at = |k: usize| wave((k % SIZE.0) as f32 - shift[0], (k / SIZE.0) as f32 - shift[1]);
        (0..SIZE.0 * SIZE.1).map(|k| gain.map(|gain| gain * at(k))).collect()
    }

    #[test]
    fn a_nudge_and_another_exposure_are_found_beside_a_person() {
        let (plate, [right, down]) = (scene([0.0; 2], [1.0; 3]), [1.4, -0.7]);
        let mut now = scene([right, down], [0.9, 1.0, 1.1]);
        let is_person = |k: usize| (20..50).contains(&(k % SIZE.0)) && k / SIZE.0 > 15;
        (0..now.len()).filter(|&k| is_person(k)).for_each(|k| now[k] = [200.0, 40.0, 90.0]);
        let (mut aligner, mut alignment) = (Aligner::default(), Alignment::default());
        let is_foreground = vec![false; now.len()];
        for _ in 0..12 {
            aligner.shift_plate(&plate, SIZE, alignment.shift);
            aligner.update(&now, &is_foreground, (SIZE.0, (0..SIZE.1).step_by(1)), &mut alignment);
        }
        let Alignment { gain, shift } = alignment;
        assert!((shift[0] - right).abs() < 0.08 && (shift[1] - down).abs() < 0.08, "{shift:?}");
        assert!(gain.iter().zip([0.9, 1.0, 1.1]).all(|(a, b)| (a - b).abs() < 0.01), "{gain:?}");
    }
}
