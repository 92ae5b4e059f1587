//! From a mask of the nearer surface, coarse and soft as a network gives it, to the matte of its picture.
//!
//! Where the mask is sure, pixels tell the colours of both surfaces close by: means and covariances, gathered in cells.
//! Along Fisher's discriminant between them, each pixel of the band where the mask is not sure has a place, and with that
//! a share: 0 or 1 as likely as the mask says, or anything between (mixed pixels, as in Bayesian matting, Chuang et al.
//! 2001).

mod backdrop;
mod cells;
mod posterior;

use std::ops::Range;

pub use backdrop::Backdrop;

use crate::color::light_of_codes;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap, Mask, Matte, MixedPixel};

use super::NEARLY_PURE;
use super::clusters::Color;
use super::contrast::{Contrast, Discriminant, difference};
use cells::{Cell, Kernel, REACH, Sums, View};
use posterior::Posterior;

/// Side of a cell in pixels of the mask, and the least in pixels of the picture.
const CELL_OF_MASK: f32 = 1.6;
const LEAST_CELL_PX: usize = 4;
/// The weight of a cell falls to an eighth at this distance, in cells.
const HALF_CELLS: f32 = 1.5;
/// What is of the nearer surface by mask and colour is so from here on; what is joined to it, from the second on.
const NEAR_FROM: f32 = 0.6;
const JOINED_FROM: f32 = 0.15;
/// Marks a share that is found to be joined.
const FOUND: f32 = 2.0;

/// Finds mattes; owns the memory for it.
#[derive(Debug)]
pub struct MaskMatting {
    light: Box<[f32; 256]>,
    posterior: Posterior,
    kernel: Kernel,
    cells: Vec<Cell>,
    /// Lowest and highest share of columns of the mask.
    ends: Vec<[f32; 2]>,
    /// Whether the colours of a cell are wanted.
    wanted: Vec<bool>,
    sums: Vec<Sums>,
    contrasts: Vec<Option<Contrast>>,
    /// The share of each pixel of the band, and [`FOUND`] more where it is joined to the rest of the surface.
    shares: Vec<f32>,
    front: Vec<u32>,
    columns: Vec<Tap>,
}

/// The depth of a picture in which `mask` has the subject, all else being far.
pub fn depth_around(mask: &Mask, color: &ColorImage) -> DepthMap {
    let mut map = DepthMap { subject_m: Some(DepthMap::SUBJECT_M), ..DepthMap::new(color.width, color.height) };
    map.metres.fill(DepthMap::FAR_M);
    MaskMatting::default().find(mask, color, None, &mut map);
    map
}

impl Default for MaskMatting {
    fn default() -> Self {
        let weight = |row: usize, column: usize| {
            let square = (row.abs_diff(REACH).pow(2) + column.abs_diff(REACH).pow(2)) as f32;
            (1.0 + square / (HALF_CELLS * HALF_CELLS)).powi(-3)
        };
        Self {
            light: light_of_codes(),
            posterior: Posterior::new(),
            kernel: std::array::from_fn(|row| std::array::from_fn(|column| weight(row, column))),
            cells: Vec::new(),
            ends: Vec::new(),
            wanted: Vec::new(),
            sums: Vec::new(),
            contrasts: Vec::new(),
            shares: Vec::new(),
            front: Vec::new(),
            columns: Vec::new(),
        }
    }
}

impl MaskMatting {
    /// Gives `map`, as large as its picture, which has the metres of what is behind everywhere, those of the nearer surface,
    /// [`DepthMap::SUBJECT_M`], where `mask` and the colours say that it is; and the mixed pixels between the two. Where it is
    /// known what is behind, pixels near the outline are mixed ones, too, with all of that behind them.
    pub fn find(&mut self, mask: &Mask, color: &ColorImage, backdrop: Option<&Backdrop>, map: &mut DepthMap) {
        map.matte.pixels.clear();
        let (width, height) = (color.width as usize, color.height as usize);
        let backdrop = backdrop.filter(|backdrop| backdrop.color.size() == color.size());
        if map.size() != color.size() || mask.share.is_empty() || width * height == 0 {
            return;
        }
        pulp::Arch::new().dispatch(Finding { matting: self, mask, color, backdrop, map });
    }
}

/// What [`MaskMatting::find`] is given.
struct Finding<'a> {
    matting: &'a mut MaskMatting,
    mask: &'a Mask,
    color: &'a ColorImage,
    backdrop: Option<&'a Backdrop<'a>>,
    map: &'a mut DepthMap,
}

