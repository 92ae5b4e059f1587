//! Paints the picture into the window, row by row. twin: crates/window/src/present/gpu/present.wgsl

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::present::{Area, Drawing, StaleTone};
use bokehcam::frame::ColorImage;
use bokehcam::frame::scale::RowScaler;

/// Paints pictures into an area, scaling them if needed; caches the scaling weights between frames.
#[derive(Debug, Default)]
pub struct Scaler {
    scale: RowScaler,
}

/// Buffers for one thread.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Buffer for [`RowScaler::scale_row`].
    row: Vec<u16>,
    /// A scaled row, RGB.
    scaled: Vec<u8>,
}

impl Scaler {
    /// Prepares for a picture and an area; both must have pixels.
    pub fn prepare(&mut self, picture: &ColorImage, area: Area) {
        let [from, to] =
            [picture.size(), (area.width, area.height)].map(|(width, height)| (width as usize, height as usize));
        if from != to {
            self.scale.set_sizes(from, to);
        }
    }

    /// Paints row `y` of the area into `row`, which is shorter if the window cuts the area off: the picture before the
    /// blur left of the split, `picture` right of it, and the divider.
    pub fn paint_row(
        &self,
        arch: Arch,
        (drawing, picture): (&Drawing, &ColorImage),
        y: usize,
        scratch: &mut Scratch,
        row: &mut [u32],
    ) {
        let mut paint_columns = |picture: &ColorImage, columns: Range<usize>, row: &mut [u32]| {
            let columns = columns.start..columns.end.min(row.len());
            let Some(row) = row.get_mut(columns.clone()).filter(|row| !row.is_empty()) else { return };
            let width = drawing.area.width as usize;
            // Full width of the zoomed picture, and its first visible column.
            let (whole, first) = drawing
                .visible_region
                .map_or((width, 0), |part| ((part.factor * picture.width) as usize, part.origin.0 as usize));
            let (start, end) = (first + columns.start, first + columns.end);
            // If mirrored, reads columns from the other side, and reverses them below.
            let from = if drawing.mirror { whole - end..whole - start } else { start..end };
            let rgb = if let Some(part) = drawing.visible_region {
                scratch.scaled.resize(3 * from.len(), 0);
                part.copy_row(&picture.rgb, picture.width, part.origin.1 as usize + y, from, &mut scratch.scaled);
                &scratch.scaled[..]
            } else if picture.size() == (drawing.area.width, drawing.area.height) {
                &picture.rgb[3 * (y * width + from.start)..3 * (y * width + from.end)]
            } else {
                scratch.scaled.resize(3 * from.len(), 0);
                self.scale.scale_row(&picture.rgb, y, from, &mut scratch.row, &mut scratch.scaled);
                &scratch.scaled[..]
            };
            arch.dispatch(ExpandRgb { rgb, row });
            if drawing.mirror {
                row.reverse();
            }
        };
        let width = drawing.area.width as usize;
        let Some((before, split)) = drawing.split() else {
            paint_columns(picture, 0..width, row);
            return self.dim_if_stale(arch, drawing, row);
        };
        paint_columns(before, 0..split.at, row);
        paint_columns(picture, split.at..width, row);
        self.dim_if_stale(arch, drawing, row);
        for (columns, [r, g, b]) in split.divider() {
            let columns = columns.start.min(row.len())..columns.end.min(row.len());
            row[columns].fill(u32::from_be_bytes([0, r, g, b]));
        }
    }

    fn dim_if_stale(&self, arch: Arch, drawing: &Drawing, row: &mut [u32]) {
        if drawing.stale {
            arch.dispatch(DimStale { row });
        }
    }
}

/// Converts packed RGB bytes to words `0x00RRGGBB`.
struct ExpandRgb<'a> {
    rgb: &'a [u8],
    row: &'a mut [u32],
}

impl WithSimd for ExpandRgb<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (pixel, &[r, g, b]) in self.row.iter_mut().zip(self.rgb.as_chunks::<3>().0) {
            *pixel = u32::from_be_bytes([0, r, g, b]);
        }
    }
}

/// Makes pixels grey and dim, with the weights of [`StaleTone`].
struct DimStale<'a> {
    row: &'a mut [u32],
}

impl WithSimd for DimStale<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for pixel in self.row {
            let [r, g, b] = [*pixel >> 16 & 0xff, *pixel >> 8 & 0xff, *pixel & 0xff];
            let [red, green, blue] = StaleTone::LUMA_WEIGHTS;
            // Rounds the sum, and copies it to all three channels with the last factor.
            *pixel = ((red * r + green * g + blue * b + (1 << (StaleTone::FRACTION_BITS - 1)))
                >> StaleTone::FRACTION_BITS)
                * 0x0001_0101;
        }
    }
}
