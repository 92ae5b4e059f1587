//! Decoding of uncompressed formats.

use pulp::{Arch, Simd, WithSimd};

use super::PixelError;
use super::transfer::{self, Table};
use super::ycc::{self, Coefficients};
use crate::layout::{Component, Family, Layout, Range};
use bokehcam::frame::ColorImage;

/// Decodes raw pictures row by row, so that intermediate rows stay in the cache.
#[derive(Debug)]
pub(super) struct RawDecoder {
    arch: Arch,
    coefficients: Coefficients,
    table: Option<Box<Table>>,
    rows: Rows,
}

/// Buffers for the stages of one row.
#[derive(Debug)]
struct Rows {
    luma: Vec<u8>,
    /// Chroma samples as read: alternating, or those of two rows of one kind.
    chroma: [Vec<u8>; 2],
    /// Cb and Cr for pairs of pixels, times 4, with the last sample repeated.
    half: [Vec<u16>; 2],
    /// Cb and Cr for each pixel, relative to grey, times 256.
    full: [Vec<i16>; 2],
    colors: [Vec<u8>; 3],
}

impl RawDecoder {
    /// Creates a decoder for pictures of this layout: RGB, grey or Y'CbCr.
    pub(super) fn new(layout: &Layout) -> Self {
        let is_rgb = matches!(layout.family(), Family::Rgb24 { .. } | Family::Grey);
        // For RGB and grey, the table expands the range; for Y'CbCr, the coefficients do.
        let range = if is_rgb { layout.range } else { Range::Full };
        let width = if is_rgb { 0 } else { layout.width as usize };
        let pairs = width.div_ceil(2);
        let bytes = || vec![0; 2 * pairs];
        Self {
            arch: Arch::new(),
            coefficients: Coefficients::new(layout.matrix, layout.range),
            table: transfer::build_table(layout.transfer, range),
            rows: Rows {
                luma: bytes(),
                chroma: [bytes(), bytes()],
                half: [vec![0; pairs + 1], vec![0; pairs + 1]],
                full: [vec![0; 2 * pairs], vec![0; 2 * pairs]],
                colors: [bytes(), bytes(), bytes()],
            },
        }
    }

    /// Uses the vector instructions `arch` instead of the best available ones.
    #[cfg(test)]
    pub(super) fn with_arch(mut self, arch: Arch) -> Self {
        self.arch = arch;
        self
    }

    /// Decodes a picture of `layout` into `out` (resized to fit); fails if one of its planes is truncated.
    pub(super) fn decode(&mut self, layout: &Layout, planes: &[&[u8]], out: &mut ColorImage) -> Result<(), PixelError> {
        for (index, plane) in planes.iter().enumerate() {
            let (found_bytes, min_size_bytes) = (plane.len(), layout.min_size_bytes(index));
            if found_bytes < min_size_bytes {
                return Err(PixelError::Short { found_bytes, min_size_bytes });
            }
        }
        out.resize(layout.width, layout.height);
        let arch = self.arch;
        arch.dispatch(Frame { raw: self, layout, planes, rgb: &mut out.rgb });
        Ok(())
    }
}

/// One picture to decode, compiled for each instruction set.
struct Frame<'a> {
    raw: &'a mut RawDecoder,
    layout: &'a Layout,
    planes: &'a [&'a [u8]],
    rgb: &'a mut [u8],
}

/// One component of a picture in its memory plane.
#[derive(Clone, Copy)]
struct Samples<'a> {
    plane: &'a [u8],
    at: Component,
}

impl<'a> Samples<'a> {
    #[inline(always)]
    fn row(self, y: usize) -> &'a [u8] {
        &self.plane[self.at.offset_bytes + y * self.at.stride_bytes..][..self.at.row_bytes]
    }

    /// Returns the nearest and the second nearest row of chroma, which has half the picture's rows, to row `y`.
    #[inline(always)]
    fn nearest_two_rows(self, y: usize) -> [&'a [u8]; 2] {
        let near = y / 2;
        let far = if y.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(self.at.rows - 1) };
        [self.row(near), self.row(far)]
    }
}

