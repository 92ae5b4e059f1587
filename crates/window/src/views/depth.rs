//! The depth view: colours linear in dioptres (1/m), like the blur and like depth perception.

use super::Legend;
use super::coc_sampler::depth_row;
use super::colors::{COLORMAP_SIZE, viridis};
use bokehcam::frame::{ColorImage, DepthMap};

/// Number of histogram cells over dioptres, up to `NEAREST_DIOPTRES`: 0.1 m.
const HISTOGRAM_CELLS: usize = 512;
const NEAREST_DIOPTRES: f32 = 10.0;
/// Approximate number of depth samples across a frame.
const SAMPLES_ACROSS: usize = 160;
/// Fraction of the pixels that may exceed the colour range at either end.
const OUTLIER_FRACTION: f32 = 0.01;
/// Weight of the new frame in the moving average of the range.
const SMOOTHING: f32 = 0.12;
/// Checkerboard for unknown depth, in two greys that the colour map does not contain.
const UNKNOWN_COLORS: [[u8; 3]; 2] = [[96, 96, 96], [150, 150, 150]];
/// Far and near end in dioptres until a depth is known: 5 m to 1 m.
const INITIAL_RANGE: [f32; 2] = [0.2, 1.0];

/// Colour range: far and near end in dioptres, smoothed over time.
#[derive(Default)]
pub struct ColorRange(Option<[f32; 2]>);

/// Returns the position of a depth in the colour range: 0 at `far_m`, 1 at `near_m`, beyond these for depths outside.
pub fn depth_fraction(depth_m: f32, near_m: f32, far_m: f32) -> f32 {
    let (near, far) = (1.0 / near_m, 1.0 / far_m);
    (1.0 / depth_m - far) / (near - far)
}

/// Draws a depth map; `columns` has the map's column for each column of the image.
pub fn draw(depth: &DepthMap, columns: &[u32], range: &mut ColorRange, image: &mut ColorImage) -> Legend {
    let [far, near] = range.update(depth);
    let colors = viridis();
    let (scale, rows) = ((COLORMAP_SIZE - 1) as f32 / (near - far), image.height);
    let row_bytes = image.width as usize * 3;
    if depth.height > 0 {
        for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
            let depths = depth_row(depth, y, rows);
            for ((x, pixel), &column) in (0u32..).zip(row.as_chunks_mut::<3>().0).zip(columns) {
                let metres = depths[column as usize];
                *pixel = if DepthMap::is_known(metres) {
                    colors[((1.0 / metres - far) * scale).clamp(0.0, (COLORMAP_SIZE - 1) as f32) as usize]
                } else {
                    UNKNOWN_COLORS[usize::from((x / 4 + y / 4) % 2 == 0)]
                };
            }
        }
    }
    Legend::Depth { near_m: 1.0 / near, far_m: 1.0 / far }
}

impl ColorRange {
    /// Moves the range towards that of this map (exponential moving average); the first map sets it.
    fn update(&mut self, depth: &DepthMap) -> [f32; 2] {
        let Some(target) = percentile_range(depth) else { return self.0.unwrap_or(INITIAL_RANGE) };
        let range = self.0.get_or_insert(target);
        for (end, target) in range.iter_mut().zip(target) {
            *end += (target - *end) * SMOOTHING;
        }
        *range
    }
}

/// Returns far and near end in dioptres, the percentiles [`OUTLIER_FRACTION`] and 1 - [`OUTLIER_FRACTION`]. `None` if
/// no depth is known.
fn percentile_range(depth: &DepthMap) -> Option<[f32; 2]> {
    let mut cells = [0u32; HISTOGRAM_CELLS];
    let step = (depth.width as usize / SAMPLES_ACROSS).max(1);
    let mut known = 0;
    for row in depth.metres.chunks_exact((depth.width as usize).max(1)).step_by(step) {
        for &metres in row.iter().step_by(step).filter(|&&metres| DepthMap::is_known(metres)) {
            let cell = (1.0 / metres * (HISTOGRAM_CELLS as f32 / NEAREST_DIOPTRES)) as usize;
            cells[cell.min(HISTOGRAM_CELLS - 1)] += 1;
            known += 1;
        }
    }
    if known == 0 {
        return None;
    }
    let beyond = (OUTLIER_FRACTION * known as f32) as u32;
    let cell_dioptres = NEAREST_DIOPTRES / HISTOGRAM_CELLS as f32;
    let far = quantile_cell(cells.iter(), beyond) as f32 * cell_dioptres;
    let near = (HISTOGRAM_CELLS - quantile_cell(cells.iter().rev(), beyond)) as f32 * cell_dioptres;
    // Keeps the far end finite, and the range wide enough that noise does not span all colours.
    Some([far.max(cell_dioptres / 2.0), near.max(far + 4.0 * cell_dioptres)])
}

/// Returns the number of cells before the one where the cumulative count exceeds `beyond`.
fn quantile_cell<'a>(cells: impl Iterator<Item = &'a u32>, beyond: u32) -> usize {
    let mut seen = 0;
    cells
        .take_while(|&&count| {
            seen += count;
            seen <= beyond
        })
        .count()
}
