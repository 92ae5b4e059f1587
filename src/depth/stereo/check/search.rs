//! Detects distinctive points in a picture, and finds them in another picture.

use pulp::{Simd, WithSimd};

use crate::frame::GrayImage;
use crate::frame::scale::halve_rows;

/// Search range in rows, up and down, at half resolution.
const SEARCH_ROWS: i32 = 12;
/// Side of the squares of which each yields one point, in pixels at half resolution.
const CELL: usize = 16;
/// Side of the compared windows at half resolution.
const COARSE_WINDOW: usize = 8;
/// Side of the compared windows at full resolution.
const FINE_WINDOW: usize = 13;
/// Search radius around the match of half resolution, in pixels at full resolution.
const FINE_RADIUS: i32 = 2;
/// Radius of the window in which a point's gradients are summed.
const CORNER_RADIUS: usize = 2;
/// Minimum corner strength, per pixel: the smaller eigenvalue of the structure tensor.
const MIN_CORNER_STRENGTH: f32 = 16.0;
/// Minimum correlation of a match.
const MIN_SCORE: f32 = 0.8;
/// Ratio test (Lowe 2004): one minus the correlation of a unique match is at most this fraction of the second best's.
const UNIQUENESS_RATIO: f32 = 0.6;
/// Places this near to the best one belong to its peak, in pixels at half resolution.
const PEAK_RADIUS: i32 = 3;

/// Returns a picture with half as many columns and rows, averaged.
pub(super) fn halve_picture(image: &GrayImage) -> GrayImage {
    let (width, height, stride) = (image.width / 2, image.height / 2, image.width as usize);
    let mut luma = vec![0; width as usize * height as usize];
    let rows = image.luma.chunks_exact(2 * stride.max(1)).map(|rows| rows.split_at(stride));
    for (half, (upper, lower)) in luma.chunks_exact_mut(width.max(1) as usize).zip(rows) {
        halve_rows(upper, lower, half);
    }
    GrayImage { width, height, luma }
}

/// Returns the strongest corner of each cell above the minimum strength, away from the border.
pub(super) fn find_corners(image: &GrayImage) -> Vec<(i32, i32)> {
    let (width, height) = (image.width as usize, image.height as usize);
    let value = |x: usize, y: usize| f32::from(image.luma[y * width + x]);
    // The smaller eigenvalue of the structure tensor, which sums the products of the gradients (Shi and Tomasi).
    let strength_at = |x: usize, y: usize| {
        let (mut across, mut down, mut both) = (0.0, 0.0, 0.0);
        for y in y - CORNER_RADIUS..=y + CORNER_RADIUS {
            for x in x - CORNER_RADIUS..=x + CORNER_RADIUS {
                let (gx, gy) = (value(x + 1, y) - value(x - 1, y), value(x, y + 1) - value(x, y - 1));
                (across, down, both) = (across + gx * gx, down + gy * gy, both + gx * gy);
            }
        }
        // The factor 4 is there because differences span two pixels.
        let half: f32 = (across - down) / 2.0;
        let pixels = ((2 * CORNER_RADIUS + 1) * (2 * CORNER_RADIUS + 1) * 4) as f32;
        ((across + down) / 2.0 - half.hypot(both)) / pixels
    };
    // Keeps the compared windows and those of the gradients inside.
    let border = COARSE_WINDOW;
    let mut found = Vec::new();
    for top in (border..height.saturating_sub(border)).step_by(CELL) {
        for first in (border..width.saturating_sub(border)).step_by(CELL) {
            let mut best = (MIN_CORNER_STRENGTH, 0, 0);
            for y in top..(top + CELL).min(height - border) {
                for x in (first..(first + CELL).min(width - border)).step_by(2) {
                    let strength = strength_at(x, y);
                    if strength > best.0 {
                        best = (strength, x, y);
                    }
                }
            }
            if best.0 > MIN_CORNER_STRENGTH {
                found.push((best.1 as i32, best.2 as i32));
            }
        }
    }
    found
}

/// A picture at half resolution, prepared for searching.
pub(super) struct SearchPicture {
    width: usize,
    height: usize,
    values: Vec<f32>,
    /// For the window that begins at each pixel, 1 over the root of its squared deviations; 0 without texture.
    inverse_norm: Vec<f32>,
    /// Largest disparity, either way.
    max_disparity: i32,
}