impl WithSimd for Frame<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { raw, layout, planes, rgb } = self;
        let width = layout.width as usize;
        let mut components = layout.components().map(|at| Samples { plane: planes[at.plane], at });
        let Some(first) = components.next() else { return };
        let [second, third] = [components.next().unwrap_or(first), components.next().unwrap_or(first)];
        let family = layout.family();
        for (y, out) in rgb.chunks_exact_mut(3 * width).enumerate() {
            match family {
                Family::Rgb24 { swapped: false } => out.copy_from_slice(first.row(y)),
                Family::Rgb24 { swapped: true } => bgr_to_rgb(first.row(y), out),
                Family::Grey => {
                    let row = first.row(y);
                    ycc::interleave_rgb([row, row, row], out);
                }
                Family::Packed422 { luma, cb, cr } => {
                    raw.rows.load_packed(first.row(y), luma == 0, cb < cr);
                    raw.rows.convert_row(&raw.coefficients, None, out);
                }
                Family::SemiPlanar420 { swapped, .. } => {
                    raw.rows.interpolate_semi_planar(second.nearest_two_rows(y), swapped);
                    raw.rows.convert_row(&raw.coefficients, Some(first.row(y)), out);
                }
                Family::Planar420 { swapped, .. } => {
                    let [cb, cr] = if swapped { [third, second] } else { [second, third] };
                    raw.rows.interpolate_planar([cb.nearest_two_rows(y), cr.nearest_two_rows(y)]);
                    raw.rows.convert_row(&raw.coefficients, Some(first.row(y)), out);
                }
                // Unreachable: these are not raw colour formats.
                Family::Depth16 | Family::Jpeg => return,
            }
            if let Some(table) = &raw.table {
                out.iter_mut().for_each(|byte| *byte = table[usize::from(*byte)]);
            }
        }
    }
}

impl Rows {
    /// Splits a 4:2:2 row into luma and the chroma of pairs, times 4: luma and chroma alternate, and so do Cb and Cr.
    #[inline(always)]
    fn load_packed(&mut self, row: &[u8], luma_first: bool, cb_first: bool) {
        let width = row.len() / 2;
        let [alternating, _] = &mut self.chroma;
        let (luma, alternating) = (&mut self.luma[..width], &mut alternating[..width]);
        if luma_first {
            ycc::deinterleave_pairs(row, luma, alternating);
        } else {
            ycc::deinterleave_pairs(row, alternating, luma);
        }
        let [cb, cr] = &mut self.half;
        let (first, second) = if cb_first { (cb, cr) } else { (cr, cb) };
        for ((pair, first), second) in alternating.as_chunks::<2>().0.iter().zip(&mut *first).zip(&mut *second) {
            let pair = u16::from_le_bytes(*pair);
            (*first, *second) = ((pair & 0xFF) * 4, (pair >> 8) * 4);
        }
        // A last pixel without a partner has only one chroma sample; the other one is copied from its neighbour.
        if let ([.., last], true) = (&*alternating, width % 2 == 1) {
            let at = width / 2;
            first[at] = u16::from(*last) * 4;
            // Grey is 128, times 4: 512.
            second[at] = at.checked_sub(1).map_or(512, |before| second[before]);
        }
    }

    /// Interpolates the chroma of a 4:2:0 row, times 4, between two rows of alternating Cb and Cr.
    #[inline(always)]
    fn interpolate_semi_planar(&mut self, [near, far]: [&[u8]; 2], swapped: bool) {
        let [cb, cr] = &mut self.half;
        let (first, second) = if swapped { (cr, cb) } else { (cb, cr) };
        let pairs = near.as_chunks::<2>().0.iter().zip(far.as_chunks::<2>().0);
        for (((near, far), first), second) in pairs.zip(first).zip(second) {
            let (near, far) = (u16::from_le_bytes(*near), u16::from_le_bytes(*far));
            *first = 3 * (near & 0xFF) + (far & 0xFF);
            *second = 3 * (near >> 8) + (far >> 8);
        }
    }

    /// Interpolates the chroma of a 4:2:0 row, times 4, between two rows of Cb and two of Cr.
    #[inline(always)]
    fn interpolate_planar(&mut self, [cb, cr]: [[&[u8]; 2]; 2]) {
        ycc::interpolate_quarter(cb[0], cb[1], &mut self.half[0]);
        ycc::interpolate_quarter(cr[0], cr[1], &mut self.half[1]);
    }

    /// Converts luma (by default the row that [`Rows::load_packed`] stored) and the chroma of pairs to pixels.
    #[inline(always)]
    fn convert_row(&mut self, coefficients: &Coefficients, luma: Option<&[u8]>, out: &mut [u8]) {
        let width = out.len() / 3;
        let luma = luma.unwrap_or(&self.luma[..width]);
        let [cb, cr] = &mut self.half;
        let [full_cb, full_cr] = &mut self.full;
        for (half, full) in [(cb, &mut *full_cb), (cr, &mut *full_cr)] {
            let last = half.len() - 1;
            half[last] = half[last - 1];
            ycc::upsample_chroma(half, full);
        }
        let [red, green, blue] = &mut self.colors;
        let (red, green, blue) = (&mut red[..width], &mut green[..width], &mut blue[..width]);
        ycc::ycc_to_rgb(
            coefficients,
            luma,
            [&full_cb[..width], &full_cr[..width]],
            [&mut *red, &mut *green, &mut *blue],
        );
        ycc::interleave_rgb([red, green, blue], out);
    }
}

/// Swaps blue, green, red into red, green, blue.
#[inline(always)]
fn bgr_to_rgb(row: &[u8], out: &mut [u8]) {
    for (out, &[blue, green, red]) in out.as_chunks_mut::<3>().0.iter_mut().zip(row.as_chunks::<3>().0) {
        *out = [red, green, blue];
    }
}
