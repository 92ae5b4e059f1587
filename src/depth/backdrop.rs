//! Virtual background: a colour or a picture replaces the room behind the subject, with the same soft outlines.
//!
//! Before the blur, the light and the distance of every surface well behind the focal plane are replaced; the virtual
//! background is in focus. In a mixed pixel, only the farther surface's part is replaced. Surfaces in front of the
//! subject blur over the virtual background as they would over the room.

mod background;
mod cut_out;
mod light;

pub use background::{Background, BackgroundPicture, BackgroundVideo};
pub use cut_out::CutOut;
use light::LightTables;

use crate::frame::scale::RowScaler;
use crate::frame::{ColorImage, DepthMap, MixedPixel};
use crate::optics::DepthCoc;

/// Ratios of inverse depth to that of the far end of the range in focus: above the first, a surface is kept; below the
/// second, it is replaced; in between, it is faded. A person leaning back stays above the first; a wall half as far
/// again as the person is below the second.
const BACKGROUND_RAMP: [f32; 2] = [0.8, 0.667];
/// Surfaces in front of the focal plane with a smaller CoC, in pixels, do not blur over the background.
const SHARP_PX: f32 = 0.5;

/// Replaces the background of frame after frame; owns the memory for it.
#[derive(Debug)]
pub struct VirtualBackground {
    background: Background,
    light: LightTables,
    /// The virtual background, scaled to the frame.
    scaled: ColorImage,
    scale: RowScaler,
    row: Vec<u16>,
    composited: Vec<CompositedPixel>,
}

/// The composited values of a mixed pixel.
#[derive(Debug)]
struct CompositedPixel {
    at: usize,
    rgb: [u8; 3],
    metres: f32,
}

/// Pixels processed together: mostly all or none of them are replaced.
const CHUNK: usize = 32;

impl VirtualBackground {
    /// Creates a virtual background; `None` for [`Background::Blur`].
    pub fn new(background: &Background) -> Option<Self> {
        if *background == Background::Blur {
            return None;
        }
        Some(Self {
            background: background.clone(),
            light: LightTables::default(),
            scaled: ColorImage::default(),
            scale: RowScaler::default(),
            row: Vec::new(),
            composited: Vec::new(),
        })
    }

    /// Returns what replaces the room.
    pub fn background(&self) -> &Background {
        &self.background
    }

    /// Replaces the background of a picture. The map has no holes, has its matte and is as large as the picture; a map
    /// of another size is left unchanged.
    pub fn replace_background(&mut self, color: &mut ColorImage, map: &mut DepthMap, lens: &DepthCoc) {
        if color.size() != map.size() {
            return;
        }
        self.scale_to_frame(color.size());
        // Mixed pixels first: they need the original colours.
        let mut pixels = std::mem::take(&mut map.matte.pixels);
        self.composited.clear();
        pixels.retain_mut(|pixel| self.composite_mixed(pixel, color, lens));
        map.matte.pixels = pixels;
        let parts =
            color.rgb.chunks_mut(3 * CHUNK).zip(self.scaled.rgb.chunks(3 * CHUNK)).zip(map.metres.chunks_mut(CHUNK));
        for ((rgb, background), metres) in parts {
            let mut fractions = [0.0; CHUNK];
            for (fraction, metres) in fractions.iter_mut().zip(&*metres) {
                *fraction = background_fraction(*metres, lens);
            }
            let fractions = &fractions[..metres.len()];
            if fractions.iter().all(|&fraction| fraction == 1.0) {
                rgb.copy_from_slice(background);
                metres.fill(lens.focus_m);
            } else if fractions.iter().any(|&fraction| fraction > 0.0) {
                self.blend(rgb, background, metres, fractions, lens);
            }
        }
        for &CompositedPixel { at, rgb, metres } in &self.composited {
            color.rgb[3 * at..3 * at + 3].copy_from_slice(&rgb);
            map.metres[at] = metres;
        }
    }

