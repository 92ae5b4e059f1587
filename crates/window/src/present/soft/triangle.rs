//! Triangle rasterisation by edge functions (Pineda 1988) with the top-left rule, like a GPU's: fills the pixels whose
//! centres are covered, interpolating colours and texture positions between the corners.

use std::ops::Range;

use super::blend::{modulate, over};
use super::texture::Texture;

/// Subpixel steps per pixel. Corners are rounded to them, so that shared edges are exact, without overlaps or gaps.
const SUBPIXELS: f32 = 256.0;
/// A pixel in subpixels.
const SUBPIXELS_PER_PIXEL: i64 = SUBPIXELS as i64;
/// Limit of coordinates, in pixels, so that products of two of them do not overflow.
const MAX_COORDINATE_PX: f32 = 1e6;

/// A vertex of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Position in pixels.
    pub at: [f32; 2],
    /// Texture position, from 0 to 1.
    pub uv: [f32; 2],
    /// Red, green, blue and alpha, premultiplied.
    pub color: [u8; 4],
}

/// The clip rectangle, in pixels; `right` and `bottom` are exclusive.
#[derive(Clone, Copy, Debug)]
pub struct Clip {
    pub left: usize,
    pub top: usize,
    pub right: usize,
    pub bottom: usize,
}

/// Fills a triangle. Calls `on_row(y, columns, paint)` for each covered row; the callback must call `paint` with the
/// pixels of these columns.
pub fn rasterize(
    corners: [Corner; 3],
    clip: Clip,
    texture: &Texture,
    mut on_row: impl FnMut(usize, Range<usize>, &dyn Fn(&mut [u32])),
) {
    let Some(coverage) = Coverage::new(corners.map(|corner| corner.at)) else { return };
    let paint = TrianglePaint::new(corners, texture);
    if paint.is_invisible() {
        return;
    }
    for y in coverage.covered_rows(clip) {
        let columns = coverage.covered_columns(y, clip);
        if !columns.is_empty() {
            let x = columns.start;
            on_row(y, columns, &|pixels| paint.blend_span(x, y, pixels, texture));
        }
    }
}

/// Coverage of a triangle, in exact integer arithmetic.
struct Coverage {
    edges: [Edge; 3],
    /// y of the highest and of the lowest corner, in subpixels.
    top: i64,
    bottom: i64,
}

/// Edge function: the pixel in column `x` and row `y` is on the inner side if `start + x * across + y * down >= 0`.
#[derive(Clone, Copy)]
struct Edge {
    start: i64,
    across: i64,
    down: i64,
}

impl Coverage {
    /// Returns `None` if the triangle has no area or a corner is not finite.
    fn new(corners: [[f32; 2]; 3]) -> Option<Self> {
        if corners.as_flattened().iter().any(|value| !value.is_finite()) {
            return None;
        }
        let mut corners = corners
            .map(|corner| corner.map(|v| (v.clamp(-MAX_COORDINATE_PX, MAX_COORDINATE_PX) * SUBPIXELS).round() as i64));
        let [a, b, c] = corners;
        match (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) {
            0 => return None,
            // Makes the corners clockwise on the screen, so that the inner side of each edge is positive.
            area if area < 0 => corners.swap(1, 2),
            _ => {}
        }
        let edge = |from: [i64; 2], to: [i64; 2]| {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            // Top-left rule: a centre on a shared edge belongs to the triangle below it or right of it.
            let is_top_left = dy < 0 || (dy == 0 && dx > 0);
            let side = |x: i64, y: i64| dx * (y - from[1]) - dy * (x - from[0]);
            let start = side(SUBPIXELS_PER_PIXEL / 2, SUBPIXELS_PER_PIXEL / 2) - i64::from(!is_top_left);
            Edge { start, across: -dy * SUBPIXELS_PER_PIXEL, down: dx * SUBPIXELS_PER_PIXEL }
        };
        let [a, b, c] = corners;
        let rows = corners.map(|corner| corner[1]);
        let (top, bottom) = (rows.into_iter().min()?, rows.into_iter().max()?);
        Some(Self { edges: [edge(a, b), edge(b, c), edge(c, a)], top, bottom })
    }