impl SearchPicture {
    /// Prepares a picture at half resolution; `max_disparity` is the largest disparity there.
    pub fn new(image: &GrayImage, max_disparity: i32) -> Self {
        let (width, height) = (image.width as usize, image.height as usize);
        let values: Vec<f32> = image.luma.iter().map(|&luma| f32::from(luma)).collect();
        let mut inverse_norm = vec![0.0; values.len()];
        for y in 0..(height + 1).saturating_sub(COARSE_WINDOW) {
            for x in 0..(width + 1).saturating_sub(COARSE_WINDOW) {
                let (mut sum, mut squares) = (0.0, 0.0);
                for row in 0..COARSE_WINDOW {
                    for value in &values[(y + row) * width + x..][..COARSE_WINDOW] {
                        (sum, squares) = (sum + value, squares + value * value);
                    }
                }
                let variance = squares - sum * sum / (COARSE_WINDOW * COARSE_WINDOW) as f32;
                // Variations below one level per pixel are only noise.
                let is_textured = variance > (COARSE_WINDOW * COARSE_WINDOW) as f32;
                inverse_norm[y * width + x] = if is_textured { variance.sqrt().recip() } else { 0.0 };
            }
        }
        Self { width, height, values, inverse_norm, max_disparity }
    }
}

/// Finds the point `at` of the picture `from` in the picture `into`, at half resolution, by normalised
/// cross-correlation. Outputs its displacement across and down; `None` without a good and unique match.
pub(super) struct MatchSearch<'a> {
    pub from: &'a GrayImage,
    pub into: &'a SearchPicture,
    pub at: (i32, i32),
    /// Buffer for the scores of all places.
    pub scores: &'a mut Vec<f32>,
}

impl WithSimd for MatchSearch<'_> {
    type Output = Option<(i32, i32)>;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<(i32, i32)> {
        let &SearchPicture { width, height, max_disparity, .. } = self.into;
        // Windows are identified by their upper left pixel.
        let (x, y) = (self.at.0 - COARSE_WINDOW as i32 / 2, self.at.1 - COARSE_WINDOW as i32 / 2);
        let mut patch = [0.0_f32; COARSE_WINDOW * COARSE_WINDOW];
        for (row, patch) in patch.chunks_exact_mut(COARSE_WINDOW).enumerate() {
            let from = &self.from.luma[(y as usize + row) * width + x as usize..][..COARSE_WINDOW];
            patch.iter_mut().zip(from).for_each(|(patch, &luma)| *patch = f32::from(luma));
        }
        let mean = patch.iter().sum::<f32>() / patch.len() as f32;
        // Zero mean: the mean of the compared window then cancels out.
        patch.iter_mut().for_each(|value| *value -= mean);
        let norm = patch.iter().map(|value| value * value).sum::<f32>().sqrt();
        if norm == 0.0 {
            return None;
        }
        let first_x = (x - max_disparity).max(0);
        let places = ((x + max_disparity).min((width - COARSE_WINDOW) as i32) - first_x + 1) as usize;
        let rows = (y - SEARCH_ROWS).max(0)..(y + SEARCH_ROWS).min((height - COARSE_WINDOW) as i32) + 1;
        self.scores.clear();
        self.scores.resize(places * rows.len(), 0.0);
        for (scores, top) in self.scores.chunks_exact_mut(places).zip(rows.clone()) {
            for (row, weights) in patch.chunks_exact(COARSE_WINDOW).enumerate() {
                let start = (top as usize + row) * width + first_x as usize;
                for (column, &weight) in weights.iter().enumerate() {
                    let values = &self.into.values[start + column..][..places];
                    for (score, &value) in scores.iter_mut().zip(values) {
                        *score += weight * value;
                    }
                }
            }
            let inverse_norms = &self.into.inverse_norm[top as usize * width + first_x as usize..][..places];
            for (score, &inverse_norm) in scores.iter_mut().zip(inverse_norms) {
                *score *= inverse_norm / norm;
            }
        }
        let displacement_of = |k: usize| (first_x + (k % places) as i32 - x, rows.start + (k / places) as i32 - y);
        let (mut best, mut score) = (0, 0.0);
        for (k, &other) in self.scores.iter().enumerate() {
            if other > score {
                (best, score) = (k, other);
            }
        }
        let (dx, dy) = displacement_of(best);
        let is_elsewhere = |k: usize| {
            let (other_dx, other_dy) = displacement_of(k);
            (other_dx - dx).abs() > PEAK_RADIUS || (other_dy - dy).abs() > PEAK_RADIUS
        };
        // A higher score elsewhere would make the match ambiguous.
        let rival = 1.0 - (1.0 - score) / UNIQUENESS_RATIO;
        let is_unique = !self.scores.iter().enumerate().any(|(k, &other)| other > rival && is_elsewhere(k));
        (score > MIN_SCORE && is_unique).then_some((dx, dy))
    }
}

