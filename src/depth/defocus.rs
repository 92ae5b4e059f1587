//! Depth from defocus of a single photograph: what a lens with a large sensor has blurred a little can be blurred more.
//!
//! At an edge, the ratio of the gradient to that of the picture re-blurred by a known Gaussian gives the edge's blur
//! (Zhuo and Sim, "Defocus map estimation from a single image", 2011, equation 5). Between edges, the sparse blur map
//! is propagated along similar colours by the recursive domain transform filter (Gastal and Oliveira, "Domain transform
//! for edge-aware image and video processing", 2011). One picture does not show on which side of the focal plane a
//! surface lies, so all blur counts as behind it.

use crate::frame::{ColorImage, DepthMap, compute_luma};

/// Standard deviation of the Gaussian for the re-blur, and of the one that denoises gradients, in pixels of a picture
/// of [`TARGET_WIDTH`] columns.
const REBLUR_PX: f32 = 1.0;
const DENOISE_PX: f32 = 0.8;
/// Approximate number of columns in which pictures are analysed: at this size, blurred edges span few pixels.
const TARGET_WIDTH: usize = 1024;
/// Minimum gradient of an edge, in codes per pixel.
const MIN_GRADIENT: f32 = 4.0;
/// Maximum blur of an edge, as a standard deviation: beyond it, an edge cannot be told from a gradient of light.
const MAX_BLUR_PX: f32 = 4.0;
/// Spatial and colour standard deviations of the domain transform filter, in pixels and codes, and its iterations.
const SPATIAL_SIGMA_PX: f32 = 220.0;
const COLOR_SIGMA_CODES: f32 = 40.0;
const ITERATIONS: u32 = 4;
/// Side of the squares whose median edge blurs are compared, in pixels, and the minimum number of edges in a square.
const SQUARE_PX: usize = 48;
const MIN_EDGES: usize = 24;
/// Quantiles of the squares' median blurs that count as in focus and as fully out of focus.
const SHARP_QUANTILE: f32 = 0.2;
const SOFT_QUANTILE: f32 = 0.9;
/// A photograph whose blur varies by less than this between squares, in pixels, is sharp all over: textures alone
/// differ by up to a pixel.
const MIN_RANGE_PX: f32 = 1.2;

/// Estimates the relative depth of a photograph, at its size: the sharpest parts are the subject, at
/// [`DepthMap::SUBJECT_M`], the most blurred ones practically infinitely far. Returns `None` if there are hardly any
/// edges, or all are equally sharp.
pub fn estimate_depth(color: &ColorImage) -> Option<DepthMap> {
    let factor = (color.width as usize / TARGET_WIDTH).max(1);
    let small = downscale(color, factor);
    let size = (small.width as usize, small.height as usize);
    let edges = estimate_edge_blur(&small);
    let squares = compute_median_blurs(&edges, size);
    let at = |quantile: f32| squares.get((squares.len().saturating_sub(1) as f32 * quantile) as usize).copied();
    let (sharp_px, soft_px) = (at(SHARP_QUANTILE)?, at(SOFT_QUANTILE)?);
    if soft_px < sharp_px + MIN_RANGE_PX {
        return None;
    }
    let blur_px = propagate_blur(color, &edges, size, factor);
    let mut map = DepthMap { subject_m: Some(DepthMap::SUBJECT_M), ..DepthMap::new(color.width, color.height) };
    for (metres, blur_px) in map.metres.iter_mut().zip(blur_px) {
        let nearness = 1.0 - ((blur_px - sharp_px) / (soft_px - sharp_px)).clamp(0.0, 1.0);
        *metres = DepthMap::relative_to_metres(nearness);
    }
    Some(map)
}

/// Downscales by the mean of squares of `factor` x `factor` pixels; a rest at the right and the bottom is cropped.
fn downscale(color: &ColorImage, factor: usize) -> ColorImage {
    let (width, height) = ((color.width as usize / factor).max(1), (color.height as usize / factor).max(1));
    let mut small = ColorImage::new(width as u32, height as u32);
    for (at, code) in small.rgb.iter_mut().enumerate() {
        let (x, y, p) = (at / 3 % width, at / 3 / width, at % 3);
        let sum: usize = (0..factor * factor)
            .map(|k| {
                usize::from(
                    color.rgb[3 * ((y * factor + k / factor) * color.width as usize + x * factor + k % factor) + p],
                )
            })
            .sum();
        *code = (sum / (factor * factor)) as u8;
    }
    small
}

