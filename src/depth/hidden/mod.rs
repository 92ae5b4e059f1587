//! Hidden surfaces: what near, blurred things hide, estimated from the picture itself.
//!
//! A blurred near thing is transparent at its rim, up to its radius inside its own outline. What is behind it there
//! matters mostly by *which surface* it is: a wrong one, such as the subject's head where only the wall is, costs most of
//! the error; its texture is blurred anyway. So, at half the picture's size:
//!
//! 1. Each near pixel takes the surface behind the nearest pixel of its outline (`survey`, `labels`).
//! 2. Outlines of the surfaces behind are carried on straight where a near thing covers them: T-junctions (`junctions`).
//! 3. Eight rays search that surface around each hidden cell, through all others; what they hit is averaged (`rays`).
//!
//! The result is told to the blur as mixed pixels, as the background memory does, which knows better where it has seen
//! something: pixels that are in the matte stay as they are.
//!
//! Measured on rendered scenes (thin lens, 640x360): about half of what exact knowledge would gain. Outlines that are wrong
//! by pixels, as in maps of networks, were not measured.

mod junctions;
mod labels;
mod rays;
mod survey;

use std::ops::Range;

use pulp::{Arch, WithSimd};

use self::junctions::Junctions;
use self::labels::Labels;
use self::rays::{FillCells, FilledCells};
use self::survey::{Found, Survey};
use crate::color::srgb_to_linear_table;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel, resize_buffer};
use crate::optics::DepthCoc;

/// CoC below which a surface counts as near, in pixels: nearer ones are blurred visibly.
const NEAR_PX: f32 = -2.0;
/// Pixels of the picture per side of a cell.
const CELL: usize = 2;
/// Farthest that anything around what is near is looked at, in cells: the longest ray and the run at its end.
const MARGIN_CELLS: usize = rays::MAX_STEPS + rays::MAX_RUN;

/// Estimates what near things hide, picture by picture; nothing is kept but memory.
#[derive(Debug)]
pub struct HiddenSurfaces {
    /// Linear light of each code.
    light: Box<[f32; 256]>,
    grid: Grid,
    cells: Cells,
    /// What each band found; the first one has all in the end.
    found: Vec<Found>,
    labels: Labels,
    junctions: Junctions,
    filled: Vec<[f32; 4]>,
    /// The pixels of each band.
    pixels: Vec<Vec<MixedPixel>>,
}

/// Half the picture's size, and the part around what is near.
#[derive(Clone, Copy, Debug, Default)]
struct Grid {
    /// Columns and rows of the picture.
    size: (usize, usize),
    /// Cells in a row.
    across: usize,
    /// First and end of the columns, and of the rows, of cells that are looked at.
    columns: (usize, usize),
    rows: (usize, usize),
}

/// What the cells show, row by row.
#[derive(Debug, Default)]
struct Cells {
    /// Mean linear light (red, green, blue) and inverse depth (1/m) of the pixels that surely show one surface.
    light: Vec<[f32; 4]>,
    /// CoC of that surface, in pixels; infinite without such pixels.
    surface_px: Vec<f32>,
    /// Smallest CoC of all pixels, in pixels.
    nearest_px: Vec<f32>,
}

/// A picture and its depth.
#[derive(Clone, Copy)]
struct Frame<'a> {
    metres: &'a [f32],
    rgb: &'a [u8],
    lens: &'a DepthCoc,
    light: &'a [f32; 256],
}

impl Frame<'_> {
    /// Returns the CoC of the pixel at index `at`, in pixels.
    #[inline(always)]
    fn coc_px(&self, at: usize) -> f32 {
        self.lens.coc_px(self.metres[at])
    }

    /// Returns linear light and inverse depth (1/m) of the pixel at index `at`.
    #[inline(always)]
    fn light_at(&self, at: usize) -> [f32; 4] {
        let code = &self.rgb[3 * at..][..3];
        let light = |p: usize| self.light[usize::from(code[p])];
        [light(0), light(1), light(2), DepthMap::inverse_depth(self.metres[at])]
    }
}