/// Refines the displacement (across, down) of the point `at`, about `moved`, at full resolution with subpixel accuracy;
/// `None` without a peak.
pub(super) fn refine_subpixel(
    left: &GrayImage,
    right: &GrayImage,
    at: (i32, i32),
    moved: (i32, i32),
) -> Option<(f32, f32)> {
    const SIDE: usize = (2 * FINE_RADIUS + 1) as usize;
    let patch = normalized_window(left, at)?;
    let mut scores = [[0.0; SIDE]; SIDE];
    let (mut score, mut peak) = (MIN_SCORE, None);
    for (dy, scores) in (-FINE_RADIUS..).zip(&mut scores) {
        for (dx, place) in (-FINE_RADIUS..).zip(scores) {
            let other = normalized_window(right, (at.0 + moved.0 + dx, at.1 + moved.1 + dy))?;
            *place = patch.iter().zip(&other).map(|(a, b)| a * b).sum::<f32>();
            if *place > score {
                (score, peak) = (*place, Some((dx, dy)));
            }
        }
    }
    // At the rim of the search square the peak may lie beyond, and the parabola lacks a score.
    let (dx, dy) = peak.filter(|(dx, dy)| dx.abs() < FINE_RADIUS && dy.abs() < FINE_RADIUS)?;
    let (column, row) = ((dx + FINE_RADIUS) as usize, (dy + FINE_RADIUS) as usize);
    // Vertex of the parabola through three scores.
    let top = |before: f32, after: f32| {
        let bend = before - 2.0 * score + after;
        if bend < 0.0 { (before - after) / (2.0 * bend) } else { 0.0 }
    };
    let across = top(scores[row][column - 1], scores[row][column + 1]);
    let down = top(scores[row - 1][column], scores[row + 1][column]);
    Some(((moved.0 + dx) as f32 + across, (moved.1 + dy) as f32 + down))
}

/// Returns the window around a pixel, scaled to mean 0 and norm 1; `None` if it leaves the picture or has no texture.
fn normalized_window(image: &GrayImage, (x, y): (i32, i32)) -> Option<[f32; FINE_WINDOW * FINE_WINDOW]> {
    let (x, y) = (x - FINE_WINDOW as i32 / 2, y - FINE_WINDOW as i32 / 2);
    let is_inside = x >= 0
        && y >= 0
        && x + FINE_WINDOW as i32 <= image.width as i32
        && y + FINE_WINDOW as i32 <= image.height as i32;
    let mut values = [0.0; FINE_WINDOW * FINE_WINDOW];
    if !is_inside {
        return None;
    }
    for (row, values) in values.chunks_exact_mut(FINE_WINDOW).enumerate() {
        let from = &image.luma[(y as usize + row) * image.width as usize + x as usize..][..FINE_WINDOW];
        values.iter_mut().zip(from).for_each(|(value, &luma)| *value = f32::from(luma));
    }
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    values.iter_mut().for_each(|value| *value -= mean);
    let norm = values.iter().map(|value| value * value).sum::<f32>().sqrt();
    values.iter_mut().for_each(|value| *value /= norm);
    (norm > 0.0).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a grid whose every other two rows and two columns are brighter by `step`.
    fn squares(step: u8) -> GrayImage {
        let brighter = |at: usize| if at % 4 / 2 == 1 { step } else { 0 };
        let luma = (0..48 * 48).map(|at| 100 + brighter(at % 48) + brighter(at / 48)).collect();
        GrayImage { width: 48, height: 48, luma }
    }

    #[test]
    fn a_point_is_distinctive_from_the_stated_gradient_on() {
        // Gradients of half a step across and down at each pixel; over 5x5 of them, the smaller eigenvalue is 0.24
        // step^2.
        assert!(find_corners(&squares(8)).is_empty(), "15.4 is less than 16");
        assert_eq!(find_corners(&squares(9)).len(), 4, "one of each cell away from the border");
    }
}