    /// Blends pixels with the virtual background by the weights `fractions`, 0 to 1.
    fn blend(&self, rgb: &mut [u8], background: &[u8], metres: &mut [f32], fractions: &[f32], lens: &DepthCoc) {
        let pixels = rgb.as_chunks_mut::<3>().0.iter_mut().zip(background.as_chunks::<3>().0);
        for (((pixel, background), metres), &fraction) in pixels.zip(metres).zip(fractions) {
            *metres = pull_to_focus(*metres, fraction, lens);
            for (code, &background) in pixel.iter_mut().zip(background) {
                let [own, linear] = [*code, background].map(|code| self.light.decode(code));
                *code = if fraction == 1.0 { background } else { self.light.encode(own + fraction * (linear - own)) };
            }
        }
    }

    /// Composites a mixed pixel with the virtual background. Returns whether it still shows two surfaces that blur
    /// differently.
    fn composite_mixed(&mut self, pixel: &mut MixedPixel, color: &ColorImage, lens: &DepthCoc) -> bool {
        let at = pixel.at as usize;
        let fractions = [pixel.near_m, pixel.far_m].map(|metres| background_fraction(metres, lens));
        if fractions[1] <= 0.0 {
            return true;
        }
        let mut rgb = [0; 3];
        for (p, code) in rgb.iter_mut().enumerate() {
            let [linear, background] = [color, &self.scaled].map(|image| self.light.decode(image.rgb[3 * at + p]));
            let surfaces =
                [linear + (1.0 - pixel.alpha) * pixel.difference[p], linear - pixel.alpha * pixel.difference[p]];
            let [near, far] = [0, 1].map(|k| surfaces[k] + fractions[k] * (background - surfaces[k]));
            pixel.difference[p] = near - far;
            *code = self.light.encode(far + pixel.alpha * (near - far));
        }
        pixel.background_alpha = 1.0;
        let surfaces = [(pixel.near_m, fractions[0]), (pixel.far_m, fractions[1])];
        let [near_m, far_m] = surfaces.map(|(metres, fraction)| pull_to_focus(metres, fraction, lens));
        let is_in_front = lens.coc_px(near_m) < -SHARP_PX && near_m < far_m;
        (pixel.near_m, pixel.far_m) = (near_m, far_m);
        let seen_m = if pixel.alpha > 0.5 { near_m } else { far_m };
        // A pixel with nothing in front of the background is fully composited now, and moves to the focal plane.
        let metres = if is_in_front { seen_m } else { lens.focus_m };
        self.composited.push(CompositedPixel { at, rgb, metres });
        is_in_front
    }

    /// Scales the virtual background to the frame size.
    fn scale_to_frame(&mut self, (width, height): (u32, u32)) {
        if self.scaled.size() == (width, height) {
            return;
        }
        self.scaled.resize(width, height);
        match &self.background {
            Background::Blur => {}
            Background::Color(rgb) => self.scaled.rgb.as_chunks_mut::<3>().0.fill(*rgb),
            Background::Picture(picture) => {
                scale_to_cover(&picture.image, &mut self.scaled, &mut self.scale, &mut self.row);
            }
            Background::Video(video) => {
                scale_to_cover(video.first(), &mut self.scaled, &mut self.scale, &mut self.row);
            }
            // Premultiplied: where nothing is, there is no light.
            Background::Transparent => self.scaled.rgb.fill(0),
        }
    }

    /// Shows another picture behind frames of `size` from now on: the middle of `picture`, which has the
    /// [size to cover](cover_size) them.
    pub fn show_covering(&mut self, picture: &ColorImage, size: (u32, u32)) {
        self.scale_to_frame(size);
        let [width, height, whole_width, whole_height] =
            [size.0, size.1, picture.width, picture.height].map(|side| side as usize);
        if whole_width < width || whole_height < height || self.scaled.rgb.is_empty() {
            return;
        }
        let (left, top) = ((whole_width - width) / 2, (whole_height - height) / 2);
        let rows = picture.rgb.chunks_exact(3 * whole_width).skip(top);
        for (into, row) in self.scaled.rgb.chunks_exact_mut(3 * width).zip(rows) {
            into.copy_from_slice(&row[3 * left..3 * (left + width)]);
        }
    }
}

