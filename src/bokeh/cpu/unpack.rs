//! Unpacking: pixels to linear light with highlights expanded, and depth to signed CoC.
//!
//! twin: shaders/blur/unpack.wgsl, shaders/blur/radii.wgsl

use std::ops::Range;

use pulp::Simd;

use super::pixels::{Pixels, Radii};
use crate::bokeh::plan::Plan;
use crate::color::luminance;
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{madd, prefetch};
use crate::frame::Matte;
use crate::optics::CocField;

/// Polynomial approximation of [`srgb_to_linear`](crate::color::srgb_to_linear) for 8-bit values, which vectors can
/// evaluate: off by less than 3e-5, or 0.004 of the step to the next code.
#[inline(always)]
pub fn decode_srgb<S: Simd>(code: u8) -> f32 {
    const CURVE: [f32; 5] = [-0.533_835_2, 0.768_090_4, 0.499_064_57, 0.034_400_677, 0.000_875_118];
    let x = f32::from(code) * (1.0 / 255.0);
    let mut light = madd::<S>(-0.085_403_08, x, 0.316_778_17);
    for factor in &CURVE {
        light = madd::<S>(light, x, *factor);
    }
    if x <= 0.04045 { x * (1.0 / 12.92) } else { light }
}

/// Returns the highlight expansion factor of a colour of this luminance; dark colours hardly change.
///
/// With `expansion = 1 + 1/M`, white becomes `M + 1` times as bright as it looks. All channels share the factor, so
/// that the hue stays.
#[inline(always)]
pub fn expansion_factor(luminance: f32, expansion: f32) -> f32 {
    expansion / (expansion - luminance)
}

/// Returns the factor that reverses [`expansion_factor`], for a colour of this expanded luminance.
#[inline(always)]
pub fn compression_factor(luminance: f32, expansion: f32) -> f32 {
    expansion / (expansion + luminance)
}

/// The input frame.
#[derive(Clone, Copy)]
pub struct InputFrame<'a> {
    /// Columns and rows.
    pub size: (usize, usize),
    pub pixels: Pixels<'a>,
    pub coc: Radii<'a>,
    /// Its mixed pixels, if they are separated into two surfaces.
    pub matte: Option<&'a Matte>,
    /// Highlight recovery, 1 + 1/M; infinite when off.
    pub expansion: f32,
}

/// Some pixels of a row: linear light r, g, b and CoC.
pub type PixelRun<const W: usize> = CacheAligned<[[f32; W]; 4]>;

/// Some pixels of a row, each with one surface or two.
pub struct Surfaces<const W: usize> {
    /// The only surface of a pixel, or the farther of two.
    pub back: PixelRun<W>,
    /// The nearer of two; valid only if `mixed`, and where its alpha is above 0.
    pub front: PixelRun<W>,
    /// Alpha of the nearer surface.
    pub alpha: CacheAligned<[f32; W]>,
    /// Known fraction of the farther surface.
    pub behind: CacheAligned<[f32; W]>,
    /// Whether any pixel here has two surfaces.
    pub mixed: bool,
}

impl<const W: usize> Surfaces<W> {
    /// Creates surfaces without mixed pixels.
    pub fn new() -> Self {
        let [back, front] = [CacheAligned([[0.0; W]; 4]); 2];
        Self { back, front, alpha: CacheAligned([0.0; W]), behind: CacheAligned([1.0; W]), mixed: false }
    }

    /// Returns both surfaces composited, with the CoC of the one that covers more.
    #[inline(always)]
    pub fn composite_surfaces(&self) -> PixelRun<W> {
        let mut shown = self.back;
        for (p, plane) in shown.0.iter_mut().enumerate() {
            for (x, value) in plane.iter_mut().enumerate() {
                let (front, alpha) = (self.front.0[p][x], self.alpha.0[x]);
                let front_weight = if p < 3 { alpha } else { f32::from(u8::from(alpha > 0.5)) };
                *value += front_weight * (front - *value);
            }
        }
        shown
    }
}

impl<'a> InputFrame<'a> {
    /// Creates the input frame of a plan.
    pub fn new(plan: &Plan, pixels: Pixels<'a>, coc: Radii<'a>) -> Self {
        let matte = match coc {
            Radii::Field(field, depth) => plan.matte(depth, field),
            Radii::Each(_) => None,
        };
        // Only codes are clipped at white.
        let expansion = if matches!(pixels, Pixels::Linear(_)) { f32::INFINITY } else { plan.expansion };
        Self { size: (plan.width, plan.height), pixels, coc, matte, expansion }
    }

