//! Bilinear resampling of pictures with precomputed positions, in fixed point.
//!
//! Each pixel has the index of the upper left of its four neighbours and two fractions in 1/256 pixel, 0 to 256. The
//! four weights sum to 256, so that an identity map keeps every bit.
//!
//! twin: shaders/stereo/rectify.wgsl

use std::ops::Range;

use glam::DVec2;
use pulp::{Arch, Simd, WithSimd};

use crate::frame::{ColorImage, GrayImage};

/// 1 in fixed point: the unit of fractions and weights.
pub(crate) const ONE: u32 = 256;
/// Bit at which the second fraction begins.
pub(crate) const DOWN_SHIFT: u32 = 16;
/// Marks a pixel outside the source: the sign bit, which no fractions reach.
pub(crate) const NOWHERE: u32 = 1 << 31;
/// Pixels gathered before they are weighted: only the weighting is vector code.
const BLOCK: usize = 64;
/// Bytes of a colour pixel.
const RGB: usize = 3;

/// Source positions of the pixels of a picture in another one of the same size. Sources more than half a pixel outside
/// become black; within that margin the border pixel is used.
#[derive(Clone, Debug)]
pub struct RemapTable {
    size: (u32, u32),
    /// For each pixel the index of its upper left neighbour, which has others on its right and below.
    starts: Vec<u32>,
    /// For each pixel the fractions across and, from [`DOWN_SHIFT`] on, down; or [`NOWHERE`].
    fractions: Vec<u32>,
    arch: Arch,
}

impl RemapTable {
    /// Computes the map of pictures of `size` (columns, rows; each at least 2) whose pixel at `p` comes from
    /// `source(p)`; pixel centres are at integers.
    pub(super) fn new(size: (u32, u32), source: impl Fn(DVec2) -> Option<DVec2>) -> Self {
        let (width, height) = size;
        let pixels = width as usize * height as usize;
        let (mut starts, mut fractions) = (Vec::with_capacity(pixels), Vec::with_capacity(pixels));
        let last_px = DVec2::new(f64::from(width) - 1.0, f64::from(height) - 1.0);
        for y in 0..height {
            for x in 0..width {
                let place_px = source(DVec2::new(f64::from(x), f64::from(y)));
                let place_px = place_px.filter(|p| p.cmpge(DVec2::splat(-0.5)).all() && p.cmple(last_px + 0.5).all());
                let Some(place_px) = place_px else {
                    starts.push(0);
                    fractions.push(NOWHERE);
                    continue;
                };
                let place_px = place_px.clamp(DVec2::ZERO, last_px);
                let corner_px = place_px.floor().min(last_px - 1.0);
                let part = ((place_px - corner_px) * f64::from(ONE)).round();
                starts.push(corner_px.y as u32 * width + corner_px.x as u32);
                fractions.push(part.x as u32 | (part.y as u32) << DOWN_SHIFT);
            }
        }
        Self { size, starts, fractions, arch: Arch::new() }
    }

    /// Returns columns and rows of the pictures.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Returns for each pixel the index of the upper left one of its four sources, and both fractions, for the GPU.
    pub(crate) fn packed_words(&self) -> [&[u32]; 2] {
        [&self.starts, &self.fractions]
    }

    /// Returns the source position of the pixel in column `x` and row `y`, as stored; `None` outside the source.
    pub fn source_px(&self, x: u32, y: u32) -> Option<DVec2> {
        let (width, at) = (self.size.0, (y * self.size.0 + x) as usize);
        let (start, fractions) = (self.starts[at], self.fractions[at]);
        let corner = DVec2::new(f64::from(start % width), f64::from(start / width));
        let part = DVec2::new(f64::from(fractions & 0xFFFF), f64::from(fractions >> DOWN_SHIFT)) / f64::from(ONE);
        (fractions != NOWHERE).then_some(corner + part)
    }

    /// Resamples a colour picture into `into`, in sRGB values.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`RemapTable::size`].
    pub fn remap_color(&self, from: &ColorImage, into: &mut ColorImage) {
        into.resize(self.size.0, self.size.1);
        self.remap_color_rows(from, 0..self.size.1 as usize, &mut into.rgb);
    }

    /// Resamples a grey picture into `into`.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`RemapTable::size`].
    pub fn remap_gray(&self, from: &GrayImage, into: &mut GrayImage) {
        into.resize(self.size.0, self.size.1);
        self.remap_gray_rows(from, 0..self.size.1 as usize, &mut into.luma);
    }

    /// Resamples some rows like [`RemapTable::remap_color`]: `into` has their bytes.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`RemapTable::size`], or if `rows` exceed it.
    pub fn remap_color_rows(&self, from: &ColorImage, rows: Range<usize>, into: &mut [u8]) {
        assert_eq!(from.size(), self.size, "pictures are resampled at one size");
        let (starts, fractions) = self.row_entries(rows);
        let stride = self.size.0 as usize * RGB;
        self.arch.dispatch(Color { starts, fractions, from: &from.rgb, stride, into: into.as_chunks_mut().0 });
    }

    /// Resamples some rows like [`RemapTable::remap_gray`]: `into` has their bytes.
    ///
    /// # Panics
    /// Panics if `from` does not have the size [`RemapTable::size`], or if `rows` exceed it.
    pub fn remap_gray_rows(&self, from: &GrayImage, rows: Range<usize>, into: &mut [u8]) {
        assert_eq!(from.size(), self.size, "pictures are resampled at one size");
        let (starts, fractions) = self.row_entries(rows);
        self.arch.dispatch(Gray { starts, fractions, from: &from.luma, stride: self.size.0 as usize, into });
    }