    /// Returns the rows that may be covered.
    fn covered_rows(&self, clip: Clip) -> Range<usize> {
        let within = |row: i64| row.clamp(clip.top as i64, clip.bottom as i64) as usize;
        within(self.top.div_euclid(SUBPIXELS_PER_PIXEL))..within(self.bottom.div_euclid(SUBPIXELS_PER_PIXEL) + 1)
    }

    /// Returns the columns of row `y` whose centres lie inside all three edges.
    fn covered_columns(&self, y: usize, clip: Clip) -> Range<usize> {
        let (mut left, mut right) = (clip.left as i64, clip.right as i64);
        for edge in &self.edges {
            let start = edge.start + y as i64 * edge.down;
            match edge.across {
                0 if start < 0 => return 0..0,
                0 => {}
                // Inside from the first non-negative column on: the quotient, rounded up.
                across if across > 0 => left = left.max(-start.div_euclid(across)),
                // Inside up to the last non-negative column.
                across => right = right.min(start.div_euclid(-across) + 1),
            }
        }
        if left < right { left as usize..right as usize } else { 0..0 }
    }
}

/// A value that varies linearly over the picture.
#[derive(Clone, Copy, Default)]
struct Plane {
    start: f32,
    across: f32,
    down: f32,
}

impl Plane {
    /// Returns the plane with these values at three points; constant if the points are nearly collinear.
    fn through_points(at: [[f32; 2]; 3], values: [f32; 3]) -> Self {
        let (ab, ac) = ([at[1][0] - at[0][0], at[1][1] - at[0][1]], [at[2][0] - at[0][0], at[2][1] - at[0][1]]);
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let (b, c) = (values[1] - values[0], values[2] - values[0]);
        let (across, down) = ((b * ac[1] - c * ab[1]) / area, (c * ab[0] - b * ac[0]) / area);
        if !across.is_finite() || !down.is_finite() {
            return Self { start: values[0], ..Self::default() };
        }
        Self { start: values[0] - at[0][0] * across - at[0][1] * down, across, down }
    }

    /// Evaluates the plane at the centre of a pixel.
    fn eval(&self, x: usize, y: usize) -> f32 {
        self.start + self.across * (x as f32 + 0.5) + self.down * (y as f32 + 0.5)
    }
}

/// Colour and texture of a triangle, prepared for interpolation.
struct TrianglePaint {
    /// The colour of all corners, if it is the same.
    flat_color: Option<[u8; 4]>,
    /// Planes of red, green, blue and alpha otherwise.
    colors: [Plane; 4],
    /// The texel of all corners, as in [`over`], if they have the same texture position.
    texel: Option<u32>,
    /// Planes of the texture position otherwise, in texels.
    texel_at: [Plane; 2],
}

impl TrianglePaint {
    /// Prepares interpolation of the attributes that differ between the corners.
    fn new(corners: [Corner; 3], texture: &Texture) -> Self {
        let [a, b, c] = corners;
        let at = corners.map(|corner| corner.at);
        let mut paint = Self {
            flat_color: (a.color == b.color && b.color == c.color).then_some(a.color),
            colors: [Plane::default(); 4],
            texel: None,
            texel_at: [Plane::default(); 2],
        };
        if paint.flat_color.is_none() {
            paint.colors =
                std::array::from_fn(|k| Plane::through_points(at, corners.map(|corner| f32::from(corner.color[k]))));
        }
        let uv = corners.map(|corner| texture.to_texels(corner.uv));
        if a.uv == b.uv && b.uv == c.uv {
            paint.texel = Some(texture.sample_bilinear(uv[0]));
        } else {
            paint.texel_at = std::array::from_fn(|k| Plane::through_points(at, uv.map(|uv| uv[k])));
        }
        paint
    }

    fn is_invisible(&self) -> bool {
        self.flat_color == Some([0; 4]) || self.texel == Some(0)
    }

