//! Updates the background from a picture, a block of pixels at a time, vectorised.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::cells::Cells;
use super::{BackgroundMemory, FRAMES_PER_UPDATE};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::bitmap::Bitmap;
use crate::frame::{ColorImage, DepthMap};

/// Interval of the rows that one update covers.
const ROWS: usize = 2;
/// Upper bound of the round counter.
const MAX_ROUNDS: u8 = 250;
/// Rounds from which on a pixel's colour is only updated in one round of `REFRESH_ROUNDS`.
pub(super) const SURE: u8 = 8;
const REFRESH_ROUNDS: usize = 16;
/// Interval in rounds at which a hidden pixel's counter decreases by one.
const FADE_ROUNDS: usize = 2;
/// Minimum distance to another surface of an updated pixel, in pixels: camera and depth map mix both closer by.
const CLEAR_PX: usize = 3;
/// Maximum change of a channel, in codes, that counts as noise.
const CHANGED: i32 = 20;
/// Length of the running average: a new value has weight `1 / MEMORY`.
const MEMORY: i32 = 4;
/// Pixels of a row processed at once.
const BLOCK: usize = 32;

/// One value per pixel of a block, and the same with its neighbours.
type Lanes<T> = [T; BLOCK];
type WideLanes = [f32; BLOCK + 2 * CLEAR_PX];

impl BackgroundMemory {
    /// Updates the background from the rows that are due. A step of inverse depth above `surface_step` is another
    /// surface.
    pub(super) fn update_rows(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&DepthMap, &ColorImage),
        surface_step: f32,
    ) {
        let (size, update_index) = (self.size, self.frame / FRAMES_PER_UPDATE);
        self.assign_revision();
        self.mixed.clear(size);
        let (mut y, mut first) = (0, 0);
        for pixel in &map.matte.pixels {
            while pixel.at as usize >= first + size.0 {
                (y, first) = (y + 1, first + size.0);
            }
            self.mixed.set(pixel.at as usize - first, y);
        }
        let Self { rgb, inverse, rounds, mixed, codes, cells, .. } = self;
        let view = UpdateInput { map, color, surface_step, mixed, codes, cells, size, update_index };
        let bands = Bands::new(size.1, 1, workers);
        let planes = bands.split(rgb, 3 * size.0).zip(bands.split(inverse, size.0)).zip(bands.split(rounds, size.0));
        workers.run_each(bands.rows().zip(planes), &|(rows, ((rgb, inverse), rounds))| {
            Arch::new().dispatch(UpdateRows { view: &view, rows, rgb, inverse, rounds });
        });
    }
}

/// The input of an update.
struct UpdateInput<'a> {
    map: &'a DepthMap,
    color: &'a ColorImage,
    surface_step: f32,
    mixed: &'a Bitmap,
    /// Per code and channel, the code at the exposure of the remembered picture.
    codes: &'a [[u8; 256]; 3],
    cells: &'a Cells,
    size: (usize, usize),
    update_index: usize,
}

/// Updates some rows.
struct UpdateRows<'a> {
    view: &'a UpdateInput<'a>,
    rows: Range<usize>,
    rgb: &'a mut [u8],
    inverse: &'a mut [f32],
    rounds: &'a mut [u8],
}

impl WithSimd for UpdateRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { view, rows, rgb, inverse, rounds } = self;
        let (width, first) = (view.size.0, rows.start);
        let fades = view.fades();
        for y in rows.filter(|y| y % ROWS == view.update_index % ROWS) {
            let refreshes = view.refreshes(y);
            for begin in (0..width).step_by(BLOCK) {
                let count = (width - begin).min(BLOCK);
                // Most of the picture is well known, or hidden.
                if !refreshes && !view.cells.needs_update((begin, y), count, fades) {
                    continue;
                }
                let at = (y - first) * width + begin;
                let rounds = &mut rounds[at..][..count];
                let (rgb, inverse) = (&mut rgb[3 * at..][..3 * count], &mut inverse[at..][..count]);
                // Whole blocks with a constant number of pixels, so that all of them is vector code.
                match count {
                    BLOCK => view.update_block((begin, y), BLOCK, rgb, inverse, rounds),
                    count => view.update_block((begin, y), count, rgb, inverse, rounds),
                }
            }
        }
    }
}

