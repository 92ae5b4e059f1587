//! What an attacker has of a blurred card.

use std::f32::consts::TAU;

use bokehcam::frame::ColorImage;
use rustfft::num_complex::Complex32;

use super::fourier::Fourier;
use super::light::Light;

/// Margin around the picture, which repeats its border, so that its sides do not disturb each other.
const MARGIN_PX: usize = 80;
/// Sides of the transform are multiples of this, for its speed.
const SIDE_STEP: usize = 64;

/// The mean of all pictures, registered, with margins, and its spectrum.
pub struct Observation {
    /// Columns and rows of the picture.
    size: (usize, usize),
    /// Transforms of the picture with its margins.
    pub(super) fourier: Fourier,
    /// Spectrum of the mean without its average.
    pub(super) spectrum: Vec<Complex32>,
    /// Average light.
    pub(super) average: f32,
}

impl Observation {
    /// Registers pictures of one size, whose content is moved to the right and down by `shifts_px`, and averages them
    /// in linear light: the best that a camera that moves gives away. There is at least one picture. The columns up to
    /// `wall_right` count: what is sharp before the wall would disturb the restoration, so the wall's last column
    /// continues over it.
    pub fn new(pictures: &[ColorImage], shifts_px: &[(f32, f32)], wall_right: usize) -> Self {
        let mut lights: Vec<Light> = pictures.iter().map(Light::from_picture).collect();
        for light in &mut lights {
            light.continue_from(wall_right);
        }
        let size = lights.first().map_or((1, 1), |light| (light.width, light.height));
        let padded = |length: usize| (length + 2 * MARGIN_PX).next_multiple_of(SIDE_STEP);
        let fourier = Fourier::new(padded(size.0), padded(size.1));
        let values = lights.iter().flat_map(|light| &light.values);
        let count = (lights.len() * size.0 * size.1).max(1);
        let average = (values.map(|&value| f64::from(value)).sum::<f64>() / count as f64) as f32;
        let mut spectrum = vec![Complex32::default(); fourier.width * fourier.height];
        for (light, &(x_px, y_px)) in lights.iter().zip(shifts_px) {
            let plane = pad(light, &fourier, |value| Complex32::new(value - average, 0.0));
            let back = fourier.map_frequencies(|fx, fy| Complex32::cis(TAU * (fx * x_px + fy * y_px)));
            let of_this = fourier.transform(plane);
            let scale = 1.0 / lights.len() as f32;
            spectrum.iter_mut().zip(of_this).zip(back).for_each(|((sum, value), back)| *sum += value * back * scale);
        }
        Self { size, fourier, spectrum, average }
    }

    /// Returns the mean picture itself, before any attack.
    pub fn light(&self) -> Light {
        self.cut(&self.fourier.invert(self.spectrum.clone()), |value| value.re + self.average)
    }

    /// Cuts a picture out of a plane with margins.
    pub(super) fn cut(&self, plane: &[Complex32], of: impl Fn(Complex32) -> f32) -> Light {
        let (width, height) = self.size;
        let rows = plane.chunks_exact(self.fourier.width).skip(MARGIN_PX).take(height);
        let values = rows.flat_map(|row| &row[MARGIN_PX..MARGIN_PX + width]).map(|&value| of(value)).collect();
        Light { width, height, values }
    }

    /// Returns the mean with its margins.
    pub(super) fn padded_light(&self) -> Vec<f32> {
        let plane = self.fourier.invert(self.spectrum.clone());
        plane.into_iter().map(|value| value.re + self.average).collect()
    }
}

/// Returns a plane with the picture in it, whose border is repeated outside.
fn pad(light: &Light, fourier: &Fourier, of: impl Fn(f32) -> Complex32) -> Vec<Complex32> {
    let inside = |k: usize, length: usize| k.saturating_sub(MARGIN_PX).min(length - 1);
    let rows = (0..fourier.height).map(|y| inside(y, light.height) * light.width);
    rows.flat_map(|start| (0..fourier.width).map(move |x| start + inside(x, light.width)))
        .map(|at| of(light.values[at]))
        .collect()
}
