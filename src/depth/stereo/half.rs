//! Half resolution: downsamples pictures and upsamples disparities.

use crate::frame::GrayImage;
use crate::frame::scale::halve_rows;

/// Returns the columns and rows of a half-size picture, rounded up.
pub fn size((width, height): (usize, usize)) -> (usize, usize) {
    (width.div_ceil(2), height.div_ceil(2))
}

/// Averages 2x2 pixels; a last odd column or row is repeated.
pub fn downsample(from: &GrayImage, into: &mut GrayImage) {
    into.resize(from.width.div_ceil(2), from.height.div_ceil(2));
    let (width, height) = (from.width as usize, from.height as usize);
    for (y, out) in into.luma.chunks_exact_mut(width.div_ceil(2)).enumerate() {
        let upper = &from.luma[2 * y * width..][..width];
        let lower = &from.luma[(2 * y + 1).min(height - 1) * width..][..width];
        halve_rows(upper, lower, out);
        if width % 2 == 1 {
            out[width / 2] = (u16::from(upper[width - 1]) + u16::from(lower[width - 1])).div_ceil(2) as u8;
        }
    }
}

/// Upsamples row `y` of `px`, the disparities of `small`, to the size of `whole`, into `out`. Each pixel takes, of the
/// four nearest small pixels, the disparity of the one closest in brightness, so that edges follow the picture. Values
/// are doubled, because a small pixel is two pixels wide.
pub fn upsample_row(whole: &GrayImage, small: &GrayImage, px: &[f32], y: usize, out: &mut [f32]) {
    let (columns, rows) = (small.width as usize, small.height as usize);
    // The second nearest small row or column is the previous one for even pixels, and the next one for odd ones.
    let near = y / 2;
    let other = if y.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(rows - 1) };
    let row = |y: usize| (&small.luma[y * columns..(y + 1) * columns], &px[y * columns..(y + 1) * columns]);
    let ((near_luma, near_px), (other_luma, other_px)) = (row(near), row(other));
    let luma = &whole.luma[y * out.len()..(y + 1) * out.len()];
    for (x, (out, &luma)) in out.iter_mut().zip(luma).enumerate() {
        let at = x / 2;
        let beside = if x.is_multiple_of(2) { at.saturating_sub(1) } else { (at + 1).min(columns - 1) };
        let mut best_difference = near_luma[at].abs_diff(luma);
        let mut best_px = near_px[at];
        for (place_luma, place_px) in [
            (near_luma[beside], near_px[beside]),
            (other_luma[at], other_px[at]),
            (other_luma[beside], other_px[beside]),
        ] {
            let difference = place_luma.abs_diff(luma);
            best_px = if difference < best_difference { place_px } else { best_px };
            best_difference = best_difference.min(difference);
        }
        *out = 2.0 * best_px;
    }
}
