//! Hierarchical block matching on luma pyramids (minimum sum of absolute differences).

use crate::depth::reduced::block_px;
use crate::frame::ColorImage;
use crate::frame::scale::halve_rows;

use super::Vector;

/// Side of a cell in pixels of each level; the compared window is twice as large, around the cell.
pub const CELL: usize = 4;
const WINDOW: usize = 2 * CELL;
/// Pyramid levels, each half the size of the previous one.
const LEVELS: usize = 3;
/// Search radius on the coarsest level, in pixels.
const SEARCH_RADIUS_PX: i32 = 4;
/// Advantage of the zero vector: any other one has to be better by one code per pixel.
const ZERO_VECTOR_BONUS: u32 = (WINDOW * WINDOW) as u32;

/// A pyramid level: luma, and the cells' motion.
#[derive(Debug, Default)]
struct Level {
    width: usize,
    height: usize,
    luma: Vec<u8>,
    /// Motion vector per cell.
    vectors: Vec<Vector>,
}

/// Estimates the motion of the blocks of a picture.
#[derive(Debug, Default)]
pub struct BlockMatcher {
    then: [Level; LEVELS],
    now: [Level; LEVELS],
    /// Column sums of a row of blocks.
    sums: Vec<u16>,
}

impl BlockMatcher {
    /// Sets the reference picture.
    #[inline(always)]
    pub fn set_reference(&mut self, color: &ColorImage) {
        build_pyramid(color, &mut self.then, &mut self.sums);
    }

    /// Finds the motion of the reference picture's blocks to a later one; on the finest level, skips cells at rest.
    #[inline(always)]
    pub fn match_blocks(&mut self, color: &ColorImage, is_at_rest: impl Fn((usize, usize)) -> bool) {
        build_pyramid(color, &mut self.now, &mut self.sums);
        for level in (0..LEVELS).rev() {
            let (finer, coarser) = self.then.split_at_mut(level + 1);
            let (then, now) = (&mut finer[level], &self.now[level]);
            let (across, down) = then.cell_counts();
            then.vectors.clear();
            for row in 0..down {
                for column in 0..across {
                    if level == 0 && is_at_rest((column, row)) {
                        then.vectors.push([0; 2]);
                        continue;
                    }
                    let at = [column, row].map(|cell| (cell * CELL) as i32 - (CELL / 2) as i32);
                    let at =
                        [at[0].clamp(0, (then.width - WINDOW) as i32), at[1].clamp(0, (then.height - WINDOW) as i32)];
                    let mut best = BestMatch { then, now, at, vector: [0; 2], sad: 0 };
                    best.sad = best.sad_at([0; 2]).unwrap_or(0).saturating_sub(ZERO_VECTOR_BONUS);
                    match coarser.first() {
                        None => best.search_full_range(),
                        Some(coarser) => best.search_around_coarser(coarser, [column, row]),
                    }
                    let vector = best.vector;
                    then.vectors.push(vector);
                }
            }
        }
    }

    /// Returns a cell's motion, in pixels of the finest level.
    #[inline(always)]
    pub fn cell_vector(&self, (column, row): (usize, usize)) -> Vector {
        let (across, down) = self.then[0].cell_counts();
        self.then[0].vectors[row.min(down - 1) * across + column.min(across - 1)]
    }
}

impl Level {
    fn cell_counts(&self) -> (usize, usize) {
        (self.width.div_ceil(CELL), self.height.div_ceil(CELL))
    }
}

/// The best match of a block so far.
struct BestMatch<'a> {
    then: &'a Level,
    now: &'a Level,
    at: Vector,
    vector: Vector,
    sad: u32,
}

