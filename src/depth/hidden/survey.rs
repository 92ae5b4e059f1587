//! The survey: outlines between surfaces, and what each cell surely shows.

use std::ops::Range;

use pulp::WithSimd;

use super::{CELL, CellRows, Frame, Grid, Hiding};
use crate::frame::{DepthMap, Matte, MixedPixel};

/// Relative step of the CoC from which the farther side of two pixels is another surface, behind one in front and behind
/// others, and the smallest such step, in pixels.
pub const FRONT_STEP: f32 = 0.35;
const FAR_STEP: f32 = 0.25;
pub const MIN_STEP_PX: f32 = 1.0;
/// CoC difference up to which pixels show the same surface, in pixels.
pub const SAME_PX: f32 = 1.5;
/// Columns that are looked at together: most have no outline.
const CHUNK: usize = 16;

/// A pixel on the outline of a surface that hides others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Column and row, and those of the pixel beside it that shows the surface behind.
    pub at: (u32, u32),
    pub behind: (u32, u32),
    /// CoC of both, in pixels.
    pub own_px: f32,
    pub behind_px: f32,
}

/// A place on an outline between two surfaces that are not in front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlinePoint {
    /// Position, in pixels, between the centres of two pixels.
    pub at: (f32, f32),
    /// CoC of the nearer and the farther surface, in pixels.
    pub cocs_px: [f32; 2],
    /// Direction towards the nearer one.
    pub nearer: (f32, f32),
}

/// What was found in some rows, in their order, and scratch.
#[derive(Debug, Default)]
pub struct Found {
    pub seeds: Vec<Seed>,
    pub outlines: Vec<OutlinePoint>,
    rows: Rows,
}

impl Found {
    pub fn append(&mut self, other: &Self) {
        self.seeds.extend_from_slice(&other.seeds);
        self.outlines.extend_from_slice(&other.outlines);
    }
}

/// Four rows of pixels, from the one above a row of cells to the one below; the outermost pixels repeat beyond the picture.
/// Index 0 is the pixel left of the first column.
#[derive(Debug, Default)]
struct Rows {
    coc_px: [Vec<f32>; 4],
    /// Step of each pixel to the next one on its right, and below.
    right: [Vec<u8>; 4],
    down: [Vec<u8>; 3],
    /// Whether a pixel of the two middle rows shows two surfaces.
    mixed: [Vec<bool>; 2],
}

/// Steps: [`Rows::right`].
const NONE: u8 = 0;
const FRONT: u8 = 1;
const OUTLINE: u8 = 2;

/// Returns what kind of step is between two pixels with these CoC.
#[inline(always)]
fn step_between(a_px: f32, b_px: f32, hiding: &Hiding) -> u8 {
    let (near_px, far_px) = if a_px < b_px { (a_px, b_px) } else { (b_px, a_px) };
    let is_front = hiding.is_front(near_px);
    let relative = near_px.abs() * if is_front { FRONT_STEP } else { FAR_STEP };
    let is_step = far_px - near_px >= if relative > MIN_STEP_PX { relative } else { MIN_STEP_PX };
    u8::from(is_step) * if is_front { FRONT } else { OUTLINE }
}

/// Surveys some rows of cells.
pub struct Survey<'a> {
    pub frame: Frame<'a>,
    pub grid: &'a Grid,
    pub matte: &'a Matte,
    pub rows: Range<usize>,
    pub cells: CellRows<'a>,
    pub found: &'a mut Found,
}

impl WithSimd for Survey<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        let Grid { size: (width, height), hiding, .. } = *self.grid;
        let Found { seeds, outlines, rows } = &mut *self.found;
        seeds.clear();
        outlines.clear();
        let first = CELL * self.grid.columns.0;
        let columns = first..(CELL * self.grid.columns.1).min(width);
        rows.resize(columns.len());
        let mut scratch = std::mem::take(rows);
        let wanted = self.grid.limit_rows(self.rows.clone());
        let mut mixed = self.matte.pixels_in(CELL * wanted.start * width..(CELL * wanted.end).min(height) * width);
        for y in wanted.clone() {
            let is_first = y == wanted.start;
            scratch.advance(is_first);
            for k in if is_first { 0..4 } else { 2..4 } {
                let row = (CELL * y + k).saturating_sub(1).min(height - 1);
                scratch.read(k, &self.frame, &hiding, row * width + columns.start..row * width + columns.end);
            }
            scratch.find_steps(&hiding);
            scratch.mark_mixed(&mut mixed, CELL * y, width, &columns);
            for x in (0..columns.len()).step_by(CHUNK) {
                let here = x..(x + CHUNK).min(columns.len());
                let is_whole = here.len() == CHUNK && CELL * (y + 1) <= height;
                if is_whole && scratch.is_plain(x, CHUNK) {
                    self.survey_plain_cells::<{ CHUNK / CELL }>(&scratch, x, first, y);
                    continue;
                }
                for x in here.step_by(CELL) {
                    match is_whole && scratch.is_plain(x, CELL) {
                        true => self.survey_plain_cells::<1>(&scratch, x, first, y),
                        false => self.survey_cell(&scratch, x, first, y),
                    }
                }
            }
        }
        self.found.rows = scratch;
    }
}

