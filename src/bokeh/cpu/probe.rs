//! What the passes leave behind, for comparing the executors pass by pass and for looking at a blur from within.

use super::CpuBokeh;
use super::pixels::{Pixels, Radii};
use super::rows::STRIP;
use super::tiles::{TILE_H, TILE_W};
use super::unpack::{Source, Surfaces};
use crate::bokeh::Probe;
use crate::bokeh::plan::{Plan, SEGMENT};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// Pixels of a row that are unpacked at once.
const SPAN: usize = 64;

impl CpuBokeh {
    /// The result of a pass over the last frame, in the layout that [`Probe`] states. Allocates; not for every frame.
    pub fn probe(&self, probe: Probe) -> Vec<[f32; 4]> {
        match probe {
            Probe::Bin(k) => {
                let (bin, source) = (&self.plan.bins[k], &self.slots[self.plan.bins[k].slot].source);
                let pixels = |y: usize| (0..bin.width).map(move |x| (x, y));
                let at =
                    |(x, y): (usize, usize)| std::array::from_fn(|p| source.row(x / STRIP, y)[p * STRIP + x % STRIP]);
                (0..bin.height).flat_map(pixels).map(at).collect()
            }
            Probe::Reach(k) => self.slots[self.plan.bins[k].slot].edges.data.as_chunks::<4>().0.to_vec(),
            Probe::Blur(k) => {
                let (bin, rows) = (&self.plan.bins[k], &self.slots[self.plan.bins[k].slot]);
                let pixels = |y: usize| (0..bin.width).map(move |x| (x, y));
                let at = |(x, y): (usize, usize)| {
                    let start = (x / STRIP * bin.height + y) * 4 * STRIP + x % STRIP;
                    std::array::from_fn(|p| rows.out[start + p * STRIP])
                };
                (0..bin.height).flat_map(pixels).map(at).collect()
            }
        }
    }

    /// The plan, with the bins of the last frame.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The radius that every pixel of bin `k` was filtered with in the last frame, in bin pixels.
    pub fn radius_px(&self, k: usize) -> Vec<f32> {
        let bin = &self.plan.bins[k];
        let edges = &self.slots[bin.slot].edges;
        let mut radii = Vec::with_capacity(bin.width * bin.height);
        for y in 0..bin.height {
            for strip in 0..bin.width.div_ceil(STRIP) {
                let edges = edges.at(strip, y);
                radii.extend((0..STRIP.min(bin.width - strip * STRIP)).map(|x| {
                    let (left, right) = (edges[x / SEGMENT][0], edges[x / SEGMENT + 1][0]);
                    left + (right - left) * ((x % SEGMENT) as f32 + 0.5) / SEGMENT as f32
                }));
            }
        }
        radii
    }

    /// A frame as the bins take it, per pixel: linear r, g, b with highlights expanded, and CoC. With `filled`, which
    /// has to be the last frame, what near objects hide is filled in, as for the bins behind all of them. Two surfaces of a pixel
    /// are put together again, and the CoC is the nearer one's.
    pub fn scene(&self, color: &ColorImage, depth: Option<&DepthMap>, coc: &CocField, filled: bool) -> Vec<[f32; 4]> {
        let (width, height) = (color.width as usize, color.height as usize);
        let source = Source::new(&self.plan, Pixels::Srgb(&color.rgb), Radii::Field(coc, depth));
        let pyramid = self.pyramid.as_ref().filter(|_| filled && self.filled());
        let last = self.last_layer();
        let behind = pyramid.map(|pyramid| pyramid.behind(&self.silhouettes, &self.plan, last));
        let mut surfaces: Surfaces<SPAN> = Surfaces::new();
        let mut scene = Vec::with_capacity(width * height);
        for y in 0..height {
            for x0 in (0..width).step_by(SPAN) {
                source.unpack::<pulp::Scalar, SPAN>(y, x0 as isize, SPAN, &mut surfaces);
                if let Some(behind) = &behind {
                    behind.put(pulp::Scalar::new(), x0 as isize, y, width, &mut surfaces);
                }
                scene.extend((0..SPAN.min(width - x0)).map(|x| surfaces.pixel(x)));
            }
        }
        scene
    }

    /// Whether something in the last frame was in front, and what it hides was filled in.
    pub fn filled(&self) -> bool {
        self.pyramid.is_some() && self.last_layer() > 0
    }

    /// How far a pixel of this CoC in the last frame, which was [`filled`](Self::filled), was replaced for the bins that
    /// do not lie in front of the focal plane, 0 to 1.
    pub fn hidden(&self, coc_px: f32) -> f32 {
        1.0 - self.plan.unhidden(self.last_layer()).at(coc_px)
    }

    /// The first bin that is not in front of the focal plane.
    fn last_layer(&self) -> usize {
        self.plan.layers().last().map_or(0, |layer| layer.start)
    }

    /// Whether a pixel of the last frame lies in a tile where nothing behind is blurred: unless something in front
    /// reaches it, it stays as it is.
    pub fn is_still(&self, (x, y): (usize, usize)) -> bool {
        self.tiles.still[y / TILE_H * self.tiles.across + x / TILE_W]
    }

    /// Whether anything in the last frame belonged to bin `k`; if not, its passes were left out.
    pub fn is_present(&self, k: usize) -> bool {
        self.slots[self.plan.bins[k].slot].present
    }

    /// Whether a pixel of a bin of scale `scale`, or any within `around` bin pixels of it, lies in a tile that no bin
    /// of the last frame needed, all around it being in focus: the bins may be empty there.
    pub fn is_idle_around(&self, (x, y): (usize, usize), around: usize, scale: usize) -> bool {
        let tiles = |at: usize, tile: usize, count: usize| {
            let first = at.saturating_sub(around) * scale / tile;
            first..((at + around) * scale / tile + 1).min(count).max(first)
        };
        let (across, down) = (self.tiles.across, self.tiles.down);
        let columns = tiles(x, TILE_W, across);
        tiles(y, TILE_H, down).any(|row| columns.clone().any(|column| self.tiles.idle[row * across + column]))
    }
}