impl BestMatch<'_> {
    #[inline(always)]
    fn search_full_range(&mut self) {
        for y in -SEARCH_RADIUS_PX..=SEARCH_RADIUS_PX {
            (-SEARCH_RADIUS_PX..=SEARCH_RADIUS_PX).for_each(|x| self.try_vector([x, y]));
        }
    }

    /// Tests the vectors of the coarser level's cells around, then the neighbours of the best one.
    #[inline(always)]
    fn search_around_coarser(&mut self, coarser: &Level, [column, row]: [usize; 2]) {
        let (across, down) = coarser.cell_counts();
        let mut last = [0; 2];
        for [x, y] in [[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1]] {
            let place = |cell: usize, by: i32, count: usize| (cell as i32 / 2 + by).clamp(0, count as i32 - 1) as usize;
            let vector = coarser.vectors[place(row, y, down) * across + place(column, x, across)].map(|px| 2 * px);
            if vector != last {
                self.try_vector(vector);
                last = vector;
            }
        }
        let [x, y] = self.vector;
        for by in [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]] {
            self.try_vector([x + by[0], y + by[1]]);
        }
    }

    #[inline(always)]
    fn try_vector(&mut self, vector: Vector) {
        if let Some(sad) = self.sad_at(vector).filter(|&sad| sad < self.sad) {
            (self.vector, self.sad) = (vector, sad);
        }
    }

    /// Returns the sum of absolute differences; `None` if the window leaves the picture.
    #[inline(always)]
    fn sad_at(&self, vector: Vector) -> Option<u32> {
        let (width, height) = (self.now.width, self.now.height);
        let [x, y] = [self.at[0] + vector[0], self.at[1] + vector[1]];
        if x < 0 || y < 0 || x as usize + WINDOW > width || y as usize + WINDOW > height {
            return None;
        }
        let then = &self.then.luma[self.at[1] as usize * width + self.at[0] as usize..];
        let now = &self.now.luma[y as usize * width + x as usize..];
        let rows = then.chunks(width).zip(now.chunks(width)).take(WINDOW);
        Some(rows.fold(0, |sum, (then, now)| {
            let pairs = then[..WINDOW].iter().zip(&now[..WINDOW]);
            sum + pairs.fold(0, |sum, (then, now)| sum + u32::from(then.abs_diff(*now)))
        }))
    }
}

/// Builds the pyramid: the mean luma of blocks, then repeated halving.
#[inline(always)]
fn build_pyramid(color: &ColorImage, levels: &mut [Level; LEVELS], sums: &mut Vec<u16>) {
    let (block, width) = (block_px(color.width), color.width as usize);
    let [finest, ..] = levels;
    (finest.width, finest.height) = (width / block, color.height as usize / block);
    finest.luma.resize(finest.width * finest.height, 0);
    sums.resize(3 * width, 0);
    // Luma is (r + 2g + b) / 4.
    let scale = 65536 / (4 * block * block) as u32;
    for (row, luma) in finest.luma.chunks_exact_mut(finest.width).enumerate() {
        sums.fill(0);
        for line in color.rgb[3 * width * block * row..].chunks_exact(3 * width).take(block) {
            sums.iter_mut().zip(line).for_each(|(sum, &code)| *sum += u16::from(code));
        }
        for (luma, block) in luma.iter_mut().zip(sums.chunks_exact(3 * block)) {
            let sum: u32 =
                block.as_chunks::<3>().0.iter().map(|&[r, g, b]| u32::from(r) + 2 * u32::from(g) + u32::from(b)).sum();
            *luma = ((sum * scale) >> 16) as u8;
        }
    }
    for level in 1..LEVELS {
        let (finer, coarser) = levels.split_at_mut(level);
        let (from, to) = (&finer[level - 1], &mut coarser[0]);
        (to.width, to.height) = ((from.width / 2).max(WINDOW), (from.height / 2).max(WINDOW));
        to.luma.resize(to.width * to.height, 0);
        for (row, luma) in to.luma.chunks_exact_mut(to.width).enumerate() {
            let line = |row: usize| &from.luma[row.min(from.height - 1) * from.width..][..from.width];
            halve_rows(line(2 * row), line(2 * row + 1), luma);
        }
    }
}
