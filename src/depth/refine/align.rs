//! Colour-guided edge alignment: moves depth edges onto the edges of the colour picture.
//!
//! In a band around depth discontinuities each pixel takes the depth of those pixels around it that have its colour.
//! Depths far from any discontinuity are reliable and count in full; those in the band may be wrong and count little.
//! The result is the depth of one of the surfaces around, never one between them: the votes are split at the middle of
//! their range, the heavier half is kept, and so on until one surface is left (a weighted mode, found by bisection).
//! Pixels that agree with their result are not changed, so that exact depth stays exact.
//!
//! Weighting depth by colour is the idea of the joint bilateral filter (Kopf et al., *Joint bilateral upsampling*,
//! 2007); its mean would invent depths at edges, the mode does not (Min, Lu, Do, *Depth video enhancement based on
//! weighted mode filtering*, 2012).
//! twin: shaders/refine/band.wgsl, shaders/refine/vote.wgsl

use std::iter;
use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::band::{DilateColumns, DilateRows};
use super::planes::{Planes, SetColors, SetDepths};
use super::tiles::{self, Tiles};
use super::votes::{self, RADIUS_LANES, Votes, Weights, depth_step_at};
use crate::compute::bands::{self, Bands};
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{reset_buffer, resize_buffer};

/// Weight of a depth within the band, and of one that was filled in.
pub const UNCERTAIN: f32 = 0.12;
pub const FILLED: f32 = 0.02;
/// Minimum fraction of a depth step between neighbours at an edge, which may be spread over some pixels.
pub const EDGE_FRACTION: f32 = 0.25;
/// Number of rounds; each can move an edge by up to [`BAND_PX`](super::band::BAND_PX).
pub const ROUNDS: usize = 2;
/// Minimum number of pixels per thread.
const MIN_PIXELS_PER_THREAD: usize = 64;

/// Aligns maps of inverse depth; owns its buffers.
#[derive(Debug)]
pub struct Aligner {
    planes: Planes,
    /// Both sides of every discontinuity, and all pixels within [`BAND_PX`](super::band::BAND_PX) of one.
    edge: Vec<bool>,
    band: Vec<bool>,
    scratch: Vec<bool>,
    tiles: Tiles,
    /// Spatial weights of the votes.
    spatial_weights: Weights,
    /// Worklist of pixels, in order: first those at edges, then the neighbours of those that changed.
    worklist: Vec<u32>,
    /// Results of the pixels that are processed in parallel.
    results: Vec<f32>,
    /// All pixels processed in the first round.
    pixels: Vec<u32>,
    /// Pixels that changed in the last round.
    moved: Vec<u32>,
}

impl Default for Aligner {
    fn default() -> Self {
        Self {
            planes: Planes::default(),
            edge: Vec::new(),
            band: Vec::new(),
            scratch: Vec::new(),
            tiles: Tiles::default(),
            spatial_weights: votes::compute_spatial_weights(),
            worklist: Vec::new(),
            results: Vec::new(),
            pixels: Vec::new(),
            moved: Vec::new(),
        }
    }
}

