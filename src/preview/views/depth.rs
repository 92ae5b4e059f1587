//! Depth in colours, even in dioptres (1/m): as the blur goes with them, and as eyes judge distance.

use super::Legend;
use super::colors::{ENTRIES, perceptual};
use super::sample::depth_row;
use crate::frame::{ColorImage, DepthMap};

/// Cells of the histogram over dioptres, and where its last one ends: 0.1 m.
const CELLS: usize = 512;
const NEAREST: f32 = 10.0;
/// About as many samples are taken across a frame.
const SAMPLES_ACROSS: usize = 160;
/// This share of the pixels may lie beyond either end of the colours.
const BEYOND: f32 = 0.01;
/// The ends cover this share of their way in a frame.
const EASE: f32 = 0.12;
/// Unknown depth: dots on grey, like nothing among the colours.
const UNKNOWN: [[u8; 3]; 2] = [[96, 96, 96], [150, 150, 150]];

/// The range of the colours, in dioptres, eased from frame to frame.
#[derive(Default)]
pub struct Range(Option<[f32; 2]>);

/// Where a depth lies in the colours: 0 at `far_m`, 1 at `near_m`, and beyond these if it is.
pub fn share_of(depth_m: f32, near_m: f32, far_m: f32) -> f32 {
    let (near, far) = (1.0 / near_m, 1.0 / far_m);
    (1.0 / depth_m - far) / (near - far)
}

/// Draws a depth map.
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
    /// The range for this map: near its own, and near that of the map before.
    fn follow(&mut self, depth: &DepthMap) -> [f32; 2] {
        let Some(target) = ends(depth) else { return self.0.unwrap_or([0.2, 1.0]) };
        let range = self.0.get_or_insert(target);
        for (end, target) in range.iter_mut().zip(target) {
            *end += (target - *end) * EASE;
        }
        *range
    }
}

/// Dioptres that all but a few pixels lie between; at least a little apart. `None` where no depth is known.
fn ends(depth: &DepthMap) -> Option<[f32; 2]> {
    let mut cells = [0u32; CELLS];
    let step = (depth.width as usize / SAMPLES_ACROSS).max(1);
    let mut known = 0;
    for row in depth.metres.chunks_exact((depth.width as usize).max(1)).step_by(step) {
        for &metres in row.iter().step_by(step).filter(|&&metres| DepthMap::is_known(metres)) {
            let cell = (1.0 / metres * (CELLS as f32 / NEAREST)) as usize;
            cells[cell.min(CELLS - 1)] += 1;
            known += 1;
        }
    }
    if known == 0 {
        return None;
    }
    let beyond = (BEYOND * known as f32) as u32;
    let cell = NEAREST / CELLS as f32;
    let far = passes(cells.iter(), beyond) as f32 * cell;
    let near = (CELLS - passes(cells.iter().rev(), beyond)) as f32 * cell;
    Some([far.max(cell / 2.0), near.max(far + 4.0 * cell)])
}

/// How many cells lie before the one in which more than `beyond` have been counted.
fn passes<'a>(cells: impl Iterator<Item = &'a u32>, beyond: u32) -> usize {
    let mut seen = 0;
    cells
        .take_while(|&&count| {
            seen += count;
            seen <= beyond
        })
        .count()
}
