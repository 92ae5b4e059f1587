//! Deconvolution: undoing a blur whose kernel is guessed.
//!
//! For light `x`, kernel `k` and noise `n` one sees `y = k * x + n`. The Wiener filter estimates `X = Y conj(K) / (|K|^2 +
//! s)` for a constant ratio `s` of noise to signal (Wiener 1949). Richardson-Lucy iterates `x <- x (k^T * (y / (k * x)))`,
//! which keeps light positive (Richardson 1972, Lucy 1974). All kernels here are even, so that `K` is real and `k^T = k`.

use std::f32::consts::PI;

use rustfft::num_complex::Complex32;

use super::fourier::Fourier;
use super::light::Light;
use super::observation::Observation;
use super::score::Truth;

/// Samples per pixel, in each direction, of a kernel's rim.
const SUBSAMPLES: i32 = 8;
/// Light below which Richardson-Lucy does not divide.
const MIN_LIGHT: f32 = 1e-4;
/// Iterations between the pictures of Richardson-Lucy that are scored.
const SCORED_ITERATIONS: usize = 10;

/// What an attacker takes the blur to be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guess {
    /// Radius of the disc, in pixels.
    pub radius_px: f32,
    /// Width of its soft rim, as a fraction of the radius.
    pub rim: f32,
    /// Size of the cells that the picture is reduced to by tents, and enlarged from; 0 for none.
    pub cell_px: f32,
    /// Ratio of noise to signal.
    pub noise: f32,
}

/// Guesses, of which all combinations are tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Guesses {
    /// See [`Guess::radius_px`].
    pub radii_px: Vec<f32>,
    /// See [`Guess::rim`].
    pub rims: Vec<f32>,
    /// See [`Guess::cell_px`].
    pub cells_px: Vec<f32>,
    /// See [`Guess::noise`].
    pub noises: Vec<f32>,
}

/// Ratios of noise to signal, from that of 8 bits to that of a call at a low rate.
const NOISES: [f32; 4] = [1e-5, 1e-4, 1e-3, 1e-2];

impl Guesses {
    /// Returns the guesses of an attacker who knows the program and the radius of the blur.
    pub fn for_known_radius(radius_px: f32) -> Self {
        let radii_px = [-0.5, 0.0, 0.5].map(|off_px| radius_px + off_px).to_vec();
        let cells_px = vec![0.0, 4.0, (radius_px / 2.0).max(8.0)];
        Self { radii_px, rims: vec![0.1, 0.2], cells_px, noises: NOISES.to_vec() }
    }

    /// Returns the guesses of one who knows nothing.
    pub fn for_unknown_radius() -> Self {
        let radii_px = (4..=32).map(|radius_px| radius_px as f32).collect();
        Self { radii_px, rims: vec![0.2], cells_px: vec![0.0], noises: NOISES.to_vec() }
    }

    /// Returns the guesses near the best one so far.
    pub fn near(guess: &Guess) -> Self {
        let radii_px = (-2..=2).map(|half_px| guess.radius_px + half_px as f32 / 2.0).collect();
        Self { radii_px, rims: vec![0.1, 0.2, 0.3], cells_px: vec![0.0, 4.0, 8.0, 12.0], noises: NOISES.to_vec() }
    }
}

/// A picture after an attack.
#[derive(Clone, Debug, Default)]
pub struct Restored {
    /// The picture.
    pub light: Light,
    /// Correlation with each row of the card.
    pub scores: Vec<f32>,
    /// The guess that led to it.
    pub guess: Guess,
}

impl Restored {
    /// Keeps the better of two: the one with the larger sum of correlations.
    fn keep_better(&mut self, other: Self) {
        let sum = |of: &Self| of.scores.iter().sum::<f32>();
        if self.scores.is_empty() || sum(&other) > sum(self) {
            *self = other;
        }
    }
}

/// Restores by the Wiener filter of the best guess. The attacker is granted to see which is best.
pub fn restore_by_wiener(seen: &Observation, truth: &Truth<'_>, guesses: &Guesses) -> Restored {
    let mut best = Restored::default();
    let cells: Vec<(f32, Vec<f32>)> =
        guesses.cells_px.iter().map(|&cell_px| (cell_px, cell_transfer(&seen.fourier, cell_px))).collect();
    for &radius_px in &guesses.radii_px {
        for &rim in &guesses.rims {
            let disc = disc_transfer(&seen.fourier, radius_px, rim);
            for (cell_px, cell) in &cells {
                // Filtered pictures are real: two share a transform.
                for pair in guesses.noises.chunks(2) {
                    let noises = [pair[0], pair[pair.len() - 1]];
                    let filtered = seen.spectrum.iter().zip(disc.iter().zip(cell)).map(|(&value, (disc, cell))| {
                        let transfer = disc * cell;
                        let gain = noises.map(|noise| transfer / (transfer * transfer + noise));
                        value * Complex32::new(gain[0], gain[1])
                    });
                    let plane = seen.fourier.invert(filtered.collect());
                    for (at, &noise) in pair.iter().enumerate() {
                        let light = seen.cut(&plane, |value| seen.average + if at == 0 { value.re } else { value.im });
                        let guess = Guess { radius_px, rim, cell_px: *cell_px, noise };
                        best.keep_better(Restored { scores: truth.score(&light), light, guess });
                    }
                }
            }
        }
    }
    best
}

