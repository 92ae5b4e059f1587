//! R'G'B' to the raw formats of cameras: the inverse of [`capture::pixels`](crate::capture::pixels), for programs that
//! expect a camera's format.
//!
//! Chroma is sited where the decoder assumes it: horizontally on the left pixel of each pair, and vertically midway
//! between its two rows. So nothing shifts, whatever siting a picture declares.

use pulp::{Arch, Simd, WithSimd};

use super::yuv::Converter;
use crate::layout::{Component, Family, Layout, Range};
use bokehcam::frame::ColorImage;

/// Encodes pictures of one layout, with its own buffers.
#[derive(Debug)]
pub struct Encoder {
    arch: Arch,
    layout: Layout,
    converter: Converter,
    /// A row of the picture, or the sum of two: red, green and blue, each padded by one value before it and two after.
    sums: [Vec<u16>; 3],
}

impl Encoder {
    /// Creates an encoder for pictures of this layout; `None` if the layout is compressed or has no colours. Values are
    /// not converted to another transfer curve.
    pub fn new(layout: &Layout) -> Option<Self> {
        match layout.family() {
            Family::Rgb24 { .. }
            | Family::Packed422 { .. }
            | Family::SemiPlanar420 { .. }
            | Family::Planar420 { .. } => {}
            Family::Grey | Family::Depth16 | Family::Jpeg => return None,
        }
        let sums = || vec![0; layout.width as usize + 3];
        Some(Self {
            arch: Arch::new(),
            layout: *layout,
            converter: Converter::new(layout.matrix, layout.range),
            sums: [sums(), sums(), sums()],
        })
    }

    /// Encodes `picture` into the memory planes of the layout. Does not allocate.
    ///
    /// # Panics
    /// The picture has another size, or a plane is shorter than the layout [needs](Layout::min_size_bytes).
    pub fn encode(&mut self, picture: &ColorImage, planes: &mut [&mut [u8]]) {
        let Self { arch, layout, converter, sums } = self;
        assert_eq!(picture.size(), (layout.width, layout.height), "an encoder is for pictures of one size");
        arch.dispatch(RawEncode { layout, converter, sums, rgb: &picture.rgb, planes });
    }
}

/// One picture to encode, compiled for each instruction set.
struct RawEncode<'a, 'p> {
    layout: &'a Layout,
    converter: &'a Converter,
    sums: &'a mut [Vec<u16>; 3],
    rgb: &'a [u8],
    planes: &'a mut [&'p mut [u8]],
}

impl WithSimd for RawEncode<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { layout, converter, sums, rgb, planes } = self;
        let row_bytes = 3 * layout.width as usize;
        let mut components = layout.components();
        let Some(first) = components.next() else { return };
        let (second, third) = (components.next(), components.next());
        let family = layout.family();
        for (y, row) in rgb.chunks_exact(row_bytes).enumerate() {
            let out = row_mut(planes, &first, y);
            match family {
                Family::Rgb24 { swapped } => write_rgb(row, out, swapped, layout.range),
                Family::Packed422 { luma, cb, .. } => {
                    load_sums(sums, row, None);
                    write_packed(converter, row, sums, out, luma, cb);
                }
                _ => {
                    for (luma, pixel) in out.iter_mut().zip(row.as_chunks::<3>().0) {
                        *luma = converter.luma(pixel.map(i32::from));
                    }
                }
            }
        }
        for (y, rows) in rgb.chunks(2 * row_bytes).enumerate() {
            let (upper, lower) = rows.split_at(row_bytes);
            // At an odd edge, the only row counts twice.
            let lower = if lower.is_empty() { upper } else { lower };
            match (family, second, third) {
                (Family::SemiPlanar420 { swapped, .. }, Some(pairs), _) => {
                    load_sums(sums, upper, Some(lower));
                    for (pair, sum) in
                        row_mut(planes, &pairs, y).as_chunks_mut::<2>().0.iter_mut().zip(chroma_sums(sums))
                    {
                        let [cb, cr] = converter.chroma(sum, 3);
                        *pair = if swapped { [cr, cb] } else { [cb, cr] };
                    }
                }
                (Family::Planar420 { swapped, .. }, Some(one), Some(other)) => {
                    load_sums(sums, upper, Some(lower));
                    // One component after the other, as a memory plane can contain both.
                    for (component, which) in [(one, usize::from(swapped)), (other, usize::from(!swapped))] {
                        for (out, sum) in row_mut(planes, &component, y).iter_mut().zip(chroma_sums(sums)) {
                            *out = converter.chroma(sum, 3)[which];
                        }
                    }
                }
                _ => return,
            }
        }
    }
}