    /// Returns the starts and fractions of the pixels in `rows`.
    fn row_entries(&self, rows: Range<usize>) -> (&[u32], &[u32]) {
        let width = self.size.0 as usize;
        let pixels = rows.start * width..rows.end * width;
        (&self.starts[pixels.clone()], &self.fractions[pixels])
    }
}

/// Returns the weights of the upper left, upper right, lower left and lower right neighbour, which sum to [`ONE`].
#[inline(always)]
fn bilinear_weights(fractions: u32) -> [u32; 4] {
    let (across, down) = (fractions & 0x1FF, (fractions >> DOWN_SHIFT) & 0x1FF);
    let both = (across * down + ONE / 2) / ONE;
    [ONE + both - across - down, across - both, down - both, both]
}

/// Returns a mask of all bits, or 0 for [`NOWHERE`].
#[inline(always)]
fn inside_mask(fractions: u32) -> u32 {
    !((fractions as i32 >> 31) as u32)
}

/// Resamples grey pixels; `stride` is the bytes of a row.
struct Gray<'a> {
    starts: &'a [u32],
    fractions: &'a [u32],
    from: &'a [u8],
    stride: usize,
    into: &'a mut [u8],
}

impl WithSimd for Gray<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let blocks = self.starts.chunks(BLOCK).zip(self.fractions.chunks(BLOCK));
        let mut corners = [0_u32; BLOCK];
        for ((starts, fractions), into) in blocks.zip(self.into.chunks_mut(BLOCK)) {
            for (corners, &start) in corners.iter_mut().zip(starts) {
                // Packs the four neighbours into one word.
                let four = &self.from[start as usize..][..self.stride + 2];
                *corners = u32::from_le_bytes([four[0], four[1], four[self.stride], four[self.stride + 1]]);
            }
            for ((into, &corners), &fractions) in into.iter_mut().zip(&corners).zip(fractions) {
                let [a, b, c, d] = bilinear_weights(fractions);
                let upper = (corners & 0xFF) * a + (corners >> 8 & 0xFF) * b;
                let lower = (corners >> 16 & 0xFF) * c + (corners >> 24) * d;
                *into = (((upper + lower + ONE / 2) / ONE) & inside_mask(fractions)) as u8;
            }
        }
    }
}

/// Resamples sRGB pixels; `stride` is the bytes of a row.
struct Color<'a> {
    starts: &'a [u32],
    fractions: &'a [u32],
    from: &'a [u8],
    stride: usize,
    into: &'a mut [[u8; RGB]],
}

impl WithSimd for Color<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        /// Red and blue of a pixel, each with 8 free bits above it, so that one product weights both.
        const RED_BLUE: u32 = 0x00FF_00FF;
        let blocks = self.starts.chunks(BLOCK).zip(self.fractions.chunks(BLOCK));
        let (mut uppers, mut lowers, mut pixels) = ([0_u64; BLOCK], [0_u64; BLOCK], [0_u32; BLOCK]);
        // Eight bytes hold two pixels; at the very end of the picture they begin two bytes earlier.
        let last = self.from.len() - 8;
        for ((starts, fractions), into) in blocks.zip(self.into.chunks_mut(BLOCK)) {
            for ((upper, lower), &start) in uppers.iter_mut().zip(&mut lowers).zip(starts) {
                let at = start as usize * RGB;
                let below = at + self.stride;
                *upper = read_u64(self.from, at);
                *lower = read_u64(self.from, below.min(last)) >> ((below.max(last) - last) * 8);
            }
            let neighbours = uppers.iter().zip(&lowers).zip(fractions);
            for (pixel, ((&upper, &lower), &fractions)) in pixels.iter_mut().zip(neighbours) {
                let [a, b, c, d] = bilinear_weights(fractions);
                let four = [upper as u32, (upper >> 24) as u32, lower as u32, (lower >> 24) as u32];
                let green = (four[0] >> 8 & 0xFF) * a
                    + (four[1] >> 8 & 0xFF) * b
                    + (four[2] >> 8 & 0xFF) * c
                    + (four[3] >> 8 & 0xFF) * d;
                let others = (four[0] & RED_BLUE) * a
                    + (four[1] & RED_BLUE) * b
                    + (four[2] & RED_BLUE) * c
                    + (four[3] & RED_BLUE) * d;
                // Sums are scaled by 256. Red and blue are shifted back; green belongs 8 bits higher, so it stays.
                let green = (green + ONE / 2) & 0xFF00;
                let others = (others + (ONE / 2 * 0x1_0001)) >> 8 & RED_BLUE;
                *pixel = (green | others) & inside_mask(fractions);
            }
            for (into, pixel) in into.iter_mut().zip(&pixels) {
                let [red, green, blue, _] = pixel.to_le_bytes();
                *into = [red, green, blue];
            }
        }
    }
}

/// Returns the eight bytes from `at` on, the first one lowest.
#[inline(always)]
fn read_u64(bytes: &[u8], at: usize) -> u64 {
    bytes[at..].first_chunk().map_or(0, |&eight| u64::from_le_bytes(eight))
}
