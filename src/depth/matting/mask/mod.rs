//! Matting from a mask of the nearer surface, such as a network's coarse and soft one.
//!
//! Where the mask is sure (the known regions of a trimap), cells gather means and covariances of both surfaces'
//! colours. Each other pixel is projected on Fisher's linear discriminant between them. Its alpha is the posterior
//! mean, with a prior from the mask for 0 and 1 and a uniform one between (Bayesian matting, Chuang et al. 2001).

mod backdrop;
mod cells;
mod outline;
mod posterior;
mod sides;

use std::ops::Range;

pub use backdrop::BackgroundPlate;
pub use outline::{Outline, depth_from_mask};

use crate::color::srgb_to_linear_table;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap, Mask, Matte, MixedPixel};

use super::NEARLY_PURE;
use super::contrast::{Color, Contrast, Discriminant, color_difference};
use cells::{Cell, Kernel, MaskView, RADIUS, Sums};
use posterior::Posterior;
use sides::Sides;

/// Side of a cell in mask pixels, and its minimum in picture pixels.
const CELL_OF_MASK: f32 = 1.6;
const MIN_CELL_PX: usize = 4;
/// Distance, in cells, at which the weight of a cell falls to an eighth.
const FALLOFF_CELLS: f32 = 1.5;
/// Minimum of mask and alpha for a seed of the near surface, and minimum alpha of pixels connected to one.
const NEAR_FROM: f32 = 0.6;
const CONNECTED_FROM: f32 = 0.15;
/// Offset that marks the alpha of a connected pixel.
const CONNECTED: f32 = 2.0;

/// Computes mattes from masks; owns the memory for it.
#[derive(Debug)]
pub struct MaskMatting {
    light: Box<[f32; 256]>,
    posterior: Posterior,
    kernel: Kernel,
    cells: Vec<Cell>,
    /// Smallest and largest value of each mask column.
    ends: Vec<[f32; 2]>,
    /// Whether a cell's colours are needed.
    needed: Vec<bool>,
    sums: Vec<Sums>,
    contrasts: Vec<Option<Contrast>>,
    /// Alpha of the pixels in the unknown region, plus [`CONNECTED`] if connected to the near surface.
    alphas: Vec<f32>,
    front: Vec<u32>,
    columns: Vec<Tap>,
}

impl Default for MaskMatting {
    fn default() -> Self {
        let weight = |row: usize, column: usize| {
            let square = (row.abs_diff(RADIUS).pow(2) + column.abs_diff(RADIUS).pow(2)) as f32;
            (1.0 + square / (FALLOFF_CELLS * FALLOFF_CELLS)).powi(-3)
        };
        Self {
            light: srgb_to_linear_table(),
            posterior: Posterior::new(),
            kernel: std::array::from_fn(|row| std::array::from_fn(|column| weight(row, column))),
            cells: Vec::new(),
            ends: Vec::new(),
            needed: Vec::new(),
            sums: Vec::new(),
            contrasts: Vec::new(),
            alphas: Vec::new(),
            front: Vec::new(),
            columns: Vec::new(),
        }
    }
}

impl MaskMatting {
    /// Fills in the nearer surface of `map`, at [`DepthMap::SUBJECT_M`], where `mask` and the colours have it, and the
    /// mixed pixels between both. On entry, `map` is as large as its picture, and has the distance of the background
    /// everywhere. With a known background (`backdrop`), covered pixels near the outline become mixed pixels, too, with
    /// all of the background behind them.
    pub fn compute_matte(
        &mut self,
        mask: &Mask,
        color: &ColorImage,
        backdrop: Option<&BackgroundPlate>,
        map: &mut DepthMap,
    ) {
        self.compute_outlined(mask, (None, true), color, backdrop, map);
    }

    /// Does the same as [`MaskMatting::compute_matte`]. Where colours do not tell the surfaces apart, alpha is that of
    /// `given`, as large as the picture, if there is one; without `follows_color`, that is everywhere.
    fn compute_outlined(
        &mut self,
        mask: &Mask,
        (given, follows_color): (Option<&Mask>, bool),
        color: &ColorImage,
        backdrop: Option<&BackgroundPlate>,
        map: &mut DepthMap,
    ) {
        map.matte.pixels.clear();
        let (width, height) = (color.width as usize, color.height as usize);
        let backdrop = backdrop.filter(|backdrop| backdrop.color.size() == color.size());
        if map.size() != color.size() || mask.alpha.is_empty() || width * height == 0 {
            return;
        }
        pulp::Arch::new().dispatch(ComputeMatte { matting: self, mask, given, follows_color, color, backdrop, map });
    }
}

/// Arguments of [`MaskMatting::compute_outlined`].
struct ComputeMatte<'a> {
    matting: &'a mut MaskMatting,
    mask: &'a Mask,
    given: Option<&'a Mask>,
    follows_color: bool,
    color: &'a ColorImage,
    backdrop: Option<&'a BackgroundPlate<'a>>,
    map: &'a mut DepthMap,
}