impl Aligner {
    /// Moves the edges of `inverse` onto those of the picture `rgb`. Steps of inverse depth above `depth_step` are
    /// edges; depths that are `unknown` were filled in.
    pub fn align(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        inverse: &mut [f32],
        unknown: &[bool],
        rgb: &[u8],
        width: usize,
        depth_step: f32,
    ) {
        let bands = Bands::new(inverse.len() / width, tiles::ROWS, workers);
        self.moved.clear();
        self.pixels.clear();
        for round in 0..ROUNDS {
            if round == 0 {
                self.find_all_edges((arch, workers), inverse, width, depth_step, bands);
            }
            let Self { planes, edge, band, scratch, tiles, worklist, moved, .. } = self;
            if round > 0 {
                // Only pixels that moved in the last round can have moved edges, or can move their neighbours now.
                workers.run_each(bands.rows().zip(bands.split(edge, width)), &|(rows, edge)| {
                    arch.dispatch(FindEdges {
                        inverse,
                        width,
                        depth_step,
                        columns: |y| tiles.near_columns(y),
                        rows,
                        edge,
                    });
                });
            }
            workers.run_each(bands.rows().zip(bands.split(scratch, width)), &|(rows, out)| {
                arch.dispatch(DilateRows { tiles, width, edge, rows, out });
            });
            let parts = planes.split(bands).zip(bands.split(band, width));
            workers.run_each(parts, &|(mut planes, band)| {
                let rows = planes.rows.clone();
                arch.dispatch(DilateColumns { tiles, width, along: scratch, rows, out: band });
                let planes = &mut planes;
                if round == 0 {
                    arch.dispatch(SetColors { planes, tiles, rgb });
                }
                arch.dispatch(SetDepths { planes, tiles, inverse, unknown, band, weights: [FILLED, UNCERTAIN] });
            });
            if round > 0 {
                worklist.clear();
                worklist.extend(moved.iter().filter(|&&k| band[k as usize]));
            }
            moved.clear();
            self.move_edges((arch, workers), inverse, depth_step);
            if round == 0 {
                std::mem::swap(&mut self.worklist, &mut self.pixels);
            }
        }
        snap_to_surfaces(&self.pixels, inverse, rgb, width, depth_step);
    }

    /// Finds the edges of a new map, their tiles, and the first worklist.
    fn find_all_edges(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        inverse: &[f32],
        width: usize,
        depth_step: f32,
        bands: Bands,
    ) {
        let (Self { planes, edge, band, scratch, tiles, worklist, .. }, height) = (self, inverse.len() / width);
        resize_buffer(edge, inverse.len());
        [band, scratch].into_iter().for_each(|mask| reset_buffer(mask, inverse.len()));
        tiles.clear(width, height);
        let parts = bands.rows().zip(bands.split(edge, width)).zip(tiles.split(bands));
        workers.run_each(parts, &|((rows, edge), has_edge)| {
            let columns = |_| iter::once(0..width);
            arch.dispatch(FindEdges { inverse, width, depth_step, columns, rows, edge: &mut *edge });
            tiles::mark_edge_tiles(has_edge, edge, width);
        });
        tiles.mark_neighbours();
        worklist.clear();
        tiles.collect_edges(edge, worklist);
        planes.resize(width, height, RADIUS_LANES);
    }

    /// Finds the surface of the pixels at edges, the `worklist`, and of the neighbours of those that change: an edge
    /// moves like a wavefront, and costs little where it is correct. A result depends only on the pixel's own depth and
    /// on the planes, so that the whole worklist is computed in parallel. `band` marks the pixels that may change; a
    /// pixel leaves it when it joins the worklist, so that it is processed once.
    fn move_edges(&mut self, (arch, workers): (Arch, &mut ThreadPool), inverse: &mut [f32], depth_step: f32) {
        let Self { planes, spatial_weights, band, worklist, results, moved, .. } = self;
        let (planes, width) = (&*planes, planes.width);
        for &k in &*worklist {
            band[k as usize] = false;
        }
        let mut next = 0;
        while next < worklist.len() {
            let pixels = &worklist[next..];
            let each = bands::chunk_len(pixels.len(), MIN_PIXELS_PER_THREAD);
            results.resize(pixels.len(), 0.0);
            workers.run_each(pixels.chunks(each).zip(results.chunks_mut(each)), &|(pixels, results)| {
                arch.dispatch(FindSurfaces { planes, spatial_weights, inverse, depth_step, pixels, results });
            });
            for &result in &*results {
                let pixel = worklist[next];
                next += 1;
                let k = pixel as usize;
                if result == inverse[k] {
                    continue;
                }
                inverse[k] = result;
                moved.push(pixel);
                let (x, y) = (k % width, k / width);
                let beside = [
                    (x > 0, k.wrapping_sub(1)),
                    (x + 1 < width, k + 1),
                    (y > 0, k.wrapping_sub(width)),
                    (true, k + width),
                ];
                // For the last row, `k + width` lies beyond the mask.
                for (inside, beside) in beside {
                    if inside && beside < band.len() && band[beside] {
                        band[beside] = false;
                        worklist.push(beside as u32);
                    }
                }
            }
        }
    }
}

