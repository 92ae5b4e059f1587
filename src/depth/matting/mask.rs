//! From a mask of the nearer surface, coarse and soft as a network gives it, to the matte of its picture.
//!
//! Where the mask is sure, pixels tell the colours of both surfaces close by: means and covariances, gathered in cells.
//! Along Fisher's discriminant between them, each pixel of the band where the mask is not sure has a place, and with that
//! a share: 0 or 1 as likely as the mask says, or anything between (mixed pixels, as in Bayesian matting, Chuang et al.
//! 2001).

use crate::color::srgb_to_linear;
use crate::frame::{ColorImage, DepthMap, Mask, MixedPixel};

use super::clusters::{Color, Symmetric, outer};
use super::posterior::Posterior;
use super::share::Contrast;

/// Distance that a subject is given where distances are only relative, in metres.
pub const SUBJECT_M: f32 = 1.0;
/// What is then as good as infinitely far, in metres.
pub const FAR_M: f32 = 1e3;

/// From here on the mask is sure that a pixel is of the nearer surface, and below 1 less this, that it is not.
const SURE: f32 = 0.95;
/// Side of a cell in pixels of the mask, and the least in pixels of the picture.
const CELL_OF_MASK: f32 = 1.6;
const LEAST_CELL_PX: usize = 4;
/// So many cells in every direction tell the colours around one.
const REACH: usize = 5;
/// The weight of a cell falls to an eighth at this distance, in cells.
const HALF_CELLS: f32 = 1.5;
/// Less weight of pixels than this, of either surface, tells no colour.
const LEAST_WEIGHT: f32 = 0.5;
/// What is of the nearer surface by mask and colour is so from here on; what is joined to it, from the second on.
const NEAR_FROM: f32 = 0.6;
const JOINED_FROM: f32 = 0.15;
/// Marks a share that is found to be joined.
const FOUND: f32 = 2.0;
/// Shares beyond this are those of a pure pixel.
const NEARLY_PURE: f32 = 0.98;

/// Finds mattes; owns the memory for it.
#[derive(Debug)]
pub struct MaskMatting {
    light: Box<[f32; 256]>,
    posterior: Posterior,
    /// What the weights of the cells around one are, by row and column.
    kernel: [[f32; 2 * REACH + 1]; 2 * REACH + 1],
    cells: Vec<Cell>,
    /// Whether the colours of a cell are wanted.
    wanted: Vec<bool>,
    sums: Vec<Sums>,
    contrasts: Vec<Option<Contrast>>,
    /// The share of each pixel of the band, and [`FOUND`] more where it is joined to the rest of the surface.
    shares: Vec<f32>,
    front: Vec<u32>,
    columns: Vec<(usize, usize, f32)>,
}

/// The depth of a picture in which `mask` has the subject, all else being far.
pub fn depth_around(mask: &Mask, color: &ColorImage) -> DepthMap {
    let mut map = DepthMap { subject_m: Some(SUBJECT_M), ..DepthMap::new(color.width, color.height) };
    map.metres.fill(FAR_M);
    MaskMatting::default().find(mask, color, SUBJECT_M, &mut map);
    map
}

/// What a mask says of a cell of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    Near,
    Far,
    /// In the band, or beside it.
    Band,
}

/// Pixels of both surfaces in a cell, [`SURFACE`] sums each: how many, their light, and the products of that.
#[derive(Clone, Copy, Debug)]
struct Sums([f32; 2 * SURFACE]);

/// Sums of a surface: ten, and up to whole vectors.
const SURFACE: usize = 12;
/// Places of the near and of the far surface.
const NEAR: usize = 0;
const FAR: usize = 1;

impl Sums {
    const NONE: Self = Self([0.0; 2 * SURFACE]);

    #[inline(always)]
    fn add(&mut self, surface: usize, light: [f32; 3]) {
        let sums = &mut self.0[surface * SURFACE..][..SURFACE];
        let [xx, xy, xz, yy, yz, zz] = outer(light);
        let values = [1.0, light[0], light[1], light[2], xx, xy, xz, yy, yz, zz, 0.0, 0.0];
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    #[inline(always)]
    fn add_all(&mut self, other: &Self, weight: f32) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, value)| *sum += weight * value);
    }

    /// The colours of both; `None` where there are too few pixels of one.
    fn colors(&self) -> Option<[Color; 2]> {
        let weights = [self.0[0], self.0[SURFACE]];
        let color = |k: usize| {
            let sums = &self.0[k * SURFACE + 1..];
            let squares: Symmetric = std::array::from_fn(|k| sums[3 + k]);
            Color::of_sums(weights[k], std::array::from_fn(|k| sums[k]), squares)
        };
        weights.iter().all(|&weight| weight > LEAST_WEIGHT).then(|| [color(NEAR), color(FAR)])
    }
}

