//! From a mask of the nearer surface, coarse and soft as a network gives it, to the matte of its picture.
//!
//! Where the mask is sure, pixels tell the colours of both surfaces close by: means and covariances, gathered in cells.
//! Along Fisher's discriminant between them, each pixel of the band where the mask is not sure has a place, and with that
//! a share: 0 or 1 as likely as the mask says, or anything between (mixed pixels, as in Bayesian matting, Chuang et al.
//! 2001).

mod backdrop;
mod cells;
mod posterior;

pub use backdrop::Backdrop;

use crate::color::light_of_codes;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap, Mask, Matte, MixedPixel};

use super::NEARLY_PURE;
use super::share::Contrast;
use cells::{Cell, Kernel, REACH, Sums, View};
use posterior::Posterior;

/// See [`DepthMap::SUBJECT_M`].
pub const SUBJECT_M: f32 = DepthMap::SUBJECT_M;
/// See [`DepthMap::FAR_M`].
pub const FAR_M: f32 = DepthMap::FAR_M;

/// So far from an outline, as a share of the picture's height, blur may show what is behind a subject.
const REVEALED: f32 = 0.035;

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
    let mut map = DepthMap { subject_m: Some(SUBJECT_M), ..DepthMap::new(color.width, color.height) };
    map.metres.fill(FAR_M);
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
    /// [`SUBJECT_M`], where `mask` and the colours say that it is; and the mixed pixels between the two. Where it is known
    /// what is behind, pixels near the outline are mixed ones, too, with all of that behind them.
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
        let MaskMatting { light, posterior, kernel, cells, wanted, sums, contrasts, shares, front, columns } = matting;
        let view = View { mask, color, light, backdrop, columns, cell_px, across, down };
        view.classify(cells);
        view.gather(cells, wanted, sums);
        contrasts.clear();
        for at in 0..across * down {
            let is_beside = cells[at] == Cell::Band || view.around(at, 1).any(|at| cells[at] == Cell::Band);
            let contrast = if is_beside { view.contrast(kernel, sums, (at / across, at % across)) } else { None };
            contrasts.push(contrast);
        }
        shares.resize(width * height, 0.0);
        front.clear();
        for cell in (0..across * down).filter(|&cell| cells[cell] == Cell::Band) {
            view.weigh(posterior, contrasts, cell, shares, front);
        }
        view.connect(cells, shares, front);
        let reach = (REVEALED * height as f32 / cell_px as f32).ceil() as usize;
        for cell in 0..across * down {
            match cells[cell] {
                Cell::Far => {}
                Cell::Near => {
                    if let Some(backdrop) =
                        backdrop.filter(|_| view.around(cell, reach).any(|at| cells[at] == Cell::Band))
                    {
                        view.reveal(backdrop, cell, map);
                    }
                    view.cover(cell, map);
                }
                Cell::Band => view.take_apart(contrasts[cell].as_ref(), cell, shares, map),
            }
        }
        if map.matte.pixels.len() > Matte::most(width, height) {
            map.matte.pixels.retain(|pixel| pixel.share < 1.0);
        }
        map.matte.pixels.sort_unstable_by_key(|pixel| pixel.at);
    }
}

