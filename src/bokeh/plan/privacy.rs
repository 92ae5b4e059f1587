//! How coarse the content of a bin is kept, so that no filter can undo its blur.

use crate::bokeh::bank::FilterBank;
use crate::bokeh::quality_level::SCALES;

/// Cells that hide text as small as a picture of 540 to 720 rows shows it to a reader, in pixels.
const TEXT_CELL_PX: f32 = 8.0;
/// Side of a cell in radii, at least: about half. A disc lets through finer detail, weakly enough not to be seen, but not
/// to be recovered by an inverse filter.
const CELL_RADII: f32 = 0.44;
/// Largest scale in radii: the pixels of a bin are cells, too.
const SCALE_RADII: f32 = 0.533;
/// How much the colours of cells are sharpened, per neighbour: the two tents, down and up, blur by a third of a cell squared,
/// and this takes as much away. It brings back no detail, as it only weights what the cells hold.
pub const CELL_SHARPNESS: f32 = 1.0 / 6.0;

/// Returns the smallest radius behind the focal plane that hides text from a filter, in pixels of a picture of `height` rows:
/// 8 px at 720.
pub fn min_private_radius_px(height: usize) -> f32 {
    height as f32 / 90.0
}

/// Returns the scale, at least `scale`, of a bin that hides detail in a picture of `height` rows, and the side of the cells,
/// in pixels of the bin, to which its colours are averaged besides (1: they are not). Its content has radii from `low_px` to
/// `high_px`. If all of them hide text, cells are at least as large as the smallest such radius.
pub(super) fn decimate(
    bank: &FilterBank,
    (low_px, high_px): (f32, f32),
    scale: usize,
    height: usize,
) -> (usize, usize) {
    let coarsest_px = if bank.fits_coarse_scales() { SCALE_RADII * low_px } else { 0.0 };
    let coarser = SCALES.into_iter().rev().find(|&coarser| coarser as f32 <= coarsest_px);
    let scale = coarser.map_or(scale, |coarser| coarser.max(scale));
    let min_px = min_private_radius_px(height);
    if high_px < min_px {
        return (scale, 1);
    }
    let floor_px = if low_px < min_px { 0.0 } else { low_px.min(min_px.max(TEXT_CELL_PX)) };
    (scale, (floor_px.max(CELL_RADII * high_px) / scale as f32).ceil() as usize)
}