    /// Blends the triangle over `pixels`, which begin at column `x` of row `y`. The first two cases are fast paths for
    /// the most frequent triangles.
    fn blend_span(&self, x: usize, y: usize, pixels: &mut [u32], texture: &Texture) {
        match (self.flat_color, self.texel) {
            (Some(color), Some(texel)) => {
                let color = modulate(texel, color);
                if color >> 24 == 255 {
                    pixels.fill(color);
                } else {
                    pixels.iter_mut().for_each(|pixel| *pixel = over(color, *pixel));
                }
            }
            // A white texel leaves the colours unchanged.
            (None, Some(u32::MAX)) => {
                let (mut color, step) = self.color_at(x, y);
                for pixel in pixels {
                    *pixel = over(pack_argb(color), *pixel);
                    color = std::array::from_fn(|k| color[k] + step[k]);
                }
            }
            (flat_color, texel) => {
                let (mut color, step) = self.color_at(x, y);
                let mut at = self.texel_at.map(|plane| plane.eval(x, y));
                for pixel in pixels {
                    let texel = texel.unwrap_or_else(|| texture.sample_bilinear(at));
                    if texel != 0 {
                        let color = flat_color.unwrap_or_else(|| round_color(color));
                        *pixel = over(modulate(texel, color), *pixel);
                    }
                    color = std::array::from_fn(|k| color[k] + step[k]);
                    at = std::array::from_fn(|k| at[k] + self.texel_at[k].across);
                }
            }
        }
    }

    /// Returns the colour at a pixel, and its increment per column.
    fn color_at(&self, x: usize, y: usize) -> ([f32; 4], [f32; 4]) {
        (self.colors.map(|plane| plane.eval(x, y)), self.colors.map(|plane| plane.across))
    }
}

/// Rounds to bytes; the cast saturates.
fn round_color(color: [f32; 4]) -> [u8; 4] {
    color.map(|value| (value + 0.5) as u8)
}

/// Packs a colour (red, green, blue, alpha) as `0xAARRGGBB`.
fn pack_argb(color: [f32; 4]) -> u32 {
    let [r, g, b, a] = round_color(color);
    u32::from_be_bytes([a, r, g, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 40;

    fn covered(corners: [[f32; 2]; 3], counts: &mut [u32]) {
        let Some(coverage) = Coverage::new(corners) else { return };
        let clip = Clip { left: 0, top: 0, right: SIZE, bottom: SIZE };
        for y in coverage.covered_rows(clip) {
            coverage.covered_columns(y, clip).for_each(|x| counts[y * SIZE + x] += 1);
        }
    }

    #[test]
    fn triangles_that_share_edges_cover_each_pixel_once() {
        // A triangle fan around a point, closed by the canvas's corners.
        for middle in [[20.0, 20.0], [20.5, 20.5], [3.13, 37.77], [39.996, 0.004], [20.0, 0.5]] {
            let n = SIZE as f32;
            let rim = [[0.0, 0.0], [13.5, 0.0], [n, 0.0], [n, 20.25], [n, n], [0.5, n], [0.0, n], [0.0, 11.1]];
            let mut counts = vec![0; SIZE * SIZE];
            for k in 0..rim.len() {
                covered([rim[k], middle, rim[(k + 1) % rim.len()]], &mut counts);
            }
            assert!(counts.iter().all(|&count| count == 1), "{middle:?}");
        }
    }

    #[test]
    fn the_pixels_whose_centres_lie_inside_are_covered() {
        let mut counts = vec![0; SIZE * SIZE];
        covered([[2.5, 3.5], [10.5, 3.5], [2.5, 11.5]], &mut counts);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            // The left and top edges are inclusive, the slanted one is not.
            let inside = x >= 2 && y >= 3 && (x - 2) + (y - 3) < 8;
            assert_eq!(counts[y * SIZE + x], u32::from(inside), "{x}, {y}");
        }
    }

    #[test]
    fn what_is_no_triangle_covers_nothing() {
        let mut counts = vec![0; SIZE * SIZE];
        covered([[1.0, 1.0], [5.0, 5.0], [9.0, 9.0]], &mut counts);
        covered([[f32::NAN, 1.0], [5.0, 5.0], [9.0, 1.0]], &mut counts);
        assert!(counts.iter().all(|&count| count == 0));
        covered([[-1e30, -1e30], [1e30, -1e30], [0.0, 1e30]], &mut counts);
        assert!(counts.iter().all(|&count| count <= 1));
    }
}
