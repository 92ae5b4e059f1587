//! Pass `fill`: what near objects hide is filled in from around them, colour and CoC, before the bins behind are
//! taken. Pull-push: averages over ever larger areas, of known pixels only, flow back into the holes.

use std::sync::atomic::AtomicBool;

use super::rows::{Rows, repeat_ends};
use super::team::{Shelf, Team};
use crate::bokeh::plan::Share;

/// Planes of a level: premultiplied colour and CoC, and how much of it is known.
const PLANES: usize = 5;

/// The pyramid, finest level (half the picture's size) first.
pub struct Pyramid {
    levels: Vec<Level>,
    /// How far a pixel of the finest level is covered by something near.
    hidden: Vec<f32>,
    /// The same of a pixel or any of its neighbours.
    around: Vec<f32>,
    taken: Vec<AtomicBool>,
}

struct Level {
    width: usize,
    height: usize,
    /// `[pixel][PLANES]`.
    data: Vec<[f32; PLANES]>,
}

impl Pyramid {
    /// Memory for pictures of `width` x `height`.
    pub fn new(width: usize, height: usize) -> Self {
        let mut levels = Vec::new();
        let (mut w, mut h) = (width.div_ceil(2), height.div_ceil(2));
        loop {
            levels.push(Level { width: w, height: h, data: vec![[0.0; PLANES]; w * h] });
            if w == 1 && h == 1 {
                break;
            }
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        let hidden = vec![0.0; levels[0].width * levels[0].height];
        let taken = (0..height).map(|_| AtomicBool::new(false)).collect();
        Self { levels, around: hidden.clone(), hidden, taken }
    }

    /// Replaces, in `scene`, what belongs to near bins (`front` is the share of everything behind them) and the
    /// mixed pixels around it. Filled CoC is at least `nearest_px`, the border of the near bins.
    pub fn fill(&mut self, team: &mut Team, scene: &mut Rows<4>, size: (usize, usize), front: Share, nearest_px: f32) {
        self.start(team, scene, size, front);
        for k in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&fine[k - 1], &mut coarse[0]);
            let rows = Shelf::new(&mut coarse.data, coarse.width, &mut self.taken);
            team.run(coarse.height, &|y| pull(fine, y, rows.part(y)));
        }
        for k in (1..self.levels.len()).rev() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&mut fine[k - 1], &coarse[0]);
            let rows = Shelf::new(&mut fine.data, fine.width, &mut self.taken);
            team.run(fine.height, &|y| push(coarse, y, rows.part(y)));
        }
        self.finish(team, scene, size, nearest_px);
    }

    /// The finest level: known is what no near pixel touches, nor its neighbours.
    fn start(&mut self, team: &mut Team, scene: &Rows<4>, (width, height): (usize, usize), front: Share) {
        let level = &mut self.levels[0];
        let (w, h) = (level.width, level.height);
        let hidden = Shelf::new(&mut self.hidden, w, &mut self.taken);
        team.run(h, &|y| {
            let rows = [scene.plane(2 * y, 3), scene.plane((2 * y + 1).min(height - 1), 3)];
            for (x, hidden) in hidden.part(y).iter_mut().enumerate() {
                let columns = [2 * x, (2 * x + 1).min(width - 1)];
                let least = |row: &[f32]| front.at(row[columns[0]]).min(front.at(row[columns[1]]));
                *hidden = 1.0 - least(rows[0]).min(least(rows[1]));
            }
        });
        let hidden = &self.hidden;
        let around = Shelf::new(&mut self.around, w, &mut self.taken);
        team.run(h, &|y| {
            let rows = [y.saturating_sub(1), y, (y + 1).min(h - 1)].map(|y| &hidden[y * w..][..w]);
            let column = |x: usize| rows[0][x].max(rows[1][x]).max(rows[2][x]);
            let (mut left, mut here) = (0.0f32, column(0));
            for (x, out) in around.part(y).iter_mut().enumerate() {
                let right = if x + 1 < w { column(x + 1) } else { 0.0 };
                *out = left.max(here).max(right);
                (left, here) = (here, right);
            }
        });
        let around = &self.around;
        let data = Shelf::new(&mut level.data, w, &mut self.taken);
        team.run(h, &|y| {
            let around = &around[y * w..][..w];
            let plane = |row: usize, p: usize| scene.plane((2 * y + row).min(height - 1), p);
            let planes: [[&[f32]; 4]; 2] = std::array::from_fn(|row| std::array::from_fn(|p| plane(row, p)));
            for (x, pixel) in data.part(y).iter_mut().enumerate() {
                if around[x] > 0.0 {
                    *pixel = [0.0; PLANES];
                    continue;
                }
                let columns = [2 * x, (2 * x + 1).min(width - 1)];
                for (p, value) in pixel[..4].iter_mut().enumerate() {
                    let sum = |row: &[&[f32]; 4]| row[p][columns[0]] + row[p][columns[1]];
                    *value = 0.25 * (sum(&planes[0]) + sum(&planes[1]));
                }
                pixel[4] = 1.0;
            }
        });
    }

    fn finish(&mut self, team: &mut Team, scene: &mut Rows<4>, (width, height): (usize, usize), nearest_px: f32) {
        let (level, around) = (&self.levels[0], &self.around);
        let (stride, pad, row_len) = (scene.stride, scene.pad, scene.row_len());
        let rows = Shelf::new(&mut scene.data, row_len, &mut self.taken);
        team.run(height, &|y| {
            let around = &around[y / 2 * level.width..][..level.width];
            if around.iter().all(|&hidden| hidden <= 0.0) {
                return;
            }
            let row = rows.part(y);
            for (x, fill) in level.data[y / 2 * level.width..][..level.width].iter().enumerate() {
                if around[x] > 0.0 {
                    for x in 2 * x..(2 * x + 2).min(width) {
                        (0..3).for_each(|p| row[p * stride + pad + x] = fill[p]);
                        row[3 * stride + pad + x] = fill[3].max(nearest_px);
                    }
                }
            }
            row.chunks_exact_mut(stride).for_each(|plane| repeat_ends(plane, pad, width));
        });
    }
}