/// Returns a row of a component.
#[inline(always)]
fn row_mut<'a>(planes: &'a mut [&mut [u8]], at: &Component, y: usize) -> &'a mut [u8] {
    &mut planes[at.plane][at.offset_bytes + y * at.stride_bytes..][..at.row_bytes]
}

/// Writes a row of RGB.
#[inline(always)]
fn write_rgb(row: &[u8], out: &mut [u8], swapped: bool, range: Range) {
    if swapped {
        for (out, &[red, green, blue]) in out.as_chunks_mut::<3>().0.iter_mut().zip(row.as_chunks::<3>().0) {
            *out = [blue, green, red];
        }
    } else {
        out.copy_from_slice(row);
    }
    if range == Range::Limited {
        out.iter_mut().for_each(|value| *value = (16 + (u32::from(*value) * 219 + 127) / 255) as u8);
    }
}

/// Splits one row, or the sum of two, into channels; replicates the values at both ends.
#[inline(always)]
fn load_sums(sums: &mut [Vec<u16>; 3], upper: &[u8], lower: Option<&[u8]>) {
    let width = upper.len() / 3;
    let [red, green, blue] = sums;
    let (reds, greens, blues) = (&mut red[1..=width], &mut green[1..=width], &mut blue[1..=width]);
    let colors = reds.iter_mut().zip(greens).zip(blues);
    match lower {
        None => {
            for (((red, green), blue), pixel) in colors.zip(upper.as_chunks::<3>().0) {
                [*red, *green, *blue] = pixel.map(u16::from);
            }
        }
        Some(lower) => {
            let rows = upper.as_chunks::<3>().0.iter().zip(lower.as_chunks::<3>().0);
            for (((red, green), blue), (upper, lower)) in colors.zip(rows) {
                [*red, *green, *blue] = std::array::from_fn(|p| u16::from(upper[p]) + u16::from(lower[p]));
            }
        }
    }
    for sums in [red, green, blue] {
        sums[0] = sums[1];
        let last = sums[width];
        sums[width + 1..].fill(last);
    }
}

/// Returns four times the chroma-siting mean (1 2 1) / 4 around the left pixel of each pair.
#[inline(always)]
fn chroma_sums(sums: &[Vec<u16>; 3]) -> impl Iterator<Item = [i32; 3]> + '_ {
    let [red, green, blue] = sums.each_ref().map(|sums| {
        let (left, right) = (sums.as_chunks::<2>().0, sums[2..].as_chunks::<2>().0);
        left.iter().zip(right).map(|(pair, next)| i32::from(pair[0]) + 2 * i32::from(pair[1]) + i32::from(next[0]))
    });
    red.zip(green).zip(blue).map(|((red, green), blue)| [red, green, blue])
}

/// Writes a row of 4:2:2, in which `luma` and `cb` are the offsets of the first luma and of the Cb sample. Half a pair,
/// at an odd edge, has one chroma sample.
#[inline(always)]
fn write_packed(converter: &Converter, row: &[u8], sums: &[Vec<u16>; 3], out: &mut [u8], luma: usize, cb: usize) {
    let cr = cb ^ 2;
    let (pairs, rest) = out.as_chunks_mut::<4>();
    let (colors, last) = row.as_chunks::<6>();
    let mut chroma = chroma_sums(sums);
    for ((out, pair), sum) in pairs.iter_mut().zip(colors).zip(&mut chroma) {
        (out[luma], out[luma + 2]) = (
            converter.luma([0, 1, 2].map(|p| i32::from(pair[p]))),
            converter.luma([3, 4, 5].map(|p| i32::from(pair[p]))),
        );
        [out[cb], out[cr]] = converter.chroma(sum, 2);
    }
    if let (&[red, green, blue], Some(sum), [_, _]) = (last, chroma.next(), &*rest) {
        rest[luma] = converter.luma([red, green, blue].map(i32::from));
        let chroma_at = luma ^ 1;
        rest[chroma_at] = converter.chroma(sum, 2)[usize::from(chroma_at != cb)];
    }
}

#[cfg(test)]
mod tests;
