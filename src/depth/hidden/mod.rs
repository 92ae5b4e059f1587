//! Hidden surfaces: what near, blurred things and the subject hide, estimated from the picture itself.
//!
//! A blurred near thing is transparent at its rim, up to its radius inside its own outline; behind the subject, the blur of
//! the background reaches as far in. What is behind matters mostly by *which surface* it is: a wrong one, such as the
//! subject's head where only the wall is, costs most of the error; its texture is blurred anyway. So, at half the picture's
//! size, first for what is near, then for the subject ([`Hiding`]):
//!
//! 1. Each hiding pixel takes the surface behind the nearest pixel of its outline (`survey`, `labels`).
//! 2. Outlines of the surfaces behind are carried on straight where a near thing covers them: T-junctions (`junctions`).
//! 3. Eight rays search that surface around each hidden cell, through all others; what they hit is averaged (`rays`).
//!
//! The result is told to the blur as mixed pixels, as the background memory does, which knows better where it has seen
//! something: pixels that are in the matte stay as they are.
//!
//! Measured on rendered scenes (thin lens, 640x360): about half of what exact knowledge would gain. Outlines that are wrong
//! by pixels, as in maps of networks, were not measured.

mod hiding;
mod junctions;
mod labels;
mod rays;
mod survey;

use std::ops::Range;

use pulp::Arch;

pub use self::hiding::Hiding;
use self::hiding::{FindHiding, Span, distance_at};
use self::junctions::Junctions;
use self::labels::{Labels, Scene};
use self::rays::{FillCells, FilledCells};
use self::survey::{Found, Survey};
use crate::color::srgb_to_linear_table;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel, resize_buffer};
use crate::optics::DepthCoc;

/// Pixels of the picture per side of a cell.
const CELL: usize = 2;
/// Farthest that anything around what hides is looked at, in cells: the longest ray and the run at its end.
const MARGIN_CELLS: usize = rays::MAX_STEPS + rays::MAX_RUN;

/// Estimates what near things hide, picture by picture; nothing is kept but memory.
#[derive(Debug)]
pub struct HiddenSurfaces {
    /// Linear light of each code.
    light: Box<[f32; 256]>,
    cells: Cells,
    /// What each band found; the first one has all in the end.
    found: Vec<Found>,
    labels: Labels,
    junctions: Junctions,
    filled: Vec<[f32; 4]>,
    /// The pixels of each band.
    pixels: Vec<Vec<MixedPixel>>,
}

/// Half the picture's size, and the part around what hides.
#[derive(Clone, Copy, Debug)]
struct Grid {
    /// Columns and rows of the picture.
    size: (usize, usize),
    /// Cells in a row.
    across: usize,
    /// First and end of the columns, and of the rows, of cells that are looked at.
    columns: (usize, usize),
    rows: (usize, usize),
    hiding: Hiding,
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
    /// Adds what these surfaces hide to the matte of a map without holes, whose matte is estimated: pixels with alpha 1, at
    /// most [`Matte::max_hidden`], those nearest to an outline first. Does nothing if the map and the picture differ in
    /// size. The result is bit-identical for any number of threads.
    pub fn add_to_matte(
        &mut self,
        workers: &mut ThreadPool,
        map: &mut DepthMap,
        color: &ColorImage,
        lens: &DepthCoc,
        hiding: Hiding,
    ) {
        if map.size() != color.size() || map.metres.is_empty() {
            return;
        }
        let Some(grid) = Grid::around(workers, map, lens, hiding) else { return };
        let size = grid.size;
        let hidden = map.matte.pixels.iter().filter(|pixel| pixel.alpha >= 1.0).count();
        let budget = Matte::max_hidden(size.0, size.1).saturating_sub(hidden);
        let (arch, matte) = (Arch::new(), std::mem::take(&mut map.matte));
        let frame = Frame { metres: &map.metres, rgb: &color.rgb, lens, light: &self.light };
        let Self { cells, found, labels, junctions, filled, pixels, .. } = self;
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
        labels.choose(workers, bands(), Scene { grid: &grid, frame: &frame, seeds: &found.seeds }, budget);
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
        if hiding == Hiding::SUBJECT {
            hiding.complete_mixed_pixels(&mut map.matte, lens);
        }
    }
}

impl Grid {
    /// Returns the cells around everything that hides; `None` if nothing does.
    fn around(workers: &mut ThreadPool, map: &DepthMap, lens: &DepthCoc, hiding: Hiding) -> Option<Self> {
        let size = (map.width as usize, map.height as usize);
        let bands = Bands::new(size.1, 1, workers);
        // Distances: comparisons instead of a division.
        let range_m = (distance_at(lens, hiding.range_px.0), distance_at(lens, hiding.range_px.1));
        let mut spans = [Span::default(); MAX_ITEMS];
        workers.run_each(bands.rows().zip(&mut spans), &|(rows, span)| {
            Arch::new().dispatch(FindHiding { metres: &map.metres, width: size.0, rows, range_m, span });
        });
        let all = spans.into_iter().reduce(Span::union).filter(|span| span.first.0 < span.end.0)?;
        let (across, down) = (size.0.div_ceil(CELL), size.1.div_ceil(CELL));
        let grow = |first: usize, end: usize, most: usize| {
            ((first / CELL).saturating_sub(MARGIN_CELLS), (end.div_ceil(CELL) + MARGIN_CELLS).min(most))
        };
        let (columns, rows) = (grow(all.first.0, all.end.0, across), grow(all.first.1, all.end.1, down));
        Some(Self { size, across, columns, rows, hiding })
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