/// Averages four pixels; knowing a little is spread, so that the coarsest level knows something if anyone does.
fn pull(fine: &Level, y: usize, row: &mut [[f32; PLANES]]) {
    for (x, out) in row.iter_mut().enumerate() {
        let mut sum = [0.0f32; PLANES];
        for sub in 0..4 {
            let (px, py) = (2 * x + sub % 2, 2 * y + sub / 2);
            if px < fine.width && py < fine.height {
                let pixel = &fine.data[py * fine.width + px];
                sum.iter_mut().zip(pixel).for_each(|(s, v)| *s += v);
            }
        }
        let scale = 1.0 / sum[4].max(1.0);
        *out = sum.map(|v| v * scale);
    }
}

/// Fills what the finer level does not know from the coarser one.
fn push(coarse: &Level, y: usize, row: &mut [[f32; PLANES]]) {
    // Linear interpolation: three parts of the coarse pixel above this one, one of its neighbour, each way.
    let side = |at: usize, limit: usize| {
        let neighbour = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
        [(at / 2, 0.75f32), (neighbour.min(limit - 1), 0.25)]
    };
    for (x, pixel) in row.iter_mut().enumerate() {
        let missing = 1.0 - pixel[4];
        if missing <= 0.0 {
            continue;
        }
        let mut sum = [0.0f32; PLANES];
        for (cy, wy) in side(y, coarse.height) {
            for (cx, wx) in side(x, coarse.width) {
                let from = &coarse.data[cy * coarse.width + cx];
                sum.iter_mut().zip(from).for_each(|(s, v)| *s += wx * wy * v);
            }
        }
        let scale = missing / sum[4].max(1e-6);
        pixel.iter_mut().zip(sum).for_each(|(value, sum)| *value += sum * scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_object_is_replaced_by_what_surrounds_it() {
        let (width, height) = (37, 23);
        let mut scene = Rows::<4>::new(width, height, 0);
        let (stride, row_len) = (scene.stride, scene.row_len());
        for y in 0..height {
            for x in 0..width {
                let near = (10..20).contains(&x) && (5..15).contains(&y);
                for p in 0..3 {
                    scene.data[y * row_len + p * stride + x] = if near { 9.0 } else { 0.5 };
                }
                scene.data[y * row_len + 3 * stride + x] = if near { -8.0 } else { 2.0 };
            }
        }
        let front = Share::new(Some((-1.0, 3.0)), None);
        Pyramid::new(width, height).fill(&mut Team::new(2), &mut scene, (width, height), front, -1.0);
        for y in 0..height {
            for x in 0..width {
                assert!((scene.data[y * row_len + x] - 0.5).abs() < 1e-5, "{x} {y}");
                assert!((scene.data[y * row_len + 3 * stride + x] - 2.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_picture_that_is_all_near_keeps_finite() {
        let mut scene = Rows::<4>::new(5, 3, 0);
        scene.data.fill(-9.0);
        let front = Share::new(Some((-1.0, 3.0)), None);
        Pyramid::new(5, 3).fill(&mut Team::new(2), &mut scene, (5, 3), front, -1.0);
        assert!(scene.data.iter().all(|v| v.is_finite()));
    }
}