impl Survey<'_> {
    /// Surveys `N` cells without any outline, from `x` columns after column `first` of the picture on.
    #[inline(always)]
    fn survey_plain_cells<const N: usize>(&mut self, rows: &Rows, x: usize, first: usize, y: usize) {
        let Frame { rgb, light, metres, .. } = self.frame;
        let row = |r: usize| (CELL * y + r) * self.grid.size.0 + first + x;
        let codes = [0, 1].map(|r| &rgb[3 * row(r)..][..3 * CELL * N]);
        let cocs_px = [1, 2].map(|r: usize| &rows.coc_px[r][x + 1..][..CELL * N]);
        let metres = &metres[row(0)..][..CELL * N];
        let cell = (y - self.rows.start) * self.grid.across + (first + x) / CELL;
        let lights = &mut self.cells.light[cell..][..N];
        let surfaces_px = &mut self.cells.surface_px[cell..][..N];
        let nearest_px = &mut self.cells.nearest_px[cell..][..N];
        for k in 0..N {
            let (mut mean, mut least) = ([0.0, 0.0, 0.0, DepthMap::inverse_depth(metres[CELL * k])], f32::INFINITY);
            for r in 0..CELL {
                for j in CELL * k..CELL * (k + 1) {
                    for p in 0..3 {
                        mean[p] += light[usize::from(codes[r][3 * j + p])];
                    }
                    least = if cocs_px[r][j] < least { cocs_px[r][j] } else { least };
                }
            }
            let [r, g, b, inverse] = mean;
            let scale = 1.0 / (CELL * CELL) as f32;
            lights[k] = [r * scale, g * scale, b * scale, inverse];
            (surfaces_px[k], nearest_px[k]) = (least, least);
        }
    }

    /// Surveys the cell whose first pixel is `x` columns from column `first` of the picture.
    #[inline(always)]
    fn survey_cell(&mut self, rows: &Rows, x: usize, first: usize, y: usize) {
        let (width, height) = self.grid.size;
        let (mut cocs_px, mut is_source) = ([[0.0; CELL]; CELL], [[true; CELL]; CELL]);
        for r in 0..CELL {
            for k in 0..CELL {
                cocs_px[r][k] = rows.coc_px[r + 1][x + k + 1];
                is_source[r][k] = !rows.mixed[r][x + k] && !rows.is_beside_front(r + 1, x + k + 1);
                let at = (first + x + k, CELL * y + r);
                if at.0 < width && at.1 < height {
                    rows.collect(self.found, &self.grid.hiding, r + 1, x + k + 1, at);
                }
            }
        }
        let least = |all: f32, px: f32| if px < all { px } else { all };
        let all_px = cocs_px.as_flattened().iter().copied().fold(f32::INFINITY, least);
        let sources = cocs_px.as_flattened().iter().zip(is_source.as_flattened());
        let surface_px = sources.fold(f32::INFINITY, |all, (&px, &is)| least(all, if is { px } else { all }));
        let (mut sum, mut count) = ([0.0; 4], 0.0f32);
        for r in 0..CELL {
            for k in 0..CELL {
                if is_source[r][k] && cocs_px[r][k] - surface_px < SAME_PX {
                    let at = (CELL * y + r).min(height - 1) * width + (first + x + k).min(width - 1);
                    let light = self.frame.light_at(at);
                    (0..4).for_each(|p| sum[p] += light[p]);
                    count += 1.0;
                }
            }
        }
        let scale = 1.0 / count.max(1.0);
        let cell = (y - self.rows.start) * self.grid.across + (first + x) / CELL;
        self.cells.light[cell] = sum.map(|value| value * scale);
        (self.cells.surface_px[cell], self.cells.nearest_px[cell]) = (surface_px, all_px);
    }
}

impl Rows {
    fn resize(&mut self, columns: usize) {
        let padded = columns + 1 + CHUNK;
        self.coc_px.iter_mut().for_each(|row| row.resize(padded, 0.0));
        self.right.iter_mut().chain(&mut self.down).for_each(|row| row.resize(padded, NONE));
        self.mixed.iter_mut().for_each(|row| row.resize(padded, false));
    }

    /// Moves on by a row of cells: the last two rows become the first two.
    #[inline(always)]
    fn advance(&mut self, is_first: bool) {
        if !is_first {
            for k in 0..2 {
                self.coc_px.swap(k, k + 2);
                self.right.swap(k, k + 2);
            }
        }
    }

