//! Deinterleaves depth and colour of a frame into even and odd columns, for windows that take every second pixel: the
//! pixels of a window's row are then contiguous.

use std::ops::Range;

use pulp::WithSimd;

use super::tiles::Tiles;
use crate::compute::bands::Bands;
use crate::frame::reset_buffer;

/// Values that a window reads from a row.
pub const LANES: usize = 16;
/// Padding columns of one parity before the first and after the last column, with weight 0.
const MARGIN: usize = LANES;

/// Values deinterleaved at a time.
const CHUNK: usize = 64;

/// Planes of a frame: even columns in the first half of each row, odd ones in the second.
#[derive(Debug, Default)]
pub struct Planes {
    /// Columns of the picture.
    pub width: usize,
    /// Rows of the picture.
    pub height: usize,
    /// Values of one parity in a row, with padding.
    stride: usize,
    /// Radius of a window to the left, in pixels of one parity.
    radius: usize,
    /// Inverse depth, and its confidence.
    depths: [Vec<f32>; 2],
    /// Red, green and blue.
    colors: [Vec<u8>; 3],
}

impl Planes {
    /// Allocates for pictures of this size; windows begin `radius` pixels of one parity before their centre.
    pub fn resize(&mut self, width: usize, height: usize, radius: usize) {
        if (self.width, self.height) != (width, height) {
            (self.width, self.height, self.stride) = (width, height, width.div_ceil(2) + 2 * MARGIN);
            let count = 2 * self.stride * height;
            self.depths.iter_mut().for_each(|plane| reset_buffer(plane, count));
            self.colors.iter_mut().for_each(|plane| reset_buffer(plane, count));
        }
        self.radius = radius;
    }

    /// Splits the planes into bands.
    pub fn split(&mut self, bands: Bands) -> impl Iterator<Item = PlanesBand<'_>> {
        let (width, stride) = (self.width, self.stride);
        let [inverse, confidence] = self.depths.each_mut().map(|plane| bands.split(plane, 2 * stride));
        let [red, green, blue] = self.colors.each_mut().map(|plane| bands.split(plane, 2 * stride));
        bands.rows().zip(inverse.zip(confidence)).zip(red.zip(green).zip(blue)).map(
            move |((rows, (inverse, confidence)), ((red, green), blue))| PlanesBand {
                rows,
                width,
                stride,
                depths: [inverse, confidence],
                colors: [red, green, blue],
            },
        )
    }

    /// Returns the index of column `x` in row `y`.
    #[inline(always)]
    fn index_of(&self, x: usize, y: usize) -> usize {
        (2 * y + x % 2) * self.stride + MARGIN + x / 2
    }

    /// Returns red, green and blue of a pixel.
    #[inline(always)]
    pub fn color(&self, x: usize, y: usize) -> [f32; 3] {
        let at = self.index_of(x, y);
        self.colors.each_ref().map(|plane| f32::from(plane[at]))
    }

    /// Returns the pixels of row `y` with the parity of `x`, from `radius` before it on: inverse depth and confidence,
    /// and red, green, blue.
    #[inline(always)]
    pub fn window(&self, x: usize, y: usize) -> ([&[f32; LANES]; 2], [&[u8; LANES]; 3]) {
        let at = self.index_of(x, y) - self.radius;
        (
            self.depths.each_ref().map(|plane| lanes_at(plane, at)),
            self.colors.each_ref().map(|plane| lanes_at(plane, at)),
        )
    }
}

/// Deinterleaves values to the given start indices of each parity.
#[inline(always)]
fn deinterleave<T: Copy>(plane: &mut [T], [even, odd]: [usize; 2], values: &[T]) {
    let (pairs, last) = values.as_chunks::<2>();
    let (before, after) = plane.split_at_mut(odd);
    let even = &mut before[even..][..values.len().div_ceil(2)];
    for ((pair, even), odd) in pairs.iter().zip(&mut *even).zip(after) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    if let [last] = last {
        even[pairs.len()] = *last;
    }
}

/// A band of rows of all planes.
pub struct PlanesBand<'a> {
    pub rows: Range<usize>,
    width: usize,
    stride: usize,
    depths: [&'a mut [f32]; 2],
    colors: [&'a mut [u8]; 3],
}

impl PlanesBand<'_> {
    /// Returns the indices of the `line`th row from the even column `x` on, for each parity.
    #[inline(always)]
    fn start_indices(&self, x: usize, line: usize) -> [usize; 2] {
        [0, 1].map(|parity| (2 * line + parity) * self.stride + MARGIN + x / 2)
    }
}

/// Copies the colours of a picture (sRGB, 0 to 255) near edges into a band of the planes.
pub struct SetColors<'a, 'b> {
    pub planes: &'a mut PlanesBand<'b>,
    pub tiles: &'a Tiles,
    pub rgb: &'a [u8],
}

impl WithSimd for SetColors<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, tiles, rgb } = self;
        let (pixels, width) = (rgb.as_chunks::<3>().0, planes.width);
        for (line, y) in planes.rows.clone().enumerate() {
            let row = &pixels[y * width..][..width];
            for columns in tiles.near_columns(y) {
                for (pixels, k) in row[columns.clone()].chunks(CHUNK).zip(0..) {
                    let mut values = [[0; CHUNK]; 3];
                    let [red, green, blue] = &mut values;
                    for (((pixel, red), green), blue) in pixels.iter().zip(red).zip(green).zip(blue) {
                        [*red, *green, *blue] = *pixel;
                    }
                    let start_indices = planes.start_indices(columns.start + k * CHUNK, line);
                    for (plane, values) in planes.colors.iter_mut().zip(&values) {
                        deinterleave(plane, start_indices, &values[..pixels.len()]);
                    }
                }
            }
        }
    }
}

/// Copies inverse depths near edges, and their weights as votes, into a band of the planes.
pub struct SetDepths<'a, 'b> {
    pub planes: &'a mut PlanesBand<'b>,
    pub tiles: &'a Tiles,
    /// Inverse depths of the picture, row by row, and whether each was filled in.
    pub inverse: &'a [f32],
    pub unknown: &'a [bool],
    /// Whether each depth of the band may be wrong.
    pub band: &'a [bool],
    /// Weights of filled-in depths, and of those that may be wrong.
    pub weights: [f32; 2],
}

impl WithSimd for SetDepths<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, tiles, inverse, unknown, band, weights: [filled_weight, uncertain_weight] } = self;
        let width = planes.width;
        for (line, y) in planes.rows.clone().enumerate() {
            for columns in tiles.near_columns(y) {
                let row = y * width;
                let start_indices = planes.start_indices(columns.start, line);
                deinterleave(planes.depths[0], start_indices, &inverse[row..][columns.clone()]);
                for begin in columns.clone().step_by(CHUNK) {
                    let chunk = begin..(begin + CHUNK).min(columns.end);
                    let mut weights = [1.0; CHUNK];
                    let flags = unknown[row..][chunk.clone()].iter().zip(&band[line * width..][chunk.clone()]);
                    for (weight, (&unknown, &band)) in weights.iter_mut().zip(flags) {
                        *weight = if band { uncertain_weight } else { 1.0 };
                        *weight = if unknown { filled_weight } else { *weight };
                    }
                    let start_indices = planes.start_indices(begin, line);
                    deinterleave(planes.depths[1], start_indices, &weights[..chunk.len()]);
                }
            }
        }
    }
}

#[inline(always)]
fn lanes_at<T>(plane: &[T], at: usize) -> &[T; LANES] {
    plane[at..].first_chunk().expect("a margin after the last column")
}
