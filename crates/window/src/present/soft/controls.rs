//! The controls as a cached overlay: painted when they change, blended over every frame.

use std::ops::Range;

use egui::TextureId;
use egui::epaint::{ClippedPrimitive, Mesh, Primitive, Vertex};
use pulp::{Arch, Simd, WithSimd};

use super::blend::over;
use super::texture::{Texture, Textures};
use super::triangle::{self, Clip, Corner};
use crate::present::Controls;

/// Maximum number of cells per row: one bit each.
const MAX_CELLS: usize = u64::BITS as usize;
/// Minimum width of a cell, in pixels.
const MIN_CELL_PX: usize = 16;

/// The overlay with the controls.
#[derive(Debug, Default)]
pub struct Overlay {
    size: (usize, usize),
    /// Premultiplied, `0xAARRGGBB`.
    pixels: Vec<u32>,
    /// Width of a cell, in pixels.
    cell_px: usize,
    /// Per row, a bit mask of cells, leftmost lowest: 0 where all `pixels` of the cell are 0. Blending skips such
    /// cells.
    cells: Vec<u64>,
    textures: Textures,
    primitives: Vec<ClippedPrimitive>,
    pixels_per_point: f32,
    /// Textures to free when the controls are replaced.
    freed: Vec<TextureId>,
    /// Whether `pixels` must be repainted.
    outdated: bool,
}

impl Overlay {
    /// Changes the size, in pixels.
    pub fn resize(&mut self, size: (usize, usize)) {
        if self.size == size {
            return;
        }
        self.size = size;
        self.cell_px = size.0.div_ceil(MAX_CELLS).max(MIN_CELL_PX);
        self.pixels.clear();
        self.pixels.resize(size.0 * size.1, 0);
        self.cells.clear();
        self.cells.resize(size.1, 0);
        self.outdated = true;
    }

    /// Replaces the controls, effective from the next [`Overlay::paint`].
    pub fn set_controls(&mut self, controls: Controls) {
        let Controls { primitives, mut textures, pixels_per_point } = controls;
        // Only the replaced controls still used these.
        self.freed.drain(..).for_each(|id| drop(self.textures.0.remove(&id)));
        self.textures.apply_delta(&textures);
        self.freed.extend(&textures.free);
        textures.clear();
        (self.primitives, self.pixels_per_point, self.outdated) = (primitives, pixels_per_point, true);
    }

    /// Paints the controls into `pixels` if they or the size changed.
    pub fn paint(&mut self) {
        if !std::mem::take(&mut self.outdated) {
            return;
        }
        let width = self.size.0;
        // Clears only the cells painted before.
        for (row, cells) in self.pixels.chunks_exact_mut(width.max(1)).zip(&mut self.cells) {
            for columns in cell_runs(std::mem::take(cells), self.cell_px, width) {
                row[columns].fill(0);
            }
        }
        let primitives = std::mem::take(&mut self.primitives);
        for ClippedPrimitive { clip_rect, primitive } in &primitives {
            // Callbacks need a GPU; none of the controls uses one.
            if let Primitive::Mesh(mesh) = primitive {
                let clip = self.to_clip_px(*clip_rect);
                self.fill_mesh(mesh, clip);
            }
        }
        self.primitives = primitives;
    }

    /// Converts a clip rectangle from points to whole pixels, clamped to the window.
    fn to_clip_px(&self, rect: egui::Rect) -> Clip {
        let at =
            |points: f32, side_px: usize| (points * self.pixels_per_point).round().clamp(0.0, side_px as f32) as usize;
        let (width, height) = self.size;
        let (left, top) = (at(rect.min.x, width), at(rect.min.y, height));
        Clip { left, top, right: at(rect.max.x, width).max(left), bottom: at(rect.max.y, height).max(top) }
    }

    fn fill_mesh(&mut self, mesh: &Mesh, clip: Clip) {
        let Self { textures, pixels, cells, cell_px, size, .. } = self;
        let Some(texture) = textures.0.get(&mesh.texture_id) else { return };
        let (width, cell_px) = (size.0, *cell_px);
        for corners in mesh.indices.as_chunks::<3>().0 {
            let Some(corners) = triangle_corners(mesh, *corners, self.pixels_per_point) else { continue };
            fill_triangle(corners, clip, texture, width, cell_px, pixels, cells);
        }
    }

    /// Blends the controls over row `y`.
    pub fn blend_row(&self, arch: Arch, y: usize, row: &mut [u32]) {
        let Some(&cells) = self.cells.get(y) else { return };
        let from = &self.pixels[y * self.size.0..][..self.size.0];
        for run in cell_runs(cells, self.cell_px, self.size.0) {
            arch.dispatch(BlendRun { from: &from[run.clone()], to: &mut row[run] });
        }
    }
}

/// Returns the corners of a triangle from its vertex indices; `None` if one of them is out of range.
fn triangle_corners(mesh: &Mesh, corners: [u32; 3], pixels_per_point: f32) -> Option<[Corner; 3]> {
    let corner = |index: u32| {
        let &Vertex { pos, uv, color } = mesh.vertices.get(index as usize)?;
        let at = [pos.x * pixels_per_point, pos.y * pixels_per_point];
        Some(Corner { at, uv: [uv.x, uv.y], color: color.to_array() })
    };
    let [a, b, c] = corners.map(corner);
    Some([a?, b?, c?])
}

/// Fills a triangle in `pixels` (rows of `width`), and sets the bits of the `cells` it touches.
fn fill_triangle(
    corners: [Corner; 3],
    clip: Clip,
    texture: &Texture,
    width: usize,
    cell_px: usize,
    pixels: &mut [u32],
    cells: &mut [u64],
) {
    triangle::rasterize(corners, clip, texture, |y, columns, paint| {
        let (first, last) = (columns.start / cell_px, (columns.end - 1) / cell_px);
        // The bits `first..=last`.
        cells[y] |= (u64::MAX >> (MAX_CELLS - 1 - (last - first))) << first;
        paint(&mut pixels[y * width..][columns]);
    });
}

/// Returns the runs of set bits in a row's `cells` as column ranges.
fn cell_runs(mut cells: u64, cell_px: usize, width: usize) -> impl Iterator<Item = Range<usize>> {
    // Cells already shifted out of `cells`.
    let mut shifted = 0;
    std::iter::from_fn(move || {
        if cells == 0 {
            return None;
        }
        let skipped = cells.trailing_zeros() as usize;
        cells >>= skipped;
        let count = cells.trailing_ones() as usize;
        // Two shifts, because a shift by 64 bits would overflow.
        cells = cells >> (count - 1) >> 1;
        let first = shifted + skipped;
        shifted = first + count;
        Some((first * cell_px).min(width)..(shifted * cell_px).min(width))
    })
}

/// Blends one run of the overlay over the picture.
struct BlendRun<'a> {
    from: &'a [u32],
    to: &'a mut [u32],
}

impl WithSimd for BlendRun<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (to, &from) in self.to.iter_mut().zip(self.from) {
            // The window's pixel format has no alpha.
            *to = over(from, *to) & 0x00ff_ffff;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_cells_that_are_set() {
        let all = |cells, width| cell_runs(cells, 10, width).map(|run| (run.start, run.end)).collect::<Vec<_>>();
        assert!(all(0, 100).is_empty());
        assert_eq!(all(u64::MAX, 640), [(0, 640)]);
        assert_eq!(all(1 << 63 | 0b1011, 635), [(0, 20), (30, 40), (630, 635)]);
    }
}