/// Snaps pixels still between two surfaces, as on a blurred edge, to the neighbour of more similar colour.
fn snap_to_surfaces(pixels: &[u32], inverse: &mut [f32], rgb: &[u8], width: usize, depth_step: f32) {
    let color = |k: usize| [0, 1, 2].map(|p| i32::from(rgb[3 * k + p]));
    let height = inverse.len() / width;
    for k in pixels.iter().map(|&k| k as usize) {
        let (x, y, here) = (k % width, k / width, inverse[k]);
        let pairs = [(x > 0 && x + 1 < width, 1), (y > 0 && y + 1 < height, width)];
        let mut ends = pairs.into_iter().filter(|(inside, _)| *inside).map(|(_, step)| (k - step, k + step));
        let is_between = |&(a, b): &(usize, usize)| {
            let (low, high) = (inverse[a].min(inverse[b]), inverse[a].max(inverse[b]));
            here - low > depth_step_at(depth_step, here) && high - here > depth_step_at(depth_step, high)
        };
        if let Some((a, b)) = ends.rfind(is_between) {
            let apart = |of: usize| color(of).into_iter().zip(color(k)).map(|(a, b)| (a - b).pow(2)).sum::<i32>();
            inverse[k] = inverse[if apart(a) <= apart(b) { a } else { b }];
        }
    }
}

/// Marks both sides of every discontinuity, in some columns of each row of a band.
struct FindEdges<'a, C> {
    inverse: &'a [f32],
    width: usize,
    depth_step: f32,
    columns: C,
    rows: Range<usize>,
    edge: &'a mut [bool],
}

impl<I: Iterator<Item = Range<usize>>, C: Fn(usize) -> I> WithSimd for FindEdges<'_, C> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, width, depth_step, columns, rows, edge } = self;
        let height = inverse.len() / width;
        for (line, y) in rows.enumerate() {
            let row = &inverse[y * width..][..width];
            let above = &inverse[y.saturating_sub(1) * width..][..width];
            let below = &inverse[(y + 1).min(height - 1) * width..][..width];
            let edge = &mut edge[line * width..][..width];
            for columns in columns(y) {
                let Range { start, end } = columns;
                // At the ends of the row a pixel is its own neighbour.
                for x in [start, end - 1] {
                    let around = [above[x], below[x], row[x.saturating_sub(1)], row[(x + 1).min(width - 1)]];
                    edge[x] = around.into_iter().any(|beside| is_edge_between(row[x], beside, depth_step));
                }
                if end - start <= 2 {
                    continue;
                }
                let (from, len) = (start + 1, end - start - 2);
                let [above, left, here, right, below] =
                    [&above[from..], &row[start..], &row[from..], &row[from + 1..], &below[from..]]
                        .map(|row| &row[..len]);
                for (k, edge) in edge[from..][..len].iter_mut().enumerate() {
                    let is = |beside: f32| is_edge_between(here[k], beside, depth_step);
                    *edge = is(above[k]) | is(below[k]) | is(left[k]) | is(right[k]);
                }
            }
        }
    }
}

/// Whether two neighbours differ by a sufficient fraction of a depth step.
#[inline(always)]
fn is_edge_between(here: f32, beside: f32, depth_step: f32) -> bool {
    (here - beside).abs() > EDGE_FRACTION * depth_step_at(depth_step, here)
}

/// Computes the surface of each listed pixel.
struct FindSurfaces<'a> {
    planes: &'a Planes,
    spatial_weights: &'a Weights,
    inverse: &'a [f32],
    depth_step: f32,
    pixels: &'a [u32],
    results: &'a mut [f32],
}

impl WithSimd for FindSurfaces<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, spatial_weights, inverse, depth_step, pixels, results } = self;
        let mut votes = Votes::default();
        for (&pixel, result) in pixels.iter().zip(results) {
            let k = pixel as usize;
            votes.collect_window(planes, spatial_weights, k % planes.width, k / planes.width);
            *result = votes.winning_surface(inverse[k], depth_step);
        }
    }
}