impl UpdateInput<'_> {
    fn round(&self) -> usize {
        self.update_index / ROWS
    }

    /// Whether what is hidden fades in this round.
    fn fades(&self) -> bool {
        self.round().is_multiple_of(FADE_ROUNDS)
    }

    /// Whether the well-known colours of row `y` are updated in this round.
    fn refreshes(&self, y: usize) -> bool {
        (self.round() + y).is_multiple_of(REFRESH_ROUNDS)
    }

    /// Updates a block that begins at a pixel.
    #[inline(always)]
    fn update_block(
        &self,
        (begin, y): (usize, usize),
        count: usize,
        rgb: &mut [u8],
        inverse: &mut [f32],
        rounds: &mut [u8],
    ) {
        let (surface_step, at) = (self.surface_step, y * self.size.0 + begin);
        let (inverse, rounds) = (&mut inverse[..count], &mut rounds[..count]);
        let (fades, refreshes) = (self.fades(), self.refreshes(y));
        let (mut own, mut steps) = ([0.0; BLOCK], [0.0; BLOCK]);
        let metres = &self.map.metres[at..][..count];
        let (mut seen, mut is_hidden, mut is_sure) = ([0u32; BLOCK], [false; BLOCK], [true; BLOCK]);
        let mut is_idle = true;
        for k in 0..count {
            own[k] = DepthMap::inverse_depth(metres[k]);
            steps[k] = own[k] - inverse[k];
            seen[k] = u32::from(rounds[k]);
            is_hidden[k] = (steps[k] > surface_step) & (seen[k] > 0);
            is_sure[k] = (seen[k] >= u32::from(SURE)) & (steps[k] >= -surface_step) & !refreshes;
            is_idle &= if is_hidden[k] { !fades } else { is_sure[k] };
        }
        // Most blocks are well known, or hidden.
        if is_idle {
            return;
        }
        let is_clear = self.find_clear_pixels((begin, y), &own, count);
        let (mut now, mut kept) = ([[0i32; BLOCK]; 3], [[0i32; BLOCK]; 3]);
        let codes = &self.color.rgb[3 * at..][..3 * count];
        for k in 0..count {
            for p in 0..3 {
                now[p][k] = i32::from(self.codes[p][usize::from(codes[3 * k + p])]);
                kept[p][k] = i32::from(rgb[3 * k + p]);
            }
        }
        // The rounding offset rotates, so that rounding errors average out.
        let turn = i32::from(self.round() as i16) % MEMORY;
        for k in 0..count {
            let apart = [now[0][k] - kept[0][k], now[1][k] - kept[1][k], now[2][k] - kept[2][k]];
            let is_alike = (apart[0].abs() <= CHANGED) & (apart[1].abs() <= CHANGED) & (apart[2].abs() <= CHANGED);
            let is_same = (seen[k] > 0) & (steps[k].abs() <= surface_step) & is_alike;
            let learns = !is_hidden[k] & !is_sure[k] & is_clear[k];
            for p in 0..3 {
                let moved = if is_same { (apart[p] + turn).div_euclid(MEMORY) } else { apart[p] };
                kept[p][k] += if learns { moved } else { 0 };
            }
            let nearer = if is_same { inverse[k] + steps[k] / MEMORY as f32 } else { own[k] };
            inverse[k] = if learns { nearer } else { inverse[k] };
            let surer = if seen[k] < u32::from(MAX_ROUNDS) { seen[k] + 1 } else { u32::from(MAX_ROUNDS) };
            let surer = if is_same { surer } else { 1 };
            let fainter = seen[k] - u32::from(is_hidden[k] & fades);
            rounds[k] = if learns { surer } else { fainter } as u8;
        }
        for k in 0..count {
            for p in 0..3 {
                rgb[3 * k + p] = kept[p][k] as u8;
            }
        }
    }

    /// Returns which pixels of a block are clear of other surfaces; `own` is their inverse depth.
    #[inline(always)]
    fn find_clear_pixels(&self, (begin, y): (usize, usize), own: &Lanes<f32>, count: usize) -> Lanes<bool> {
        let ((width, height), metres, surface_step) = (self.size, &self.map.metres, self.surface_step);
        let first = begin.saturating_sub(CLEAR_PX);
        let (top, bottom) = (y.saturating_sub(CLEAR_PX), (y + CLEAR_PX).min(height - 1));
        let mut mixed = 0;
        for y in top..=bottom {
            mixed |= self.mixed.word_at(first, y);
        }
        mixed <<= first + CLEAR_PX - begin;
        let mut close = 0;
        for by in 0..=2 * CLEAR_PX {
            close |= mixed >> by;
        }
        let mut wide: WideLanes = [0.0; BLOCK + 2 * CLEAR_PX];
        wide[CLEAR_PX..][..BLOCK].copy_from_slice(own);
        for k in 0..CLEAR_PX {
            let (left, right) = ((begin + k).saturating_sub(CLEAR_PX), (begin + count + k).min(width - 1));
            wide[k] = DepthMap::inverse_depth(metres[y * width + left]);
            wide[CLEAR_PX + count + k] = DepthMap::inverse_depth(metres[y * width + right]);
        }
        let above = &metres[top * width + begin..][..count];
        let below = &metres[bottom * width + begin..][..count];
        let (left, right) = (&wide[..BLOCK], &wide[2 * CLEAR_PX..][..BLOCK]);
        let mut is_clear = [false; BLOCK];
        for k in 0..count {
            let (above, below) = (DepthMap::inverse_depth(above[k]), DepthMap::inverse_depth(below[k]));
            let is_flat = ((above - own[k]).abs() <= surface_step) & ((below - own[k]).abs() <= surface_step);
            let is_level = ((left[k] - own[k]).abs() <= surface_step) & ((right[k] - own[k]).abs() <= surface_step);
            is_clear[k] = is_flat & is_level & ((close >> k) as u32 & 1 == 0);
        }
        is_clear
    }
}