impl pulp::WithSimd for Finding<'_> {
    type Output = ();
    // No vectors by hand: the call lets the compiler make them of these loops, as wide as the processor has them.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { matting, mask, color, backdrop, map } = self;
        let (width, height) = (color.width as usize, color.height as usize);
        let cell_px = ((CELL_OF_MASK * width as f32 / mask.width as f32).round() as usize).max(LEAST_CELL_PX);
        matting.columns.clear();
        matting.columns.extend((0..width).map(|x| Tap::new(x, width, mask.width as usize)));
        let (across, down) = (width.div_ceil(cell_px), height.div_ceil(cell_px));
        let MaskMatting { light, posterior, kernel, cells, ends, wanted, sums, contrasts, shares, front, columns } =
            matting;
        let view = View { mask, color, light, backdrop, columns, cell_px, across, down };
        view.classify(cells, ends);
        view.gather(cells, wanted, sums);
        contrasts.clear();
        for at in 0..across * down {
            let is_beside = || cells[at] == Cell::Band || view.around(at, 1).any(|at| cells[at] == Cell::Band);
            let place = (at / across, at % across);
            contrasts.push(if wanted[at] && is_beside() { view.contrast(kernel, sums, place) } else { None });
        }
        shares.resize(width * height, 0.0);
        front.clear();
        for cell in (0..across * down).filter(|&cell| cells[cell] == Cell::Band) {
            view.weigh(posterior, contrasts, (cell / across, cell % across), shares, front);
        }
        view.connect(cells, shares, front);
        // Row by row, so that the pixels of the matte come in their order.
        for row in 0..down {
            for y in view.rows_of(row) {
                for column in 0..across {
                    let (cell, xs) = (row * across + column, view.columns_of(column));
                    match cells[cell] {
                        Cell::Far => {}
                        Cell::Near => {
                            // So far from the outline, blur may show what is behind.
                            if let Some(backdrop) = backdrop.filter(|_| wanted[cell]) {
                                view.reveal(backdrop, (xs.clone(), y), map);
                            }
                            map.metres[y * width..][xs].fill(DepthMap::SUBJECT_M);
                        }
                        Cell::Band => view.take_apart(contrasts, (xs, y), shares, map),
                    }
                }
            }
        }
        if map.matte.pixels.len() > Matte::most(width, height) {
            map.matte.pixels.retain(|pixel| pixel.share < 1.0);
        }
    }
}