/// Estimates the blur of each edge pixel, as a standard deviation in pixels; NaN elsewhere.
fn estimate_edge_blur(color: &ColorImage) -> Vec<f32> {
    let (width, height) = (color.width as usize, color.height as usize);
    let mut codes = vec![0; width * height];
    compute_luma(&color.rgb, &mut codes);
    let luma: Vec<f32> = codes.iter().map(|&code| f32::from(code)).collect();
    let denoised = gaussian_blur(&luma, (width, height), DENOISE_PX);
    let reblurred = gaussian_blur(&luma, (width, height), DENOISE_PX.hypot(REBLUR_PX));
    let mut blur_px = vec![f32::NAN; width * height];
    for y in 1..height.max(1) - 1 {
        for x in 1..width.max(1) - 1 {
            let at = y * width + x;
            let gradient = |plane: &[f32], at: usize| {
                [0.5 * (plane[at + 1] - plane[at - 1]), 0.5 * (plane[at + width] - plane[at - width])]
            };
            let [across, down] = gradient(&denoised, at);
            let magnitude = across.hypot(down);
            if magnitude < MIN_GRADIENT {
                continue;
            }
            // Non-maximum suppression: the ratio only holds where the gradient is largest across the edge.
            let (dx, dy) = ((across / magnitude).round() as isize, (down / magnitude).round() as isize);
            let beside = |way: isize| {
                let (x, y) = (x.saturating_add_signed(way * dx), y.saturating_add_signed(way * dy));
                if (1..width - 1).contains(&x) && (1..height - 1).contains(&y) {
                    let [across, down] = gradient(&denoised, y * width + x);
                    across.hypot(down)
                } else {
                    0.0
                }
            };
            if beside(1) > magnitude || beside(-1) >= magnitude {
                continue;
            }
            let [across, down] = gradient(&reblurred, at);
            let ratio = magnitude / across.hypot(down).max(1e-3);
            let total_px = REBLUR_PX / (ratio * ratio - 1.0).max(1e-3).sqrt();
            // Subtracts the variance of the denoising Gaussian, and that of the central difference over two pixels.
            blur_px[at] = (total_px * total_px - DENOISE_PX * DENOISE_PX - 1.0 / 3.0).max(0.0).sqrt().min(MAX_BLUR_PX);
        }
    }
    blur_px
}

/// Returns the median edge blur of each square with enough edges, ascending.
fn compute_median_blurs(edges: &[f32], (width, height): (usize, usize)) -> Vec<f32> {
    let (across, down) = (width.div_ceil(SQUARE_PX), height.div_ceil(SQUARE_PX));
    let mut squares = vec![Vec::new(); across * down];
    for (at, &blur_px) in edges.iter().enumerate().filter(|(_, blur_px)| blur_px.is_finite()) {
        squares[at / width / SQUARE_PX * across + at % width / SQUARE_PX].push(blur_px);
    }
    let many = squares.iter_mut().filter(|square| square.len() >= MIN_EDGES);
    let mut medians: Vec<f32> = many
        .map(|square| {
            let middle = square.len() / 2;
            *square.select_nth_unstable_by(middle, f32::total_cmp).1
        })
        .collect();
    medians.sort_unstable_by(f32::total_cmp);
    medians
}

/// Applies a separable Gaussian blur; the border is replicated.
fn gaussian_blur(plane: &[f32], (width, height): (usize, usize), deviation_px: f32) -> Vec<f32> {
    let radius = (3.0 * deviation_px).ceil() as isize;
    let weight = |k: isize| (-0.5 * (k as f32 / deviation_px).powi(2)).exp();
    let all: f32 = (-radius..=radius).map(weight).sum();
    let line = |from: &[f32], step: usize, count: usize, start: usize, k: usize| -> f32 {
        let at = |off: isize| from[start + step * k.saturating_add_signed(off).min(count - 1)];
        (-radius..=radius).map(|off| weight(off) * at(off)).sum::<f32>() / all
    };
    let rows: Vec<f32> = (0..width * height).map(|at| line(plane, 1, width, at - at % width, at % width)).collect();
    (0..width * height).map(|at| line(&rows, width, height, at % width, at / width)).collect()
}

