//! The depth view: colours linear in dioptres (1/m), like the blur and like depth perception.

use super::colors::{COLORMAP_SIZE, VIRIDIS};
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

/// Draws depth maps in the size of their pictures.
#[derive(Default)]
pub struct DepthView {
    image: ColorImage,
    /// Far and near end of the colours in dioptres, smoothed over time; `None` until a depth is known.
    range: Option<[f32; 2]>,
    /// The depth map's column for each column of the image.
    columns: Vec<u32>,
}

impl DepthView {
    /// Draws the depth map of a picture of `size` pixels. Allocates only if the size changes.
    pub fn draw(&mut self, depth: &DepthMap, size: (u32, u32)) -> &ColorImage {
        let [far, near] = self.update_range(depth);
        let Self { image, columns, .. } = self;
        image.resize(size.0, size.1);
        columns.clear();
        columns.extend((0..size.0).map(|x| scale_index(x, size.0, depth.width)));
        let colors = &*VIRIDIS;
        let scale = (COLORMAP_SIZE - 1) as f32 / (near - far);
        let row_bytes = image.width as usize * 3;
        if depth.height > 0 {
            for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
                let from = scale_index(y, size.1, depth.height) as usize * depth.width as usize;
                let depths = &depth.metres[from..][..depth.width as usize];
                for ((x, pixel), &column) in (0u32..).zip(row.as_chunks_mut::<3>().0).zip(&*columns) {
                    let metres = depths[column as usize];
                    *pixel = if DepthMap::is_known(metres) {
                        colors[((1.0 / metres - far) * scale).clamp(0.0, (COLORMAP_SIZE - 1) as f32) as usize]
                    } else {
                        UNKNOWN_COLORS[usize::from((x / 4 + y / 4) % 2 == 0)]
                    };
                }
            }
        }
        image
    }

    /// Returns the image drawn last.
    pub fn image(&self) -> &ColorImage {
        &self.image
    }

    /// Moves the range towards that of this map (exponential moving average); the first map sets it.
    fn update_range(&mut self, depth: &DepthMap) -> [f32; 2] {
        let Some(target) = percentile_range(depth) else { return self.range.unwrap_or(INITIAL_RANGE) };
        let range = self.range.get_or_insert(target);
        for (end, target) in range.iter_mut().zip(target) {
            *end += (target - *end) * SMOOTHING;
        }
        *range
    }
}

/// Scales the index `at` of `from` pixels to an index of `to` pixels.
fn scale_index(at: u32, from: u32, to: u32) -> u32 {
    (u64::from(at) * u64::from(to) / u64::from(from.max(1))) as u32
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