/// Returns how far a distance counts as background: 0 in focus, 1 behind, with a linear ramp in inverse depth.
#[inline(always)]
fn background_fraction(metres: f32, lens: &DepthCoc) -> f32 {
    let [none, all] = BACKGROUND_RAMP;
    let nearness = lens.far_m() * DepthMap::inverse_depth(metres);
    let fraction = (none - nearness) / (none - all);
    let fraction = if fraction > 0.0 { fraction } else { 0.0 };
    if fraction < 1.0 { fraction } else { 1.0 }
}

/// Returns the distance after a `fraction` of it moved to the focal plane, linear in inverse depth.
fn pull_to_focus(metres: f32, fraction: f32, lens: &DepthCoc) -> f32 {
    if fraction == 0.0 || fraction == 1.0 {
        return if fraction == 0.0 { metres } else { lens.focus_m };
    }
    let inverse = DepthMap::inverse_depth(metres);
    (inverse + fraction * (lens.focus_m.recip() - inverse)).recip()
}

/// Returns the size of a picture of `from` once it is scaled, in its proportions, to just cover one of `into`.
pub fn cover_size(from: (u32, u32), into: (u32, u32)) -> (u32, u32) {
    let ratio = (f64::from(into.0) / f64::from(from.0)).max(f64::from(into.1) / f64::from(from.1));
    let scaled = |side: u32, least: u32| ((f64::from(side) * ratio).round() as u32).max(least);
    (scaled(from.0, into.0), scaled(from.1, into.1))
}