    /// Reads row `k` from the pixels at `range`.
    #[inline(always)]
    fn read(&mut self, k: usize, frame: &Frame, hiding: &Hiding, range: Range<usize>) {
        let (row, count) = (&mut self.coc_px[k], range.len());
        for (coc_px, metres) in row[1..].iter_mut().zip(&frame.metres[range]) {
            *coc_px = frame.lens.coc_px(*metres);
        }
        row[0] = row[1];
        let last_px = row[count];
        row[count + 1..].fill(last_px);
        let (row, right) = (&self.coc_px[k], &mut self.right[k]);
        for (x, step) in right[..count + 2].iter_mut().enumerate() {
            *step = step_between(row[x], row[x + 1], hiding);
        }
    }

    #[inline(always)]
    fn find_steps(&mut self, hiding: &Hiding) {
        for (k, down) in self.down.iter_mut().enumerate() {
            let (above, below) = (&self.coc_px[k], &self.coc_px[k + 1]);
            for ((step, a_px), b_px) in down.iter_mut().zip(above).zip(below) {
                *step = step_between(*a_px, *b_px, hiding);
            }
        }
    }

    /// Marks the mixed pixels of two rows from row `y` on, and takes them from `pixels`, in which those of earlier rows may be.
    #[inline(always)]
    fn mark_mixed(&mut self, pixels: &mut &[MixedPixel], y: usize, width: usize, columns: &Range<usize>) {
        for (r, row) in self.mixed.iter_mut().enumerate() {
            row.fill(false);
            let first = (y + r) * width;
            let mut count = 0;
            while let Some(pixel) = pixels.get(count).filter(|pixel| (pixel.at as usize) < first + width) {
                // What is hidden behind a pixel does not make it a mixed one.
                if pixel.alpha < 1.0 && (first + columns.start..first + columns.end).contains(&(pixel.at as usize)) {
                    row[pixel.at as usize - first - columns.start] = true;
                }
                count += 1;
            }
            *pixels = &pixels[count..];
        }
    }

    /// Whether the middle rows show one surface, without mixed pixels, in `count` columns from `x` on.
    #[inline(always)]
    fn is_plain(&self, x: usize, count: usize) -> bool {
        let any = |steps: &[u8]| steps.iter().fold(NONE, |any, step| any | step);
        let steps = self.right[1..3].iter().fold(NONE, |all, row| all | any(&row[x..][..count + 1]));
        let steps = self.down.iter().fold(steps, |all, row| all | any(&row[x + 1..][..count]));
        let mixed = self.mixed.iter().any(|row| row[x..][..count].iter().fold(false, |any, is| any | is));
        steps == NONE && !mixed
    }

    /// Returns the steps around a pixel: kind, CoC of the neighbour in pixels, and the direction.
    #[inline(always)]
    fn around(&self, row: usize, x: usize) -> [(u8, f32, (i32, i32)); 4] {
        [
            (self.right[row][x], self.coc_px[row][x + 1], (1, 0)),
            (self.right[row][x - 1], self.coc_px[row][x - 1], (-1, 0)),
            (self.down[row][x], self.coc_px[row + 1][x], (0, 1)),
            (self.down[row - 1][x], self.coc_px[row - 1][x], (0, -1)),
        ]
    }

    /// Whether a pixel is beside a surface in front of its own: the camera mixes both there.
    #[inline(always)]
    fn is_beside_front(&self, row: usize, x: usize) -> bool {
        let own_px = self.coc_px[row][x];
        self.around(row, x).iter().any(|&(step, other_px, _)| step == FRONT && other_px < own_px)
    }

    /// Collects the outlines at a pixel of the picture.
    #[inline(always)]
    fn collect(&self, found: &mut Found, hiding: &Hiding, row: usize, x: usize, (column, line): (usize, usize)) {
        let (own_px, around) = (self.coc_px[row][x], self.around(row, x));
        let behind = around.iter().filter(|(step, other_px, _)| *step == FRONT && *other_px > own_px);
        let farthest = behind.fold(None, |best: Option<&(u8, f32, (i32, i32))>, other| match best {
            Some(best) if best.1 >= other.1 => Some(best),
            _ => Some(other),
        });
        if let Some(&(_, behind_px, (across, down))) = farthest.filter(|_| hiding.includes(own_px)) {
            let at = (column as u32, line as u32);
            let behind = (at.0.wrapping_add_signed(across), at.1.wrapping_add_signed(down));
            found.seeds.push(Seed { at, behind, own_px, behind_px });
        }
        for (step, other_px, (across, down)) in [around[0], around[2]] {
            if step == OUTLINE {
                let (across, down) = (across as f32, down as f32);
                let sign = if own_px < other_px { -1.0 } else { 1.0 };
                found.outlines.push(OutlinePoint {
                    at: (column as f32 + 0.5 * across, line as f32 + 0.5 * down),
                    cocs_px: [own_px.min(other_px), own_px.max(other_px)],
                    nearer: (sign * across, sign * down),
                });
            }
        }
    }
}