/// Propagates the known blur values along similar colours (domain transform, recursive filter). `known` belongs to a
/// picture of `size` pixels, each of which covers `factor` x `factor` pixels of `color`. Values and weights are
/// filtered alike (normalised convolution).
fn propagate_blur(color: &ColorImage, known: &[f32], size: (usize, usize), factor: usize) -> Vec<f32> {
    let (width, height) = (color.width as usize, color.height as usize);
    let mut sums = vec![[0.0; 2]; width * height];
    for (at, &blur_px) in known.iter().enumerate().filter(|(_, blur_px)| blur_px.is_finite()) {
        let (x, y) = (at % size.0 * factor + factor / 2, at / size.0 * factor + factor / 2);
        sums[y * width + x] = [blur_px, 1.0];
    }
    // The distance of neighbouring pixels in the transformed domain: one pixel plus the scaled colour difference.
    let sigma_px = SPATIAL_SIGMA_PX * factor as f32;
    let colors = |a: usize, b: usize| -> usize {
        (0..3).map(|p| usize::from(color.rgb[3 * a + p].abs_diff(color.rgb[3 * b + p]))).sum()
    };
    // Each iteration halves the filter's standard deviation: rows, then columns, in both directions.
    for round in 0..ITERATIONS {
        let scale =
            3f32.sqrt() * 2f32.powi((ITERATIONS - round - 1) as i32) / (4f32.powi(ITERATIONS as i32) - 1.0).sqrt();
        let feedback = (-(2f32.sqrt()) / (sigma_px * scale)).exp();
        let decay: Vec<f32> =
            (0..=765).map(|codes| feedback.powf(1.0 + sigma_px / COLOR_SIGMA_CODES * codes as f32)).collect();
        for (lines, count, step, along) in [(height, width, 1, width), (width, height, width, 1)] {
            for line in 0..lines {
                let at = |k: usize| line * along + k * step;
                let mut pull = |from: usize, to: usize| {
                    let decay = decay[colors(from, to)];
                    (0..2).for_each(|p| sums[to][p] += decay * (sums[from][p] - sums[to][p]));
                };
                (1..count).for_each(|k| pull(at(k - 1), at(k)));
                (1..count).rev().for_each(|k| pull(at(k), at(k - 1)));
            }
        }
    }
    sums.iter().map(|[sum, weight]| if *weight > 0.0 { sum / weight } else { MAX_BLUR_PX }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vertical stripes, brighter in the lower half, blurred by `deviation_px(half)`.
    fn stripes(deviation_px: impl Fn(usize) -> f32) -> ColorImage {
        let (width, height) = (240usize, 160usize);
        let mut picture = ColorImage::new(width as u32, height as u32);
        for (half, [dark, bright]) in [[30.0, 130.0], [130.0, 230.0]].into_iter().enumerate() {
            let hard = |at: usize| if (at % width / 20).is_multiple_of(2) { dark } else { bright };
            let blur_px = gaussian_blur(
                &(0..width * height).map(hard).collect::<Vec<f32>>(),
                (width, height),
                deviation_px(half),
            );
            let rows = half * height / 2 * width..(half + 1) * height / 2 * width;
            for (pixel, blur_px) in picture.rgb.as_chunks_mut::<3>().0[rows.clone()].iter_mut().zip(&blur_px[rows]) {
                pixel.fill(blur_px.round() as u8);
            }
        }
        picture
    }

    #[test]
    fn soft_edges_are_measured() {
        for deviation_px in [0.6, 1.0, 1.6, 2.4] {
            let edges = estimate_edge_blur(&stripes(|_| deviation_px));
            let known: Vec<f32> = edges.into_iter().filter(|blur_px| blur_px.is_finite()).collect();
            let mean = known.iter().sum::<f32>() / known.len() as f32;
            assert!(
                known.len() > 500 && (mean - deviation_px).abs() < 0.1 * deviation_px + 0.1,
                "{deviation_px}: {mean}"
            );
        }
    }

    #[test]
    fn what_is_soft_is_far_and_what_is_all_sharp_has_no_depth() {
        let map = estimate_depth(&stripes(|half| if half == 0 { 0.5 } else { 2.0 })).unwrap();
        let at = |x: usize, y: usize| map.metres[y * 240 + x];
        assert!(
            at(120, 20) < 1.2 * DepthMap::SUBJECT_M && at(120, 140) > 4.0 * DepthMap::SUBJECT_M,
            "{} {}",
            at(120, 20),
            at(120, 140)
        );
        assert!(estimate_depth(&stripes(|_| 0.5)).is_none() && estimate_depth(&ColorImage::new(64, 48)).is_none());
    }
}
