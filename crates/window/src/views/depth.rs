//! The depth view: colours linear in dioptres (1/m), as the blur is, and as eyes judge distance.

use super::Legend;
use super::colors::{ENTRIES, perceptual};
use super::sample::depth_row;
use bokehcam::frame::{ColorImage, DepthMap};

/// Cells of the histogram over dioptres, which ends at 10 dioptres: 0.1 m.
const CELLS: usize = 512;
const NEAREST_DIOPTRES: f32 = 10.0;
/// Depth is sampled about this many times across a frame.
const SAMPLES_ACROSS: usize = 160;
/// This share of the pixels may lie beyond either end of the colours.
const BEYOND: f32 = 0.01;
/// The share of the way to their target that the ends move per frame.
const EASE: f32 = 0.12;
/// Unknown depth: a checkerboard in two greys, which the colours do not contain.
const UNKNOWN: [[u8; 3]; 2] = [[96, 96, 96], [150, 150, 150]];
/// The range while no depth was ever known, in dioptres: 5 m to 1 m.
const FIRST_RANGE: [f32; 2] = [0.2, 1.0];

/// The range of the colours, far and near end in dioptres, eased from frame to frame.
#[derive(Default)]
pub struct Range(Option<[f32; 2]>);

/// Position of a depth in the colours: 0 at `far_m`, 1 at `near_m`, below or above for depths outside of these.
pub fn share_of(depth_m: f32, near_m: f32, far_m: f32) -> f32 {
    let (near, far) = (1.0 / near_m, 1.0 / far_m);
    (1.0 / depth_m - far) / (near - far)
}

/// Draws a depth map; `columns` holds the map's column for each of the image's.
pub fn draw(depth: &DepthMap, columns: &[u32], range: &mut Range, image: &mut ColorImage) -> Legend {
    let [far, near] = range.follow(depth);
    let colors = perceptual();
    let (scale, rows) = ((ENTRIES - 1) as f32 / (near - far), image.height);
    let row_bytes = image.width as usize * 3;
    if depth.height > 0 {
        for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
            let depths = depth_row(depth, y, rows);
            for ((x, pixel), &column) in (0u32..).zip(row.as_chunks_mut::<3>().0).zip(columns) {
                let metres = depths[column as usize];
                *pixel = if DepthMap::is_known(metres) {
                    colors[((1.0 / metres - far) * scale).clamp(0.0, (ENTRIES - 1) as f32) as usize]
                } else {
                    UNKNOWN[usize::from((x / 4 + y / 4) % 2 == 0)]
                };
            }
        }
    }
    Legend::Depth { near_m: 1.0 / near, far_m: 1.0 / far }
}

impl Range {
    /// Moves the range a part of the way to that of this map; the first map sets it.
    fn follow(&mut self, depth: &DepthMap) -> [f32; 2] {
        let Some(target) = ends(depth) else { return self.0.unwrap_or(FIRST_RANGE) };
        let range = self.0.get_or_insert(target);
        for (end, target) in range.iter_mut().zip(target) {
            *end += (target - *end) * EASE;
        }
        *range
    }
}

/// Far and near end, in dioptres, of all pixels but a share [`BEYOND`] at either end. `None` if no depth is known.
fn ends(depth: &DepthMap) -> Option<[f32; 2]> {
    let mut cells = [0u32; CELLS];
    let step = (depth.width as usize / SAMPLES_ACROSS).max(1);
    let mut known = 0;
    for row in depth.metres.chunks_exact((depth.width as usize).max(1)).step_by(step) {
        for &metres in row.iter().step_by(step).filter(|&&metres| DepthMap::is_known(metres)) {
            let cell = (1.0 / metres * (CELLS as f32 / NEAREST_DIOPTRES)) as usize;
            cells[cell.min(CELLS - 1)] += 1;
            known += 1;
        }
    }
    if known == 0 {
        return None;
    }
    let beyond = (BEYOND * known as f32) as u32;
    let cell_dioptres = NEAREST_DIOPTRES / CELLS as f32;
    let far = cells_passed(cells.iter(), beyond) as f32 * cell_dioptres;
    let near = (CELLS - cells_passed(cells.iter().rev(), beyond)) as f32 * cell_dioptres;
    // Not at infinity, and not so narrow that noise would fill all the colours.
    Some([far.max(cell_dioptres / 2.0), near.max(far + 4.0 * cell_dioptres)])
}

/// How many cells come before the one where the sum of the counts exceeds `beyond`.
fn cells_passed<'a>(cells: impl Iterator<Item = &'a u32>, beyond: u32) -> usize {
    let mut seen = 0;
    cells
        .take_while(|&&count| {
            seen += count;
            seen <= beyond
        })
        .count()
}