impl pulp::WithSimd for ComputeMatte<'_> {
    type Output = ();
    // Few explicit vectors: the dispatch compiles these loops for the processor's instruction set.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { matting, mask, given, follows_color, color, backdrop, map } = self;
        let (width, height) = (color.width as usize, color.height as usize);
        let cell_px = ((CELL_OF_MASK * width as f32 / mask.width as f32).round() as usize).max(MIN_CELL_PX);
        matting.columns.clear();
        matting.columns.extend((0..width).map(|x| Tap::new(x, width, mask.width as usize)));
        let (across, down) = (width.div_ceil(cell_px), height.div_ceil(cell_px));
        let MaskMatting { light, posterior, kernel, cells, ends, needed, sums, contrasts, alphas, front, columns } =
            matting;
        let view = MaskView { mask, given, color, light, backdrop, columns, cell_px, across, down };
        view.classify_cells(cells, ends);
        view.gather_colors(cells, needed, sums);
        contrasts.clear();
        for at in 0..across * down {
            let is_beside = || cells[at] == Cell::Band || view.cells_within(at, 1).any(|at| cells[at] == Cell::Band);
            let place = (at / across, at % across);
            let is_used = follows_color && needed[at] && is_beside();
            contrasts.push(if is_used { view.compute_contrast(simd, kernel, sums, place) } else { None });
        }
        alphas.resize(width * height, 0.0);
        front.clear();
        for cell in (0..across * down).filter(|&cell| cells[cell] == Cell::Band) {
            view.compute_alphas(posterior, contrasts, (cell / across, cell % across), alphas, front);
        }
        view.connect_to_seeds(cells, alphas, front);
        // In raster order, which is that of the matte's pixels.
        for row in 0..down {
            for y in view.pixel_rows(row) {
                for column in 0..across {
                    let (cell, xs) = (row * across + column, view.pixel_columns(column));
                    match cells[cell] {
                        Cell::Far => {}
                        Cell::Near => {
                            // This close to the outline, blur may reveal the background.
                            if let Some(backdrop) = backdrop.filter(|_| needed[cell]) {
                                view.add_background(backdrop, (xs.clone(), y), map);
                            }
                            map.metres[y * width..][xs].fill(DepthMap::SUBJECT_M);
                        }
                        Cell::Band => view.separate_pixels(contrasts, (xs, y), alphas, map),
                    }
                }
            }
        }
        if map.matte.pixels.len() > Matte::max_pixels(width, height) {
            map.matte.pixels.retain(|pixel| pixel.alpha < 1.0);
        }
    }
}