    /// Unpacks some pixels of row `y` from column `x0` on; outside, the outermost pixels repeat.
    #[inline(always)]
    pub fn unpack<S: Simd, const W: usize>(&self, y: usize, x0: isize, columns: usize, surfaces: &mut Surfaces<W>) {
        let (width, (before, first, count)) = (self.size.0, self.inside(x0, columns));
        let end = before + count;
        self.unpack_light::<S, W>(y, x0, columns, &mut surfaces.back);
        compute_coc_row(self, y, first, &mut surfaces.back.0[3][before..end]);
        self.separate_surfaces(y * width + first..y * width + first + count, before, surfaces);
        if before > 0 || end < columns {
            let Surfaces { back, front, alpha, behind, mixed } = surfaces;
            let twos = front.0.iter_mut().chain([&mut alpha.0, &mut behind.0]).filter(|_| *mixed);
            for plane in back.0.iter_mut().chain(twos) {
                let (left, right) = (plane[before], plane[end - 1]);
                plane[..before].fill(left);
                plane[end..columns].fill(right);
            }
        }
    }

    /// Same as [`InputFrame::unpack`], but only the light of pixels, as one surface.
    #[inline(always)]
    pub fn unpack_light<S: Simd, const W: usize>(&self, y: usize, x0: isize, columns: usize, run: &mut PixelRun<W>) {
        let (width, (before, first, count)) = (self.size.0, self.inside(x0, columns));
        let (end, row) = (before + count, y * width * 3..(y + 1) * width * 3);
        let [red, green, blue, _] = &mut run.0;
        match self.pixels {
            Pixels::Srgb(rgb) => {
                // Deinterleaved as bytes first, which vectorises.
                let mut codes = [[0u8; W]; 3];
                let [r, g, b] = &mut codes;
                let pixels = rgb[row][first * 3..].as_chunks::<3>().0;
                for (((pixel, r), g), b) in pixels[..count].iter().zip(r).zip(g).zip(b) {
                    (*r, *g, *b) = (pixel[0], pixel[1], pixel[2]);
                }
                for (plane, codes) in [red, green, blue].into_iter().zip(&codes) {
                    for (light, &code) in plane[before..end].iter_mut().zip(codes) {
                        *light = decode_srgb::<S>(code);
                    }
                }
            }
            Pixels::Codes16(rgb, curves) => {
                let pixels = rgb[row][first * 3..].as_chunks::<3>().0[..count].iter();
                let planes = red[before..].iter_mut().zip(&mut green[before..]).zip(&mut blue[before..]);
                let [curve_r, curve_g, curve_b] = &curves.0;
                for (pixel, ((r, g), b)) in pixels.zip(planes) {
                    (*r, *g, *b) = (curve_r.decode(pixel[0]), curve_g.decode(pixel[1]), curve_b.decode(pixel[2]));
                }
            }
            Pixels::Linear(rgb) => {
                let pixels = rgb[row][first * 3..].as_chunks::<3>().0[..count].iter();
                let planes = red[before..].iter_mut().zip(&mut green[before..]).zip(&mut blue[before..]);
                for (pixel, ((r, g), b)) in pixels.zip(planes) {
                    (*r, *g, *b) =
                        (Pixels::clamp_light(pixel[0]), Pixels::clamp_light(pixel[1]), Pixels::clamp_light(pixel[2]));
                }
            }
        }
        if self.expansion.is_finite() {
            let [red, green, blue, _] = &mut run.0;
            for x in before..end {
                let factor = expansion_factor(luminance(red[x], green[x], blue[x]), self.expansion);
                (red[x], green[x], blue[x]) = (red[x] * factor, green[x] * factor, blue[x] * factor);
            }
        }
        for plane in &mut run.0[..3] {
            let (left, right) = (plane[before], plane[end - 1]);
            plane[..before].fill(left);
            plane[end..columns].fill(right);
        }
    }

    /// Returns how many of some columns from `x0` on are before the picture, the first one inside, and their number.
    #[inline(always)]
    fn inside(&self, x0: isize, columns: usize) -> (usize, usize, usize) {
        let before = (-x0).clamp(0, columns as isize) as usize;
        let first = x0.max(0) as usize;
        (before, first, self.size.0.saturating_sub(first).min(columns - before))
    }

    /// Prefetches the memory that [`InputFrame::unpack`] reads of row `y`.
    #[inline(always)]
    pub fn prefetch(&self, y: usize, x0: isize, columns: usize) {
        let (width, height) = self.size;
        let first = x0.max(0) as usize;
        let end = (x0 + columns as isize).clamp(0, width as isize) as usize;
        let values = (y * width + first) * 3..(y * width + end) * 3;
        match self.pixels {
            Pixels::Srgb(rgb) => prefetch(&rgb[values]),
            Pixels::Codes16(rgb, _) => prefetch(&rgb[values]),
            Pixels::Linear(rgb) => prefetch(&rgb[values]),
        }
        match self.coc {
            Radii::Field(CocField::Depth(_), Some(map)) if map.size() == (width as u32, height as u32) => {
                prefetch(&map.metres[y * width + first..y * width + end]);
            }
            _ => {}
        }
    }