impl View<'_> {
    /// The shares of the pixels of a cell; those that are sure to be of the nearer surface are added to `front`.
    #[inline(always)]
    fn weigh(
        &self,
        posterior: &Posterior,
        contrasts: &[Option<Contrast>],
        (row, column): (usize, usize),
        shares: &mut [f32],
        front: &mut Vec<u32>,
    ) {
        let at = |(row, column): (usize, usize)| contrasts[row * self.across + column].as_ref();
        for y in self.rows_of(row) {
            let (mask_at, down) = (self.shares_in(y), self.cells_around(y, self.down));
            let behind = self.backdrop.map(|backdrop| backdrop.row(y));
            let xs = self.columns_of(column);
            let middle = (xs.start + self.cell_px / 2).min(xs.end);
            for xs in [xs.start..middle, middle..xs.end] {
                // The same four cells are around all of them.
                let Some(first) = xs.clone().next() else { continue };
                let across = self.cells_around(first, self.across);
                let corners = [
                    (down.first, across.first),
                    (down.second, across.first),
                    (down.first, across.second),
                    (down.second, across.second),
                ]
                .map(at);
                // Where a cell knows nothing of colours, they count the less the closer to it.
                let any = at((row, column)).or_else(|| corners.into_iter().flatten().next());
                // One or the other, as it is known what is behind.
                let (unknown, known) = (any.filter(|_| behind.is_none()), any.filter(|_| behind.is_some()));
                let line_of = |any: &Contrast, corner: Option<&Contrast>| match (corner.map(Contrast::line), any.line())
                {
                    (Some(line), _) => line,
                    (None, [x, y, z, offset, _]) => [x, y, z, offset, 0.0],
                };
                let lines = unknown.map(|any| Sides::of(corners.map(|corner| line_of(any, corner)), down.share));
                let front_of = |any, corner: Option<&Contrast>| corner.unwrap_or(any).front();
                let fronts = known.map(|any| Sides::of(corners.map(|corner| front_of(any, corner)), down.share));
                for x in xs {
                    let place = y * self.color.width as usize + x;
                    let (mask, light) = (mask_at(x), self.light_at(place));
                    let along = self.cells_around(x, self.across).share;
                    // Where it is known what is behind, the surfaces differ in another way at every pixel.
                    let discriminant: Option<Discriminant> = match (&behind, &lines, &fronts) {
                        (None, Some(lines), _) => Some(lines.between(along).into()),
                        (Some(behind), _, Some(fronts)) => Some(Discriminant::before(fronts.between(along), behind(x))),
                        _ => None,
                    };
                    let share = match discriminant {
                        Some(own) => posterior.share(mask, own.share(light), own.precision),
                        None => mask,
                    };
                    shares[place] = share;
                    if mask > NEAR_FROM && share > NEAR_FROM {
                        shares[place] += FOUND;
                        front.push(place as u32);
                    }
                }
            }
        }
    }

    /// The colours of both surfaces at a pixel, linear between those of the cells around it that have some; the far one has this
    /// light where that is known.
    #[inline(always)]
    fn surfaces_at(
        &self,
        contrasts: &[Option<Contrast>],
        (x, y): (usize, usize),
        light: Option<[f32; 3]>,
    ) -> Option<[Color; 2]> {
        let (across, down) = (self.cells_around(x, self.across), self.cells_around(y, self.down));
        let (mut sum, mut total) = ([Color::default(); 2], 0.0);
        for (row, of_row) in [(down.first, 1.0 - down.share), (down.second, down.share)] {
            for (column, of_column) in [(across.first, 1.0 - across.share), (across.second, across.share)] {
                if let Some(contrast) = &contrasts[row * self.across + column] {
                    let weight = of_row * of_column;
                    total += weight;
                    sum.iter_mut().zip(&contrast.before(light)).for_each(|(sum, color)| sum.add(weight, color));
                }
            }
        }
        if total > 0.0 { Some(sum.map(|color| color.scaled(1.0 / total))) } else { None }
    }

    /// The cells, across or down, whose middles a pixel lies between: what is linear between them shows no cells.
    #[inline(always)]
    fn cells_around(&self, at: usize, count: usize) -> Tap {
        let half = 0.5 * self.cell_px as f32;
        Tap::at((at as f32 + 0.5 - half) / self.cell_px as f32, count)
    }

    /// Marks what is joined to the surest pixels: what only has the colours of the nearer surface is not.
    fn connect(&self, cells: &[Cell], shares: &mut [f32], front: &mut Vec<u32>) {
        let (width, height) = (self.color.width as usize, self.color.height as usize);
        let is_band = |x: usize, y: usize| cells[y / self.cell_px * self.across + x / self.cell_px] == Cell::Band;
        while let Some(at) = front.pop() {
            let (x, y) = (at as usize % width, at as usize / width);
            for y in y.saturating_sub(1)..(y + 2).min(height) {
                for x in x.saturating_sub(1)..(x + 2).min(width) {
                    let share = &mut shares[y * width + x];
                    if (JOINED_FROM..FOUND).contains(share) && is_band(x, y) {
                        *share += FOUND;
                        front.push((y * width + x) as u32);
                    }
                }
            }
        }
    }

    /// Gives the pixels of a row of a cell their surface, and the mixed ones both.
    #[inline(always)]
    fn take_apart(
        &self,
        contrasts: &[Option<Contrast>],
        (xs, y): (Range<usize>, usize),
        shares: &[f32],
        map: &mut DepthMap,
    ) {
        let backdrop = self.backdrop.map(|backdrop| backdrop.row(y));
        for x in xs {
            let at = y * self.color.width as usize + x;
            let share = match shares[at] {
                found if found >= FOUND => found - FOUND,
                faint if faint < JOINED_FROM => faint,
                _ => 0.0,
            };
            let far_m = map.metres[at];
            if share > 0.5 {
                map.metres[at] = DepthMap::SUBJECT_M;
            }
            let is_pure = share > NEARLY_PURE;
            if share < 1.0 - NEARLY_PURE || is_pure && self.backdrop.is_none() {
                continue;
            }
            let own = self.light_at(at);
            let (behind, difference) = match backdrop.as_ref().map(|behind| behind(x)) {
                Some(light) if is_pure => (1.0, std::array::from_fn(|p| (own[p] - light[p]) / share)),
                light => {
                    let difference = match self.surfaces_at(contrasts, (x, y), light) {
                        Some([near, far]) => difference(&near, &far, own, share),
                        None => [0.0; 3],
                    };
                    (if light.is_some() { 1.0 } else { 1.0 - share }, difference)
                }
            };
            let (at, near_m) = (at as u32, DepthMap::SUBJECT_M);
            map.matte.pixels.push(MixedPixel { at, near_m, far_m, share, behind, difference });
        }
    }

    /// Gives pixels that are covered what is known to be behind them.
    #[inline(always)]
    fn reveal(&self, backdrop: &Backdrop, (xs, y): (Range<usize>, usize), map: &mut DepthMap) {
        let (row, behind) = (y * self.color.width as usize, backdrop.row(y));
        let metres = &map.metres[row..];
        map.matte.pixels.extend(xs.map(|x| {
            let (own, light) = (self.light_at(row + x), behind(x));
            let difference = std::array::from_fn(|p| own[p] - light[p]);
            let (at, near_m, far_m) = ((row + x) as u32, DepthMap::SUBJECT_M, metres[x]);
            MixedPixel { at, near_m, far_m, share: 1.0, behind: 1.0, difference }
        }));
    }
}

/// Numbers on the left and on the right of some pixels.
struct Sides<const N: usize>([[f32; N]; 2]);

impl<const N: usize> Sides<N> {
    /// Between those on the left above and below, and those on the right.
    #[inline(always)]
    fn of([left, below_left, right, below_right]: [[f32; N]; 4], down: f32) -> Self {
        Self([mixed(&left, &below_left, down), mixed(&right, &below_right, down)])
    }

    #[inline(always)]
    fn between(&self, along: f32) -> [f32; N] {
        mixed(&self.0[0], &self.0[1], along)
    }
}

#[inline(always)]
fn mixed<const N: usize>(a: &[f32; N], b: &[f32; N], share: f32) -> [f32; N] {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * share)
}
