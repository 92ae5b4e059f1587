//! Metrics against the truth, PSNR and SSIM in sRGB, and the flicker between frames.

use bokehcam::frame::ColorImage;

use super::damage::is_edge;
use super::picture::Plane;

/// Pixels within this distance of a depth edge count as edge.
const EDGE_BAND_PX: i32 = 12;
/// Standard deviation and radius of SSIM's window.
const SSIM_SIGMA: f64 = 1.5;
const SSIM_RADIUS: i32 = 5;
/// CoC radius above which a pixel counts as blurred, in pixels.
const BLURRED_PX: f32 = 2.0;

/// Returns the peak signal-to-noise ratio in dB over the pixels set in `counts`; infinite for equal pictures, NaN for
/// no pixels.
pub fn psnr(a: &ColorImage, b: &ColorImage, counts: Option<&Plane<bool>>) -> f64 {
    let (mut sum, mut values) = (0.0, 0.0);
    for (k, (a, b)) in a.rgb.iter().zip(&b.rgb).enumerate() {
        if counts.is_none_or(|counts| counts.data[k / 3]) {
            sum += (f64::from(*a) - f64::from(*b)).powi(2);
            values += 1.0;
        }
    }
    10.0 * (255.0 * 255.0 / (sum / values)).log10()
}

/// Returns the structural similarity (Wang et al., 2004): Gaussian window of 1.5 px, mean over pixels and channels.
pub fn ssim(a: &ColorImage, b: &ColorImage) -> f64 {
    const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
    const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);
    let (width, height) = (a.width as usize, a.height as usize);
    let mut taps: Vec<f64> =
        (-SSIM_RADIUS..=SSIM_RADIUS).map(|d| (-0.5 * (f64::from(d) / SSIM_SIGMA).powi(2)).exp()).collect();
    let total: f64 = taps.iter().sum();
    taps.iter_mut().for_each(|tap| *tap /= total);
    // Borders are mirrored about the border pixel.
    let mirror = |k: i32, n: usize| {
        let (k, last) = (k.abs(), n as i32 - 1);
        (if k > last { 2 * last - k } else { k }).clamp(0, last)
    };
    let mut sum = 0.0;
    for channel in 0..3 {
        let pick = |image: &ColorImage, x: usize, y: usize| f64::from(image.rgb[(y * width + x) * 3 + channel]);
        let moments = Plane::from_fn(width, height, |x, y| {
            let (a, b) = (pick(a, x, y), pick(b, x, y));
            [a, b, a * a, b * b, a * b]
        });
        let mean = |of: &Plane<[f64; 5]>, dx: i32, dy: i32| {
            Plane::from_fn(width, height, |x, y| {
                let mut sum = [0.0; 5];
                for (tap, d) in taps.iter().zip(-SSIM_RADIUS..) {
                    let at = of.at(mirror(x as i32 + d * dx, width), mirror(y as i32 + d * dy, height));
                    (0..5).for_each(|k| sum[k] += tap * at[k]);
                }
                sum
            })
        };
        for [a, b, aa, bb, ab] in mean(&mean(&moments, 1, 0), 0, 1).data {
            let (var_a, var_b, covariance) = (aa - a * a, bb - b * b, ab - a * b);
            sum += (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (var_a + var_b + C2));
        }
    }
    sum / (3 * width * height) as f64
}

/// Returns the pixels within 12 px (a square) of a step of the CoC by more than a pixel.
pub fn edge_band(coc_px: &Plane<f32>) -> Plane<bool> {
    let (width, height) = (coc_px.width, coc_px.height);
    let grown = |of: &Plane<bool>, dx: i32, dy: i32| {
        Plane::from_fn(width, height, |x, y| {
            (-EDGE_BAND_PX..=EDGE_BAND_PX).any(|d| of.at(x as i32 + d * dx, y as i32 + d * dy))
        })
    };
    let edges = Plane::from_fn(width, height, |x, y| is_edge(coc_px, x as i32, y as i32));
    grown(&grown(&edges, 1, 0), 0, 1)
}

/// Returns whether a pixel is blurred.
pub fn is_blurred(coc_px: &Plane<f32>, at: usize) -> bool {
    coc_px.data[at].abs() > BLURRED_PX
}

/// Returns the mean difference of consecutive frames in code values, over the pixels that count.
pub fn mean_flicker(frames: &[ColorImage], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut values) = (0.0, 0.0);
    for pair in frames.windows(2) {
        for (k, (a, b)) in pair[0].rgb.iter().zip(&pair[1].rgb).enumerate() {
            if counts(k / 3) {
                sum += f64::from(a.abs_diff(*b));
                values += 1.0;
            }
        }
    }
    sum / values
}