    /// Separates the mixed pixels in `range` into their surfaces; the first pixel of the range is at index `at` of the
    /// surfaces.
    #[inline(always)]
    fn separate_surfaces<const W: usize>(&self, range: Range<usize>, at: usize, surfaces: &mut Surfaces<W>) {
        surfaces.mixed = false;
        let (Radii::Field(CocField::Depth(lens), _), Some(matte)) = (self.coc, self.matte) else { return };
        let start = range.start;
        let Surfaces { back, front, alpha, behind, mixed } = surfaces;
        for pixel in matte.pixels_in(range) {
            if !*mixed {
                front.0.as_flattened_mut().fill(0.0);
                alpha.0.fill(0.0);
                behind.0.fill(1.0);
                *mixed = true;
            }
            let x = at + pixel.at as usize - start;
            // Both colours get the highlight factor of the pixel, so that they composite to it again.
            let factor = match self.expansion.is_finite() {
                true => compression_factor(luminance(back.0[0][x], back.0[1][x], back.0[2][x]), self.expansion).recip(),
                false => 1.0,
            };
            (alpha.0[x], behind.0[x]) = (pixel.alpha, pixel.background_alpha);
            for p in 0..3 {
                let own = back.0[p][x];
                // Depth may be that of another frame with other colours: light is clamped to 0.
                front.0[p][x] = (own + (1.0 - pixel.alpha) * factor * pixel.difference[p]).max(0.0);
                back.0[p][x] = (own - pixel.alpha * factor * pixel.difference[p]).max(0.0);
            }
            (front.0[3][x], back.0[3][x]) = (lens.coc_px(pixel.near_m), lens.coc_px(pixel.far_m));
        }
    }
}

/// Computes the CoC of the pixels of row `y` from column `x0` on.
#[inline(always)]
pub fn compute_coc_row(source: &InputFrame<'_>, y: usize, x0: usize, coc: &mut [f32]) {
    let (width, height) = source.size;
    let (field, depth) = match source.coc {
        Radii::Field(field, depth) => (field, depth),
        Radii::Each(coc_px) => return coc.copy_from_slice(&coc_px[y * width + x0..][..coc.len()]),
    };
    match (field, depth) {
        (CocField::Depth(lens), Some(map)) if !map.metres.is_empty() => {
            let (w, h) = (map.width as usize, map.height as usize);
            let row = &map.metres[nearest_sample(y, height, h) * w..][..w];
            if w == width {
                for (coc, &metres) in coc.iter_mut().zip(&row[x0..]) {
                    *coc = lens.coc_px(metres);
                }
            } else {
                for (x, coc) in coc.iter_mut().enumerate() {
                    *coc = lens.coc_px(row[nearest_sample(x0 + x, width, w)]);
                }
            }
        }
        (CocField::Depth(lens), _) => coc.fill(lens.coc_px(0.0)),
        (CocField::Uniform { radius_px }, _) => coc.fill(*radius_px),
        (CocField::Ramp(ramp), _) => {
            for (x, coc) in coc.iter_mut().enumerate() {
                *coc = ramp.coc_px((x0 + x) as f32, y as f32);
            }
        }
    }
}

/// Returns the sample, of a row of `of` values, at pixel `index` of `pixels`.
#[inline(always)]
pub fn nearest_sample(index: usize, pixels: usize, of: usize) -> usize {
    if of == pixels { index } else { ((2 * index + 1) * of / (2 * pixels)).min(of - 1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{linear_to_srgb, srgb_to_linear};

    #[test]
    fn expansion_is_undone_and_white_is_as_bright_as_said() {
        for expansion in [1.0 + 1.0 / 8.0, 1.5] {
            for step in 0..=100 {
                let light = step as f32 / 100.0;
                let expanded = light * expansion_factor(light, expansion);
                assert!(
                    (expanded * compression_factor(expanded, expansion) - light).abs() < 1e-5,
                    "{expansion} {light}"
                );
            }
        }
        assert_eq!(expansion_factor(0.0, 1.125), 1.0);
        assert!((expansion_factor(1.0, 1.0 + 1.0 / 8.0) - 9.0).abs() < 1e-4);
    }

    #[test]
    fn the_polynomial_is_the_curve() {
        for code in 0..=255u8 {
            let exact = srgb_to_linear(f32::from(code) / 255.0);
            assert!((decode_srgb::<pulp::Scalar>(code) - exact).abs() < 3e-5, "{code}");
            assert_eq!((linear_to_srgb(decode_srgb::<pulp::Scalar>(code)) * 255.0).round() as u8, code);
        }
    }

    #[test]
    fn a_smaller_depth_map_covers_the_same_view() {
        assert_eq!((0..6).map(|x| nearest_sample(x, 6, 3)).collect::<Vec<_>>(), [0, 0, 1, 1, 2, 2]);
        assert_eq!((0..5).map(|x| nearest_sample(x, 5, 5)).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    }
}
