//! Pass `fill`: what near objects hide is filled in from around them, colour and CoC, before the bins behind are
//! taken. Pull-push: averages over ever larger areas, of known pixels only, flow back into the holes.

use super::bin::Share;
use super::rows::{Rows, repeat_ends};

/// Planes of a level: premultiplied colour and CoC, and how much of it is known.
const PLANES: usize = 5;

/// The pyramid, finest level (half the picture's size) first.
pub struct Pyramid {
    levels: Vec<Level>,
    hidden: Vec<f32>,
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
        Self { levels, hidden }
    }

    /// Replaces, in `scene`, what belongs to near bins (`front` is the share of everything behind them) and the
    /// mixed pixels around it. Filled CoC is at least `nearest_px`, the border of the near bins.
    pub fn fill(&mut self, scene: &mut Rows<4>, size: (usize, usize), front: Share, nearest_px: f32) {
        self.start(scene, size, front);
        for k in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            pull(&fine[k - 1], &mut coarse[0]);
        }
        for k in (1..self.levels.len()).rev() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            push(&coarse[0], &mut fine[k - 1]);
        }
        self.finish(scene, size, nearest_px);
    }

    /// The finest level: known is what no near pixel touches, nor its neighbours.
    fn start(&mut self, scene: &Rows<4>, (width, height): (usize, usize), front: Share) {
        let level = &mut self.levels[0];
        let (w, h) = (level.width, level.height);
        for y in 0..h {
            for x in 0..w {
                let mut sum = [0.0f32; PLANES];
                let mut hidden = 0.0f32;
                for sub in 0..4 {
                    let (px, py) = ((2 * x + sub % 2).min(width - 1), (2 * y + sub / 2).min(height - 1));
                    let coc = scene.plane(py, 3)[px];
                    hidden = hidden.max(1.0 - front.at(coc));
                    (0..3).for_each(|p| sum[p] += 0.25 * scene.plane(py, p)[px]);
                    sum[3] += 0.25 * coc;
                }
                self.hidden[y * w + x] = hidden;
                level.data[y * w + x] = sum;
            }
        }
        for y in 0..h {
            for x in 0..w {
                let mut hidden = 0.0f32;
                for row in y.saturating_sub(1)..(y + 2).min(h) {
                    for column in x.saturating_sub(1)..(x + 2).min(w) {
                        hidden = hidden.max(self.hidden[row * w + column]);
                    }
                }
                let known = if hidden > 0.0 { 0.0 } else { 1.0 };
                let pixel = &mut level.data[y * w + x];
                pixel.iter_mut().for_each(|value| *value *= known);
                pixel[4] = known;
            }
        }
    }

    fn finish(&self, scene: &mut Rows<4>, (width, height): (usize, usize), nearest_px: f32) {
        let level = &self.levels[0];
        let (stride, pad, row_len) = (scene.stride, scene.pad, scene.row_len());
        for y in 0..height {
            let row = &mut scene.data[y * row_len..][..row_len];
            for x in 0..width {
                if self.hidden_around(x / 2, y / 2) {
                    let fill = level.data[(y / 2) * level.width + x / 2];
                    (0..3).for_each(|p| row[p * stride + pad + x] = fill[p]);
                    row[3 * stride + pad + x] = fill[3].max(nearest_px);
                }
            }
            row.chunks_exact_mut(stride).for_each(|plane| repeat_ends(plane, pad, width));
        }
    }

    fn hidden_around(&self, x: usize, y: usize) -> bool {
        let (w, h) = (self.levels[0].width, self.levels[0].height);
        let columns = x.saturating_sub(1)..(x + 2).min(w);
        (y.saturating_sub(1)..(y + 2).min(h)).any(|y| self.hidden[y * w..][columns.clone()].iter().any(|&v| v > 0.0))
    }
}

/// Averages four pixels; knowing a little is spread, so that the coarsest level knows something if anyone does.
fn pull(fine: &Level, coarse: &mut Level) {
    for y in 0..coarse.height {
        for x in 0..coarse.width {
            let mut sum = [0.0f32; PLANES];
            for sub in 0..4 {
                let (px, py) = (2 * x + sub % 2, 2 * y + sub / 2);
                if px < fine.width && py < fine.height {
                    let pixel = &fine.data[py * fine.width + px];
                    sum.iter_mut().zip(pixel).for_each(|(s, v)| *s += v);
                }
            }
            let scale = 1.0 / sum[4].max(1.0);
            coarse.data[y * coarse.width + x] = sum.map(|v| v * scale);
        }
    }
}

/// Fills what the finer level does not know from the coarser one.
fn push(coarse: &Level, fine: &mut Level) {
    for y in 0..fine.height {
        for x in 0..fine.width {
            let pixel = &mut fine.data[y * fine.width + x];
            let missing = 1.0 - pixel[4];
            if missing <= 0.0 {
                continue;
            }
            // Linear interpolation: three parts of the coarse pixel above this one, one of its neighbour, each way.
            let side = |at: usize, limit: usize| {
                let neighbour = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
                [(at / 2, 0.75f32), (neighbour.min(limit - 1), 0.25)]
            };
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
        Pyramid::new(width, height).fill(&mut scene, (width, height), front, -1.0);
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
        Pyramid::new(5, 3).fill(&mut scene, (5, 3), front, -1.0);
        assert!(scene.data.iter().all(|v| v.is_finite()));
    }
}