impl View<'_> {
    /// The shares of the pixels of a cell; those that are sure to be of the nearer surface are added to `front`.
    #[inline(always)]
    fn weigh(
        &self,
        posterior: &Posterior,
        contrasts: &[Option<Contrast>],
        cell: usize,
        shares: &mut [f32],
        front: &mut Vec<u32>,
    ) {
        let own = contrasts[cell].as_ref().map(|own| (own, posterior.slice(own.precision())));
        for (x, y) in self.pixels_of(cell) {
            let at = y * self.color.width as usize + x;
            let (mask, light) = (self.share_at(x, y), self.light_at(at));
            let behind = self.backdrop.map(|backdrop| backdrop.light_at(x, y));
            let share = match (&own, behind) {
                (None, _) => mask,
                (Some((own, slice)), None) => {
                    slice.share(mask, self.between(contrasts, own, (x, y), |contrast| contrast.share(light)))
                }
                // Where it is known what is behind, the surfaces differ in another way at every pixel.
                (Some((own, _)), Some(behind)) => {
                    let place = self.between(contrasts, own, (x, y), |contrast| contrast.before(behind).share(light));
                    posterior.slice(own.before(behind).precision()).share(mask, place)
                }
            };
            shares[at] = share;
            if mask > NEAR_FROM && share > NEAR_FROM {
                shares[at] += FOUND;
                front.push(at as u32);
            }
        }
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

    #[inline(always)]
    fn take_apart(&self, contrast: Option<&Contrast>, cell: usize, shares: &[f32], map: &mut DepthMap) {
        for (x, y) in self.pixels_of(cell) {
            let at = y * self.color.width as usize + x;
            let share = match shares[at] {
                found if found >= FOUND => found - FOUND,
                faint if faint < JOINED_FROM => faint,
                _ => 0.0,
            };
            let far_m = map.metres[at];
            if share > 0.5 {
                map.metres[at] = SUBJECT_M;
            }
            let own = self.light_at(at);
            let (behind, difference) = match (self.backdrop.map(|backdrop| backdrop.light_at(x, y)), contrast) {
                (Some(light), _) if share > NEARLY_PURE => (1.0, std::array::from_fn(|p| (own[p] - light[p]) / share)),
                (Some(light), Some(contrast)) => (1.0, contrast.before(light).difference(own, share)),
                (None, Some(contrast)) => (1.0 - share, contrast.difference(own, share)),
                (_, None) => (1.0 - share, [0.0; 3]),
            };
            if (1.0 - NEARLY_PURE..=NEARLY_PURE).contains(&share) || behind == 1.0 && share > NEARLY_PURE {
                let (at, near_m) = (at as u32, SUBJECT_M);
                map.matte.pixels.push(MixedPixel { at, near_m, far_m, share, behind, difference });
            }
        }
    }

    /// Every pixel of a cell is the nearer surface's.
    fn cover(&self, cell: usize, map: &mut DepthMap) {
        for (x, y) in self.pixels_of(cell) {
            map.metres[y * self.color.width as usize + x] = SUBJECT_M;
        }
    }

    /// The pixels of a cell that is covered, with what is known to be behind them.
    fn reveal(&self, backdrop: &Backdrop, cell: usize, map: &mut DepthMap) {
        for (x, y) in self.pixels_of(cell) {
            let at = y * self.color.width as usize + x;
            let (own, light) = (self.light_at(at), backdrop.light_at(x, y));
            let difference = std::array::from_fn(|p| own[p] - light[p]);
            let (at, near_m, far_m) = (at as u32, SUBJECT_M, map.metres[at]);
            map.matte.pixels.push(MixedPixel { at, near_m, far_m, share: 1.0, behind: 1.0, difference });
        }
    }

    /// The share that the contrasts of the cells around a pixel give, linear between them, so that cells are not seen; `own` is
    /// the contrast of its cell.
    #[inline(always)]
    fn between(
        &self,
        contrasts: &[Option<Contrast>],
        own: &Contrast,
        (x, y): (usize, usize),
        share: impl Fn(&Contrast) -> f32,
    ) -> f32 {
        let half = 0.5 * self.cell_px as f32;
        let axis = |at: usize, count: usize| Tap::at((at as f32 + 0.5 - half) / self.cell_px as f32, count);
        let (across, down) = (axis(x, self.across), axis(y, self.down));
        let at = |row: usize, column: usize| {
            share(contrasts[row * self.across + column].as_ref().unwrap_or(own)).clamp(-0.5, 1.5)
        };
        let row = |row: usize| {
            let first = at(row, across.first);
            first + (at(row, across.second) - first) * across.share
        };
        let first = row(down.first);
        first + (row(down.second) - first) * down.share
    }
}