impl Default for MaskMatting {
    fn default() -> Self {
        let weight = |row: usize, column: usize| {
            let square = (row.abs_diff(REACH).pow(2) + column.abs_diff(REACH).pow(2)) as f32;
            (1.0 + square / (HALF_CELLS * HALF_CELLS)).powi(-3)
        };
        Self {
            light: Box::new(std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0))),
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

/// A picture, and what is sought in it.
struct View<'a> {
    mask: &'a Mask,
    color: &'a ColorImage,
    light: &'a [f32; 256],
    /// Per column of the picture, those of the mask on both sides, and how far it is to the second.
    columns: &'a [(usize, usize, f32)],
    cell_px: usize,
    across: usize,
    down: usize,
}

impl MaskMatting {
    /// Gives `map`, as large as its picture, which has the metres of what is behind everywhere, those of the nearer surface,
    /// `near_m`, where `mask` and the colours say that it is; and the mixed pixels between the two.
    pub fn find(&mut self, mask: &Mask, color: &ColorImage, near_m: f32, map: &mut DepthMap) {
        map.matte.pixels.clear();
        let (width, height) = (color.width as usize, color.height as usize);
        if map.size() != color.size() || mask.share.is_empty() || width * height == 0 {
            return;
        }
        pulp::Arch::new().dispatch(Finding { matting: self, mask, color, near_m, map });
    }
}

/// What [`MaskMatting::find`] is given.
struct Finding<'a> {
    matting: &'a mut MaskMatting,
    mask: &'a Mask,
    color: &'a ColorImage,
    near_m: f32,
    map: &'a mut DepthMap,
}

impl pulp::WithSimd for Finding<'_> {
    type Output = ();
    // No vectors by hand: the call lets the compiler make them of these loops, as wide as the processor has them.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { matting, mask, color, near_m, map } = self;
        let (width, height) = (color.width as usize, color.height as usize);
        let cell_px = ((CELL_OF_MASK * width as f32 / mask.width as f32).round() as usize).max(LEAST_CELL_PX);
        matting.columns.clear();
        matting.columns.extend((0..width).map(|x| between(x, width, mask.width as usize)));
        let (across, down) = (width.div_ceil(cell_px), height.div_ceil(cell_px));
        let MaskMatting { light, posterior, kernel, cells, wanted, sums, contrasts, shares, front, columns } = matting;
        let view = View { mask, color, light, columns, cell_px, across, down };
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
        for cell in 0..across * down {
            match cells[cell] {
                Cell::Far => {}
                Cell::Near => {
                    view.pixels_of(cell).for_each(|(x, y)| map.metres[y * width + x] = near_m);
                }
                Cell::Band => view.take_apart(contrasts[cell].as_ref(), cell, shares, near_m, map),
            }
        }
        map.matte.pixels.sort_unstable_by_key(|pixel| pixel.at);
    }
}