/// Restores by the Wiener filter without any knowledge of the blur: a coarse search of the radius, then a fine one of
/// radius, rim, cells and noise.
pub fn search_by_wiener(seen: &Observation, truth: &Truth<'_>) -> Restored {
    let mut best = restore_by_wiener(seen, truth, &Guesses::for_unknown_radius());
    best.keep_better(restore_by_wiener(seen, truth, &Guesses::near(&best.guess)));
    best
}

/// Restores by Richardson-Lucy with one guess; the best of every tenth of `iterations` counts.
pub fn restore_by_richardson_lucy(seen: &Observation, truth: &Truth<'_>, guess: Guess, iterations: usize) -> Restored {
    let fourier = &seen.fourier;
    let cell = cell_transfer(fourier, guess.cell_px);
    let disc = disc_transfer(fourier, guess.radius_px, guess.rim);
    let transfer: Vec<f32> = disc.iter().zip(&cell).map(|(disc, cell)| disc * cell).collect();
    let blur = |plane: Vec<Complex32>| {
        let mut spectrum = fourier.transform(plane);
        spectrum.iter_mut().zip(&transfer).for_each(|(value, transfer)| *value *= *transfer);
        fourier.invert(spectrum)
    };
    let real = |value: f32| Complex32::new(value, 0.0);
    let blurred: Vec<f32> = seen.padded_light().into_iter().map(|value| value.max(MIN_LIGHT)).collect();
    let mut light: Vec<Complex32> = blurred.iter().map(|&value| real(value)).collect();
    let mut best = Restored::default();
    for iteration in 1..=iterations {
        let expected = blur(light.clone());
        let ratio = blurred.iter().zip(expected).map(|(seen, expected)| real(seen / expected.re.max(MIN_LIGHT)));
        let correction = blur(ratio.collect());
        light.iter_mut().zip(correction).for_each(|(value, by)| *value = real((value.re * by.re).max(MIN_LIGHT)));
        if iteration % SCORED_ITERATIONS == 0 {
            let light = seen.cut(&light, |value| value.re);
            best.keep_better(Restored { scores: truth.score(&light), light, guess });
        }
    }
    best
}

/// Returns the transfer function of a disc whose rim falls linearly.
fn disc_transfer(fourier: &Fourier, radius_px: f32, rim: f32) -> Vec<f32> {
    let reach = radius_px as i32 + 2;
    let offset = |k: i32, sub: i32| k as f32 + (sub as f32 + 0.5) / SUBSAMPLES as f32 - 0.5;
    let rim_px = (radius_px * rim).max(1e-3);
    let coverage = |x: i32, y: i32| {
        let subs = (0..SUBSAMPLES).flat_map(|v| (0..SUBSAMPLES).map(move |u| (u, v)));
        subs.map(|(u, v)| ((radius_px - offset(x, u).hypot(offset(y, v))) / rim_px).clamp(0.0, 1.0)).sum::<f32>()
    };
    let around = |k: i32, length: usize| k.rem_euclid(length as i32) as usize;
    let mut plane = vec![Complex32::default(); fourier.width * fourier.height];
    for y in -reach..=reach {
        for x in -reach..=reach {
            plane[around(y, fourier.height) * fourier.width + around(x, fourier.width)].re = coverage(x, y);
        }
    }
    let total = plane.iter().map(|value| value.re).sum::<f32>().max(f32::MIN_POSITIVE);
    fourier.transform(plane).into_iter().map(|value| value.re / total).collect()
}

/// Returns the transfer function of reducing by tents to cells and enlarging by tents; cells of 0 px change nothing.
fn cell_transfer(fourier: &Fourier, cell_px: f32) -> Vec<f32> {
    let tents = |frequency: f32| {
        let x = PI * frequency * cell_px;
        if x == 0.0 { 1.0 } else { (x.sin() / x).powi(4) }
    };
    fourier.map_frequencies(|fx, fy| tents(fx) * tents(fy))
}