impl Default for HiddenSurfaces {
    fn default() -> Self {
        Self {
            light: srgb_to_linear_table(),
            grid: Grid::default(),
            cells: Cells::default(),
            found: Vec::new(),
            labels: Labels::default(),
            junctions: Junctions::default(),
            filled: Vec::new(),
            pixels: Vec::new(),
        }
    }
}

impl HiddenSurfaces {
    /// Adds what near things hide to the matte of a map without holes, whose matte is estimated: pixels with alpha 1 and
    /// background alpha 1, at most [`Matte::max_hidden`], those nearest to an outline first. Does nothing if the map and
    /// the picture differ in size. The result is bit-identical for any number of threads.
    pub fn add_to_matte(&mut self, workers: &mut ThreadPool, map: &mut DepthMap, color: &ColorImage, lens: &DepthCoc) {
        if map.size() != color.size() || map.metres.is_empty() {
            return;
        }
        let Some(grid) = Grid::around_near(workers, map, lens) else { return };
        let size = grid.size;
        let hidden = map.matte.pixels.iter().filter(|pixel| pixel.alpha >= 1.0).count();
        let budget = Matte::max_hidden(size.0, size.1).saturating_sub(hidden);
        let (arch, matte) = (Arch::new(), std::mem::take(&mut map.matte));
        let frame = Frame { metres: &map.metres, rgb: &color.rgb, lens, light: &self.light };
        let Self { cells, found, labels, junctions, filled, pixels, .. } = self;
        self.grid = grid;
        // Bands of whole cells.
        let bands = Bands::new(size.1, CELL, workers);
        let bands = || bands.rows().map(|rows| rows.start / CELL..rows.end.div_ceil(CELL));
        cells.resize(&grid);
        found.resize_with(bands().count(), Found::default);
        let parts = cells.split(bands(), grid.across);
        workers.run_each(bands().zip(parts).zip(&mut *found), &|((rows, cells), found)| {
            arch.dispatch(Survey { frame, grid: &grid, matte: &matte, rows, cells, found });
        });
        let Some((found, others)) = found.split_first_mut() else { return };
        others.iter().for_each(|other| found.append(other));
        labels.spread(&grid, &cells.nearest_px, &found.seeds);
        labels.choose(&grid, &frame, &found.seeds, budget);
        junctions.carry_outlines_on(&grid, &frame, found, cells, labels);
        resize_buffer(filled, cells.light.len());
        let rays = FillCells { frame: &frame, grid: &grid, cells, labels, seeds: &found.seeds };
        workers.run_each(bands().zip(split_rows(filled, bands(), grid.across)), &|(rows, filled)| {
            arch.dispatch(rays.rows(rows, filled));
        });
        let filled = FilledCells { frame: &frame, grid: &grid, labels, filled };
        pixels.resize_with(bands().count(), Default::default);
        workers.run_each(bands().zip(&mut *pixels), &|(rows, pixels)| {
            arch.dispatch(filled.merge(rows, &matte, pixels));
        });
        map.matte = matte;
        // The first band's vector is moved, not copied.
        if let Some((first, others)) = pixels.split_first_mut() {
            std::mem::swap(&mut map.matte.pixels, first);
            others.iter().for_each(|pixels| map.matte.pixels.extend_from_slice(pixels));
        }
    }
}

impl Grid {
    /// Returns the cells around everything near; `None` if nothing is.
    fn around_near(workers: &mut ThreadPool, map: &DepthMap, lens: &DepthCoc) -> Option<Self> {
        let size = (map.width as usize, map.height as usize);
        let bands = Bands::new(size.1, 1, workers);
        // The nearest distance that is not near: a comparison instead of a division.
        let far_m = distance_at(lens, NEAR_PX);
        let mut spans = [Span::default(); MAX_ITEMS];
        workers.run_each(bands.rows().zip(&mut spans), &|(rows, span)| {
            Arch::new().dispatch(FindNear { metres: &map.metres, width: size.0, rows, far_m, span });
        });
        let all = spans.into_iter().reduce(Span::union).filter(|span| span.first.0 < span.end.0)?;
        let (across, down) = (size.0.div_ceil(CELL), size.1.div_ceil(CELL));
        let grow = |first: usize, end: usize, most: usize| {
            ((first / CELL).saturating_sub(MARGIN_CELLS), (end.div_ceil(CELL) + MARGIN_CELLS).min(most))
        };
        let (columns, rows) = (grow(all.first.0, all.end.0, across), grow(all.first.1, all.end.1, down));
        Some(Self { size, across, columns, rows })
    }