impl View<'_> {
    #[inline(always)]
    fn pixels_of(&self, cell: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (side, width, height) = (self.cell_px, self.color.width as usize, self.color.height as usize);
        let (row, column) = (cell / self.across, cell % self.across);
        let xs = column * side..((column + 1) * side).min(width);
        (row * side..((row + 1) * side).min(height)).flat_map(move |y| xs.clone().map(move |x| (x, y)))
    }

    #[inline(always)]
    fn light_at(&self, at: usize) -> [f32; 3] {
        [0, 1, 2].map(|p| self.light[usize::from(self.color.rgb[3 * at + p])])
    }

    /// The mask at a pixel, linear between its own.
    #[inline(always)]
    fn share_at(&self, x: usize, y: usize) -> f32 {
        let (above, below, down) = between(y, self.color.height as usize, self.mask.height as usize);
        let (left, right, along) = self.columns[x];
        let row = |row: usize| {
            let row = &self.mask.share[row * self.mask.width as usize..];
            row[left] + (row[right] - row[left]) * along
        };
        row(above) + (row(below) - row(above)) * down
    }

    fn classify(&self, cells: &mut Vec<Cell>) {
        let (across, down, mask) = (self.across, self.down, self.mask);
        let range = |of: usize, count: usize, side: usize| {
            // The pixels of the mask around a cell, with those beside them: the band is a cell wider than it needs be.
            let scale = side as f32 / count as f32;
            let start = (of as f32 * scale - 1.0).max(0.0) as usize;
            start.min(side - 1)..(((of + 1) as f32 * scale + 1.0).ceil() as usize).min(side)
        };
        cells.clear();
        for row in 0..down {
            let ys = range(row, down, mask.height as usize);
            for column in 0..across {
                let xs = range(column, across, mask.width as usize);
                let (mut low, mut high) = (1.0f32, 0.0f32);
                for y in ys.clone() {
                    for &share in &mask.share[y * mask.width as usize..][xs.clone()] {
                        (low, high) = (low.min(share), high.max(share));
                    }
                }
                cells.push(match () {
                    () if low > SURE => Cell::Near,
                    () if high < 1.0 - SURE => Cell::Far,
                    () => Cell::Band,
                });
            }
        }
    }

    /// The colours of the cells that are in the band, or in reach of it.
    #[inline(always)]
    fn gather(&self, cells: &[Cell], wanted: &mut Vec<bool>, sums: &mut Vec<Sums>) {
        let (across, down) = (self.across, self.down);
        sums.clear();
        sums.resize(across * down, Sums::NONE);
        wanted.clear();
        wanted.resize(across * down, false);
        for row in 0..down {
            for column in (0..across).filter(|column| cells[row * across + column] == Cell::Band) {
                for row in row.saturating_sub(REACH)..(row + REACH + 1).min(down) {
                    let columns = column.saturating_sub(REACH)..(column + REACH + 1).min(across);
                    wanted[row * across..][columns].fill(true);
                }
            }
        }
        for at in (0..across * down).filter(|&at| wanted[at]) {
            let sums = &mut sums[at];
            for (x, y) in self.pixels_of(at).filter(|(x, y)| (x + y) % 2 == 0) {
                let light = || self.light_at(y * self.color.width as usize + x);
                match cells[at] {
                    Cell::Near => sums.add(NEAR, light()),
                    Cell::Far => sums.add(FAR, light()),
                    Cell::Band => {
                        let share = self.share_at(x, y);
                        if share > SURE {
                            sums.add(NEAR, light());
                        } else if share < 1.0 - SURE {
                            sums.add(FAR, light());
                        }
                    }
                }
            }
        }
    }

    /// How the colours around a cell differ; `None` where one of the surfaces has none.
    #[inline(always)]
    fn contrast(
        &self,
        kernel: &[[f32; 2 * REACH + 1]; 2 * REACH + 1],
        sums: &[Sums],
        (row, column): (usize, usize),
    ) -> Option<Contrast> {
        let mut around = Sums::NONE;
        for other_row in row.saturating_sub(REACH)..(row + REACH + 1).min(self.down) {
            let weights = &kernel[other_row + REACH - row];
            for other in column.saturating_sub(REACH)..(column + REACH + 1).min(self.across) {
                around.add_all(&sums[other_row * self.across + other], weights[other + REACH - column]);
            }
        }
        around.colors().map(Contrast::of)
    }

    /// The cells up to so many away from one, and itself.
    fn around(&self, at: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (across, row, column) = (self.across, at / self.across, at % self.across);
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(across);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.down);
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

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
        let own = contrasts[cell].as_ref();
        let slice = own.map(|contrast| (contrast, posterior.slice(contrast.precision())));
        for (x, y) in self.pixels_of(cell) {
            let at = y * self.color.width as usize + x;
            let mask = self.share_at(x, y);
            let place = |contrast: &Contrast| self.place(contrasts, contrast, (x, y), self.light_at(at));
            let share = slice.as_ref().map_or(mask, |(contrast, slice)| slice.share(mask, place(contrast)));
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
    fn take_apart(&self, contrast: Option<&Contrast>, cell: usize, shares: &[f32], near_m: f32, map: &mut DepthMap) {
        for (x, y) in self.pixels_of(cell) {
            let at = y * self.color.width as usize + x;
            let share = match shares[at] {
                found if found >= FOUND => found - FOUND,
                faint if faint < JOINED_FROM => faint,
                _ => 0.0,
            };
            let far_m = map.metres[at];
            if share > 0.5 {
                map.metres[at] = near_m;
            }
            if (1.0 - NEARLY_PURE..=NEARLY_PURE).contains(&share) {
                let own = self.light_at(at);
                let difference = contrast.map_or([0.0; 3], |contrast| contrast.difference(own, share));
                map.matte.pixels.push(MixedPixel { at: at as u32, near_m, far_m, share, difference });
            }
        }
    }

    /// Where the colour of a pixel lies between those of the two surfaces, linear between the cells around it, so that cells
    /// are not seen; `own` is the contrast of its cell.
    #[inline(always)]
    fn place(&self, contrasts: &[Option<Contrast>], own: &Contrast, (x, y): (usize, usize), light: [f32; 3]) -> f32 {
        let half = 0.5 * self.cell_px as f32;
        let axis = |at: usize, count: usize| {
            let place = ((at as f32 + 0.5 - half) / self.cell_px as f32).clamp(0.0, (count - 1) as f32);
            (place as usize, (place as usize + 1).min(count - 1), place.fract())
        };
        let ((left, right, along), (above, below, down)) = (axis(x, self.across), axis(y, self.down));
        let at = |row: usize, column: usize| {
            contrasts[row * self.across + column].as_ref().unwrap_or(own).share(light).clamp(-0.5, 1.5)
        };
        let row = |row: usize| {
            let first = at(row, left);
            first + (at(row, right) - first) * along
        };
        let first = row(above);
        first + (row(below) - first) * down
    }
}

/// The samples on both sides of the centre of pixel `at`, where `to` pixels and `from` samples cover the same length; and
/// how far it is to the second.
fn between(at: usize, to: usize, from: usize) -> (usize, usize, f32) {
    let place = ((at as f32 + 0.5) * from as f32 / to as f32 - 0.5).clamp(0.0, (from - 1) as f32);
    let first = place as usize;
    (first, (first + 1).min(from - 1), place - first as f32)
}