impl MaskView<'_> {
    /// Computes alpha of a cell's pixels; adds the seeds of the near surface to `front`.
    #[inline(always)]
    fn compute_alphas(
        &self,
        posterior: &Posterior,
        contrasts: &[Option<Contrast>],
        (row, column): (usize, usize),
        alphas: &mut [f32],
        front: &mut Vec<u32>,
    ) {
        let at = |(row, column): (usize, usize)| contrasts[row * self.across + column].as_ref();
        for y in self.pixel_rows(row) {
            let (mask_at, down) = (self.mask_in_row(y), self.enclosing_cells(y, self.down));
            let background_at = self.backdrop.map(|backdrop| backdrop.light_in_row(y));
            let xs = self.pixel_columns(column);
            let middle = (xs.start + self.cell_px / 2).min(xs.end);
            for xs in [xs.start..middle, middle..xs.end] {
                // All pixels of this half cell are between the same four cell centres.
                let Some(first) = xs.clone().next() else { continue };
                let across = self.enclosing_cells(first, self.across);
                let corners = [
                    (down.first, across.first),
                    (down.second, across.first),
                    (down.first, across.second),
                    (down.second, across.second),
                ]
                .map(at);
                // A corner without colours gets those of another one, with precision 0, so that it weighs less the
                // closer it is.
                let any = at((row, column)).or_else(|| corners.into_iter().flatten().next());
                // Only one of both is used, depending on whether the background is known.
                let (unknown, known) =
                    (any.filter(|_| background_at.is_none()), any.filter(|_| background_at.is_some()));
                let line_of = |any: &Contrast, corner: Option<&Contrast>| match (
                    corner.map(Contrast::discriminant_params),
                    any.discriminant_params(),
                ) {
                    (Some(line), _) => line,
                    (None, [x, y, z, offset, _]) => [x, y, z, offset, 0.0],
                };
                let lines = unknown.map(|any| Sides::new(corners.map(|corner| line_of(any, corner)), down.weight));
                let front_of = |any, corner: Option<&Contrast>| corner.unwrap_or(any).foreground_params();
                let fronts = known.map(|any| Sides::new(corners.map(|corner| front_of(any, corner)), down.weight));
                for x in xs {
                    let place = y * self.color.width as usize + x;
                    let (mask, light) = (mask_at(x), self.light_at(place));
                    let given = self.given.map(|given| given.alpha[place]);
                    let along = self.enclosing_cells(x, self.across).weight;
                    // With a known background, each pixel has its own discriminant.
                    let discriminant: Option<Discriminant> = match (&background_at, &lines, &fronts) {
                        (None, Some(lines), _) => Some(lines.interpolate(along).into()),
                        (Some(background_at), _, Some(fronts)) => {
                            Some(Discriminant::against_background(fronts.interpolate(along), background_at(x)))
                        }
                        _ => None,
                    };
                    let alpha = match discriminant {
                        Some(own) => {
                            let by_color = posterior.alpha(mask, own.alpha(light), own.precision);
                            given.map_or(by_color, |given| given + (by_color - given) * outline::clarity(own.precision))
                        }
                        None => given.unwrap_or(mask),
                    };
                    alphas[place] = alpha;
                    if mask > NEAR_FROM && alpha > NEAR_FROM {
                        alphas[place] += CONNECTED;
                        front.push(place as u32);
                    }
                }
            }
        }
    }

    /// Returns both surfaces' colours at a pixel, bilinear between the cells around that have any; a known background
    /// `light` replaces the far one's mean.
    #[inline(always)]
    fn interpolate_surfaces(
        &self,
        contrasts: &[Option<Contrast>],
        (x, y): (usize, usize),
        light: Option<[f32; 3]>,
    ) -> Option<[Color; 2]> {
        let (across, down) = (self.enclosing_cells(x, self.across), self.enclosing_cells(y, self.down));
        let (mut sum, mut total) = ([Color::default(); 2], 0.0);
        for (row, of_row) in [(down.first, 1.0 - down.weight), (down.second, down.weight)] {
            for (column, of_column) in [(across.first, 1.0 - across.weight), (across.second, across.weight)] {
                if let Some(contrast) = &contrasts[row * self.across + column] {
                    let weight = of_row * of_column;
                    total += weight;
                    sum.iter_mut()
                        .zip(&contrast.colors_with_background(light))
                        .for_each(|(sum, color)| sum.add(weight, color));
                }
            }
        }
        if total > 0.0 { Some(sum.map(|color| color.scaled(1.0 / total))) } else { None }
    }

    /// Returns the two cells, in one direction, whose centres enclose a pixel: interpolation hides the cells.
    #[inline(always)]
    fn enclosing_cells(&self, at: usize, count: usize) -> Tap {
        let half = 0.5 * self.cell_px as f32;
        Tap::at((at as f32 + 0.5 - half) / self.cell_px as f32, count)
    }

    /// Marks the pixels connected to the seeds: a mere likeness in colour is not enough to be near.
    fn connect_to_seeds(&self, cells: &[Cell], alphas: &mut [f32], front: &mut Vec<u32>) {
        let (width, height) = (self.color.width as usize, self.color.height as usize);
        let is_band = |x: usize, y: usize| cells[y / self.cell_px * self.across + x / self.cell_px] == Cell::Band;
        while let Some(at) = front.pop() {
            let (x, y) = (at as usize % width, at as usize / width);
            for y in y.saturating_sub(1)..(y + 2).min(height) {
                for x in x.saturating_sub(1)..(x + 2).min(width) {
                    let alpha = &mut alphas[y * width + x];
                    if (CONNECTED_FROM..CONNECTED).contains(alpha) && is_band(x, y) {
                        *alpha += CONNECTED;
                        front.push((y * width + x) as u32);
                    }
                }
            }
        }
    }

    /// Writes the depth of a row of a cell, and its mixed pixels.
    #[inline(always)]
    fn separate_pixels(
        &self,
        contrasts: &[Option<Contrast>],
        (xs, y): (Range<usize>, usize),
        alphas: &[f32],
        map: &mut DepthMap,
    ) {
        let background_at = self.backdrop.map(|backdrop| backdrop.light_in_row(y));
        for x in xs {
            let at = y * self.color.width as usize + x;
            let alpha = match alphas[at] {
                found if found >= CONNECTED => found - CONNECTED,
                faint if faint < CONNECTED_FROM => faint,
                _ => 0.0,
            };
            let far_m = map.metres[at];
            if alpha > 0.5 {
                map.metres[at] = DepthMap::SUBJECT_M;
            }
            let is_pure = alpha > NEARLY_PURE;
            if alpha < 1.0 - NEARLY_PURE || is_pure && self.backdrop.is_none() {
                continue;
            }
            let own = self.light_at(at);
            let (background_alpha, difference) = match background_at.as_ref().map(|background_at| background_at(x)) {
                Some(light) if is_pure => (1.0, std::array::from_fn(|p| (own[p] - light[p]) / alpha)),
                light => {
                    let difference = match self.interpolate_surfaces(contrasts, (x, y), light) {
                        Some([near, far]) => color_difference(&near, &far, own, alpha),
                        None => [0.0; 3],
                    };
                    (if light.is_some() { 1.0 } else { 1.0 - alpha }, difference)
                }
            };
            let (at, near_m) = (at as u32, DepthMap::SUBJECT_M);
            map.matte.pixels.push(MixedPixel { at, near_m, far_m, alpha, background_alpha, difference });
        }
    }
}