    /// Limits rows of cells to those that are looked at.
    fn limit_rows(&self, rows: Range<usize>) -> Range<usize> {
        rows.start.max(self.rows.0)..rows.end.min(self.rows.1)
    }

    /// Returns the position of the centre of a cell, in pixels.
    #[inline(always)]
    fn centre_px(&self, x: usize, y: usize) -> (f32, f32) {
        ((CELL * x) as f32 + 0.5, (CELL * y) as f32 + 0.5)
    }
}

/// Returns the distance at which the CoC is `coc_px` < 0, in metres; 0 if nothing is blurred that much.
fn distance_at(lens: &DepthCoc, coc_px: f32) -> f32 {
    if lens.max_coc_px > -coc_px { lens.near_m() / (1.0 - coc_px / lens.coc_at_infinity_px) } else { 0.0 }
}

/// The pixels from `first` to before `end`, in columns and rows.
#[derive(Clone, Copy, Debug)]
struct Span {
    first: (usize, usize),
    end: (usize, usize),
}

impl Default for Span {
    fn default() -> Self {
        Self { first: (usize::MAX, usize::MAX), end: (0, 0) }
    }
}

impl Span {
    fn union(self, other: Self) -> Self {
        Self {
            first: (self.first.0.min(other.first.0), self.first.1.min(other.first.1)),
            end: (self.end.0.max(other.end.0), self.end.1.max(other.end.1)),
        }
    }
}

/// Finds the pixels of some rows that are nearer than `far_m`.
struct FindNear<'a> {
    metres: &'a [f32],
    width: usize,
    rows: Range<usize>,
    far_m: f32,
    span: &'a mut Span,
}

impl WithSimd for FindNear<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { metres, width, rows, far_m, span } = self;
        let is_near = |&metres: &f32| (metres > 0.0) & (metres < far_m);
        for y in rows {
            let row = &metres[y * width..][..width];
            if row.iter().fold(0, |count, metres| count + u32::from(is_near(metres))) == 0 {
                continue;
            }
            let first = row.iter().position(is_near).unwrap_or(0);
            let last = row.iter().rposition(is_near).unwrap_or(0);
            *span = span.union(Span { first: (first, y), end: (last + 1, y + 1) });
        }
    }
}

impl Cells {
    fn resize(&mut self, grid: &Grid) {
        let count = grid.across * grid.size.1.div_ceil(CELL);
        resize_buffer(&mut self.light, count);
        resize_buffer(&mut self.surface_px, count);
        resize_buffer(&mut self.nearest_px, count);
    }

    /// Splits the cells into bands of rows.
    fn split(
        &mut self,
        bands: impl Iterator<Item = Range<usize>> + Clone,
        across: usize,
    ) -> impl Iterator<Item = CellRows<'_>> {
        let light = split_rows(&mut self.light, bands.clone(), across);
        let surface_px = split_rows(&mut self.surface_px, bands.clone(), across);
        let nearest_px = split_rows(&mut self.nearest_px, bands, across);
        light.zip(surface_px).zip(nearest_px).map(|((light, surface_px), nearest_px)| CellRows {
            light,
            surface_px,
            nearest_px,
        })
    }
}

/// Some rows of [`Cells`].
struct CellRows<'a> {
    light: &'a mut [[f32; 4]],
    surface_px: &'a mut [f32],
    nearest_px: &'a mut [f32],
}

/// Splits a plane into bands of rows.
fn split_rows<T>(
    mut plane: &mut [T],
    bands: impl Iterator<Item = Range<usize>>,
    across: usize,
) -> impl Iterator<Item = &mut [T]> {
    bands.map(move |rows| {
        let (band, rest) = std::mem::take(&mut plane).split_at_mut(rows.len() * across);
        plane = rest;
        band
    })
}

#[cfg(test)]
mod tests;
