//! Read access to intermediate results, for comparing the executors pass by pass and for inspecting a blur.

use super::CpuBokeh;
use super::pixels::{Pixels, Radii};
use super::rows::STRIP;
use super::tiles::{TILE_H, TILE_W};
use super::unpack::{InputFrame, Surfaces};
use crate::bokeh::Probe;
use crate::bokeh::plan::{Plan, SEGMENT};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// Pixels of a row that are unpacked at once.
const SPAN: usize = 64;

impl CpuBokeh {
    /// Returns the result of a pass over the last frame, in the layout of [`Probe`]. Allocates; not for every frame.
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

    /// Returns which fraction of the last frame was kept from earlier ones, 0 to 1.
    pub fn kept_fraction(&self) -> f32 {
        self.kept_fraction
    }

    /// Returns the plan, with the bins of the last frame.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the radius with which every pixel of bin `k` was filtered in the last frame, in bin pixels.
    pub fn filter_radii_px(&self, k: usize) -> Vec<f32> {
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

    /// Returns a frame as the bins see it, per pixel: linear r, g, b with highlights expanded, and CoC. With `filled`,
    /// which requires the last frame, occluded pixels are inpainted, as for the bins behind all near ones. Mixed pixels
    /// are composited again, with the CoC of the nearer surface.
    pub fn scene(&self, color: &ColorImage, depth: Option<&DepthMap>, coc: &CocField, filled: bool) -> Vec<[f32; 4]> {
        let (width, height) = (color.width as usize, color.height as usize);
        let source = InputFrame::new(&self.plan, Pixels::Srgb(&color.rgb), Radii::Field(coc, depth));
        let pyramid = self.pyramid.as_ref().filter(|_| filled && self.has_inpainting());
        let last = self.first_far_bin();
        let background = pyramid.map(|pyramid| pyramid.background(&self.silhouettes, &self.plan, last));
        let mut surfaces: Surfaces<SPAN> = Surfaces::new();
        let mut scene = Vec::with_capacity(width * height);
        for y in 0..height {
            for x0 in (0..width).step_by(SPAN) {
                source.unpack::<pulp::Scalar, SPAN>(y, x0 as isize, SPAN, &mut surfaces);
                if let Some(background) = &background {
                    background.inpaint(pulp::Scalar::new(), x0 as isize, y, width, &mut surfaces);
                }
                scene.extend((0..SPAN.min(width - x0)).map(|x| surfaces.composite_pixel(x)));
            }
        }
        scene
    }

    /// Whether something in the last frame was in front, so that the background behind it was inpainted.
    pub fn has_inpainting(&self) -> bool {
        self.pyramid.is_some() && self.first_far_bin() > 0
    }

    /// Returns how far a pixel of this CoC was inpainted for the bins that are not in front of the focal plane, 0 to 1.
    /// The last frame must [have inpainting](Self::has_inpainting).
    pub fn inpainting_weight(&self, coc_px: f32) -> f32 {
        1.0 - self.plan.visible_weight(self.first_far_bin()).at(coc_px)
    }

    /// Returns the first bin that is not in front of the focal plane.
    fn first_far_bin(&self) -> usize {
        self.plan.layers().last().map_or(0, |layer| layer.start)
    }

    /// Whether a pixel of the last frame is in a tile without background blur: it stays unchanged unless something in
    /// front spreads there.
    pub fn is_still(&self, (x, y): (usize, usize)) -> bool {
        self.tiles.still[y / TILE_H * self.tiles.across + x / TILE_W]
    }

    /// Whether bin `k` had any content in the last frame; if not, its passes were skipped.
    pub fn is_present(&self, k: usize) -> bool {
        self.slots[self.plan.bins[k].slot].present
    }

    /// Whether a pixel of a bin of scale `scale`, or any within `around` bin pixels of it, is in a tile that no bin of
    /// the last frame needed because its surroundings are in focus: the bins may be empty there.
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