/// Scales a picture so that it covers `into`, and crops the rest equally on both sides.
fn scale_to_cover(from: &ColorImage, into: &mut ColorImage, scale: &mut RowScaler, row: &mut Vec<u16>) {
    let [from_width, from_height, width, height] =
        [from.width, from.height, into.width, into.height].map(|side| side as usize);
    let whole = cover_size(from.size(), into.size());
    let whole = (whole.0 as usize, whole.1 as usize);
    scale.set_sizes((from_width, from_height), whole);
    let (left, top) = ((whole.0 - width) / 2, (whole.1 - height) / 2);
    for (y, line) in into.rgb.chunks_exact_mut(3 * width).enumerate() {
        scale.scale_row(&from.rgb, top + y, left..left + width, row, line);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::color::{encode_srgb, srgb_to_linear_table};

    const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
    const GREEN: Background = Background::Color([0, 177, 64]);

    /// Returns six grey pixels (code 100) in a row at these distances.
    fn row(metres: [f32; 6]) -> (ColorImage, DepthMap) {
        let color = ColorImage { width: 6, height: 1, rgb: vec![100; 18] };
        (color, DepthMap { width: 6, height: 1, metres: metres.to_vec(), ..DepthMap::default() })
    }

    fn replace(background: &Background, color: &mut ColorImage, map: &mut DepthMap) {
        VirtualBackground::new(background).unwrap().replace_background(color, map, &LENS);
    }

    #[test]
    fn only_what_is_well_behind_the_focal_plane_is_replaced_and_is_in_focus_then() {
        assert!(VirtualBackground::new(&Background::Blur).is_none());
        let (mut color, mut map) = row([0.4, 1.0, 1.2, 2.0, 50.0, 0.0]);
        replace(&GREEN, &mut color, &mut map);
        let pixels = color.rgb.as_chunks::<3>().0;
        assert_eq!(pixels[..3], [[100; 3]; 3]);
        assert_eq!(pixels[3..], [[0, 177, 64]; 3], "and what nobody measured");
        assert_eq!(map.metres, [0.4, 1.0, 1.2, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_slope_fades_without_a_step() {
        let metres = std::array::from_fn(|k| 1.25 + 0.05 * k as f32);
        let (mut color, mut map) = row(metres);
        replace(&Background::Color([255, 0, 100]), &mut color, &mut map);
        let red: Vec<u8> = color.rgb.iter().step_by(3).copied().collect();
        assert!(red[0] == 100 && red[5] > 230 && red.is_sorted(), "{red:?}");
        assert!(color.rgb.iter().skip(2).step_by(3).all(|&blue| blue.abs_diff(100) <= 1), "equal light stays");
        assert!(map.metres.iter().all(|metres| (1.0..=1.25).contains(metres)));
    }

    #[test]
    fn a_mixed_pixel_keeps_its_share_of_the_subject() {
        let (mut color, mut map) = row([1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
        let linear = srgb_to_linear_table();
        // Subject of code 100 before a wall of code 200: the pixel between them is 60 % subject.
        let (near, far) = (linear[100], linear[200]);
        let own = encode_srgb(0.6 * near + 0.4 * far);
        color.rgb[6..9].fill(own);
        let pixel = |near_m, far_m| MixedPixel {
            at: 2,
            near_m,
            far_m,
            alpha: 0.6,
            background_alpha: 0.4,
            difference: [near - far; 3],
        };
        let before = (color.clone(), map.clone());
        map.matte.pixels = vec![pixel(1.0, 3.0)];
        replace(&GREEN, &mut color, &mut map);
        assert!(map.matte.pixels.is_empty() && map.metres[2] == 1.0, "both are in focus now");
        for (p, code) in [0, 177, 64].into_iter().enumerate() {
            let due = encode_srgb(0.6 * near + 0.4 * linear[code]);
            assert!(color.rgb[6 + p].abs_diff(due) <= 1, "{} not {due}", color.rgb[6 + p]);
        }
        // The near surface is in front of the focal plane here: it still blurs over the background.
        (color, map) = before.clone();
        map.matte.pixels = vec![pixel(0.5, 3.0)];
        replace(&GREEN, &mut color, &mut map);
        let [left] = map.matte.pixels[..] else { panic!("it shows two surfaces") };
        assert_eq!((left.near_m, left.far_m, left.alpha, left.background_alpha), (0.5, 1.0, 0.6, 1.0));
        for (p, code) in [0, 177, 64].into_iter().enumerate() {
            assert!((left.difference[p] - (near - linear[code])).abs() < 0.02);
        }
        // Neither surface is behind: nothing changes.
        (color, map) = before;
        map.matte.pixels = vec![pixel(0.5, 1.0)];
        replace(&GREEN, &mut color, &mut map);
        assert_eq!(map.matte.pixels, [pixel(0.5, 1.0)]);
        assert_eq!(color.rgb[6..9], [own; 3]);
    }

    #[test]
    fn a_picture_covers_the_frame_and_keeps_its_proportions() {
        // A wide picture in stripes of 10 px, behind a square frame of half its height.
        let mut wide = ColorImage::new(80, 40);
        for (k, pixel) in wide.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = [(k % 80 / 10 * 30) as u8, (k / 80) as u8, 9];
        }
        let mut color = ColorImage::new(20, 20);
        let mut map = DepthMap { metres: vec![9.0; 400], ..DepthMap::new(20, 20) };
        replace(&Background::Picture(Arc::new(BackgroundPicture { file: None, image: wide })), &mut color, &mut map);
        let at = |x: usize, y: usize| color.rgb.as_chunks::<3>().0[20 * y + x];
        // Columns 20 to 60 of the picture are left, two to a pixel.
        for x in [2, 7, 12, 17] {
            assert_eq!(at(x, 5)[0], ((20 + 2 * x) / 10 * 30) as u8, "{x}");
        }
        assert!(at(3, 2)[1] < 8 && at(3, 17)[1] > 30);
    }
}
