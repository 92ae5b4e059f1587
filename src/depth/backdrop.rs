//! What stands behind the subject in place of the room: one colour, or a picture, along the same soft outlines.
//!
//! Before the blur, the light of every surface that is well behind the focal plane is replaced, and so is its distance: the
//! backdrop is in focus. Of a pixel that shows two surfaces only the farther one's share is; what is in front of the subject
//! blurs over the backdrop as it would over the room.

use std::path::PathBuf;
use std::sync::Arc;

use crate::color::{encode_srgb, light_of_codes};
use crate::frame::scale::Scale;
use crate::frame::{ColorImage, DepthMap, MixedPixel};
use crate::optics::DepthCoc;

/// What has so much of the distance in focus, as a ratio of inverse depths, is none of what is behind; and from so little on
/// all is. A person leaning back is within the first, and a wall at half as far again as the person is beyond the second.
const BEHIND: [f32; 2] = [0.8, 0.667];
/// A surface nearer to the focal plane than this many pixels of CoC blurs over nothing.
const SHARP_PX: f32 = 0.5;

/// What is behind the subject.
#[derive(Clone, Debug, Default)]
pub enum Behind {
    /// The room, blurred.
    #[default]
    Blur,
    /// One colour: sRGB.
    Color([u8; 3]),
    /// A picture, as large as it has to be to cover the frame, cut alike on both sides.
    Picture(Arc<BehindPicture>),
}

/// A picture that stands behind the subject.
#[derive(Debug)]
pub struct BehindPicture {
    /// Where it comes from, if that is known.
    pub file: Option<PathBuf>,
    /// Its pixels.
    pub image: ColorImage,
}

impl PartialEq for Behind {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Blur, Self::Blur) => true,
            (Self::Color(a), Self::Color(b)) => a == b,
            // The same picture, and not one that looks alike: they are compared often.
            (Self::Picture(a), Self::Picture(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// Puts something behind the subject of frame after frame; owns the memory for it.
#[derive(Debug)]
pub struct Backdrop {
    behind: Behind,
    light: Box<[f32; 256]>,
    /// sRGB of so many steps of light, evenly in its square root.
    codes: Box<[u8; CODES]>,
    /// What is behind, as large as the frame.
    scaled: ColorImage,
    scale: Scale,
    row: Vec<u16>,
    mixed: Vec<Mixed>,
}

/// What becomes of a pixel of two surfaces.
#[derive(Debug)]
struct Mixed {
    at: usize,
    rgb: [u8; 3],
    metres: f32,
}

/// Steps of light: the darkest codes are four steps apart.
const CODES: usize = 4096;
/// Pixels that are looked at together: mostly all or none are behind.
const PART: usize = 32;

impl Backdrop {
    /// Of one kind; `None` where the room is to be seen.
    pub fn new(behind: &Behind) -> Option<Self> {
        if *behind == Behind::Blur {
            return None;
        }
        let light_of = |step: usize| (step as f32 / (CODES - 1) as f32).powi(2);
        Some(Self {
            behind: behind.clone(),
            light: light_of_codes(),
            codes: Box::new(std::array::from_fn(|step| encode_srgb(light_of(step)))),
            scaled: ColorImage::default(),
            scale: Scale::default(),
            row: Vec::new(),
            mixed: Vec::new(),
        })
    }

    /// What it puts there.
    pub fn behind(&self) -> &Behind {
        &self.behind
    }

    /// Puts it behind what is in focus of a picture whose depth has no holes, has its matte and is as large as the picture; a
    /// map of another size is left as it is.
    pub fn lay(&mut self, color: &mut ColorImage, map: &mut DepthMap, lens: &DepthCoc) {
        if color.size() != map.size() {
            return;
        }
        self.fit(color.size());
        // The matte first: it goes by the colours that the pixels had.
        let mut pixels = std::mem::take(&mut map.matte.pixels);
        self.mixed.clear();
        pixels.retain_mut(|pixel| self.part(pixel, color, lens));
        map.matte.pixels = pixels;
        let parts =
            color.rgb.chunks_mut(3 * PART).zip(self.scaled.rgb.chunks(3 * PART)).zip(map.metres.chunks_mut(PART));
        for ((rgb, behind), metres) in parts {
            let mut shares = [0.0; PART];
            for (share, metres) in shares.iter_mut().zip(&*metres) {
                *share = share_behind(*metres, lens);
            }
            let shares = &shares[..metres.len()];
            if shares.iter().all(|&share| share == 1.0) {
                rgb.copy_from_slice(behind);
                metres.fill(lens.focus_m);
            } else if shares.iter().any(|&share| share > 0.0) {
                self.fade(rgb, behind, metres, (shares, lens));
            }
        }
        for &Mixed { at, rgb, metres } in &self.mixed {
            color.rgb[3 * at..3 * at + 3].copy_from_slice(&rgb);
            map.metres[at] = metres;
        }
    }

    /// Puts shares of it behind some pixels.
    fn fade(&self, rgb: &mut [u8], behind: &[u8], metres: &mut [f32], (shares, lens): (&[f32], &DepthCoc)) {
        let pixels = rgb.as_chunks_mut::<3>().0.iter_mut().zip(behind.as_chunks::<3>().0);
        for (((pixel, behind), metres), &share) in pixels.zip(metres).zip(shares) {
            *metres = pulled(*metres, share, lens);
            for (code, &behind) in pixel.iter_mut().zip(behind) {
                let [own, light] = [*code, behind].map(|code| self.light[usize::from(code)]);
                *code = if share == 1.0 { behind } else { self.encode(own + share * (light - own)) };
            }
        }
    }

    /// Puts it behind a pixel of two surfaces; whether it shows two still that blur apart.
    fn part(&mut self, pixel: &mut MixedPixel, color: &ColorImage, lens: &DepthCoc) -> bool {
        let at = pixel.at as usize;
        let shares = [pixel.near_m, pixel.far_m].map(|metres| share_behind(metres, lens));
        if shares[1] <= 0.0 {
            return true;
        }
        let mut rgb = [0; 3];
        for (p, code) in rgb.iter_mut().enumerate() {
            let (light, behind) =
                (self.light[usize::from(color.rgb[3 * at + p])], self.light[usize::from(self.scaled.rgb[3 * at + p])]);
            let surfaces =
                [light + (1.0 - pixel.share) * pixel.difference[p], light - pixel.share * pixel.difference[p]];
            let [near, far] = [0, 1].map(|k| surfaces[k] + shares[k] * (behind - surfaces[k]));
            pixel.difference[p] = near - far;
            *code = self.encode(far + pixel.share * (near - far));
        }
        pixel.behind = 1.0;
        let [near_m, far_m] = [(pixel.near_m, shares[0]), (pixel.far_m, shares[1])].map(|(m, s)| pulled(m, s, lens));
        let is_in_front = lens.coc_px(near_m) < -SHARP_PX && near_m < far_m;
        (pixel.near_m, pixel.far_m) = (near_m, far_m);
        let seen_m = if pixel.share > 0.5 { near_m } else { far_m };
        // What is not in front of the backdrop has been composited with it now, and both stay where they are.
        let metres = if is_in_front { seen_m } else { lens.focus_m };
        self.mixed.push(Mixed { at, rgb, metres });
        is_in_front
    }

    /// Makes the backdrop as large as the frame.
    fn fit(&mut self, (width, height): (u32, u32)) {
        if self.scaled.size() == (width, height) {
            return;
        }
        self.scaled.resize(width, height);
        match &self.behind {
            Behind::Blur => {}
            Behind::Color(rgb) => self.scaled.rgb.as_chunks_mut::<3>().0.fill(*rgb),
            Behind::Picture(picture) => cover(&picture.image, &mut self.scaled, (&mut self.scale, &mut self.row)),
        }
    }

    fn encode(&self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        self.codes[(light.sqrt() * (CODES - 1) as f32 + 0.5) as usize]
    }
}

/// How far something at this distance is behind: 0 is not, 1 is, and a slope leads from one to the other.
#[inline(always)]
fn share_behind(metres: f32, lens: &DepthCoc) -> f32 {
    let [none, all] = BEHIND;
    let nearness = lens.far_m() * DepthMap::inverse_of(metres);
    let share = (none - nearness) / (none - all);
    let share = if share > 0.0 { share } else { 0.0 };
    if share < 1.0 { share } else { 1.0 }
}

/// The distance of something of which a share is at the focal plane now.
fn pulled(metres: f32, share: f32, lens: &DepthCoc) -> f32 {
    if share == 0.0 || share == 1.0 {
        return if share == 0.0 { metres } else { lens.focus_m };
    }
    let inverse = DepthMap::inverse_of(metres);
    (inverse + share * (lens.focus_m.recip() - inverse)).recip()
}

/// Scales a picture so that it covers `into`, and cuts what is left over, alike on both sides.
fn cover(from: &ColorImage, into: &mut ColorImage, (scale, row): (&mut Scale, &mut Vec<u16>)) {
    let [from_width, from_height, width, height] =
        [from.width, from.height, into.width, into.height].map(|side| side as usize);
    let ratio = (width as f64 / from_width as f64).max(height as f64 / from_height as f64);
    let whole = [from_width, from_height].map(|side| (side as f64 * ratio).round() as usize);
    let whole = (whole[0].max(width), whole[1].max(height));
    scale.adapt((from_width, from_height), whole);
    let (left, top) = ((whole.0 - width) / 2, (whole.1 - height) / 2);
    for (y, line) in into.rgb.chunks_exact_mut(3 * width).enumerate() {
        scale.row(&from.rgb, top + y, left..left + width, row, line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
    const GREEN: Behind = Behind::Color([0, 177, 64]);

    /// Six pixels in a row at these distances, grey 100.
    fn row(metres: [f32; 6]) -> (ColorImage, DepthMap) {
        let color = ColorImage { width: 6, height: 1, rgb: vec![100; 18] };
        (color, DepthMap { width: 6, height: 1, metres: metres.to_vec(), ..DepthMap::default() })
    }

    fn lay(behind: &Behind, color: &mut ColorImage, map: &mut DepthMap) {
        Backdrop::new(behind).unwrap().lay(color, map, &LENS);
    }

    #[test]
    fn only_what_is_well_behind_the_focal_plane_is_replaced_and_is_in_focus_then() {
        assert!(Backdrop::new(&Behind::Blur).is_none());
        let (mut color, mut map) = row([0.4, 1.0, 1.2, 2.0, 50.0, 0.0]);
        lay(&GREEN, &mut color, &mut map);
        let pixels = color.rgb.as_chunks::<3>().0;
        assert_eq!(pixels[..3], [[100; 3]; 3]);
        assert_eq!(pixels[3..], [[0, 177, 64]; 3], "and what nobody measured");
        assert_eq!(map.metres, [0.4, 1.0, 1.2, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_slope_fades_without_a_step() {
        let metres = std::array::from_fn(|k| 1.25 + 0.05 * k as f32);
        let (mut color, mut map) = row(metres);
        lay(&Behind::Color([255, 0, 100]), &mut color, &mut map);
        let red: Vec<u8> = color.rgb.iter().step_by(3).copied().collect();
        assert!(red[0] == 100 && red[5] > 230 && red.is_sorted(), "{red:?}");
        assert!(color.rgb.iter().skip(2).step_by(3).all(|&blue| blue.abs_diff(100) <= 1), "equal light stays");
        assert!(map.metres.iter().all(|metres| (1.0..=1.25).contains(metres)));
    }

    #[test]
    fn a_mixed_pixel_keeps_its_share_of_the_subject() {
        let (mut color, mut map) = row([1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
        let light = light_of_codes();
        // Subject 100 before a wall of 200: the pixel between both has 60 % of the subject.
        let (near, far) = (light[100], light[200]);
        let own = encode_srgb(0.6 * near + 0.4 * far);
        color.rgb[6..9].fill(own);
        let pixel =
            |near_m, far_m| MixedPixel { at: 2, near_m, far_m, share: 0.6, behind: 0.4, difference: [near - far; 3] };
        let before = (color.clone(), map.clone());
        map.matte.pixels = vec![pixel(1.0, 3.0)];
        lay(&GREEN, &mut color, &mut map);
        assert!(map.matte.pixels.is_empty() && map.metres[2] == 1.0, "both are in focus now");
        for (p, code) in [0, 177, 64].into_iter().enumerate() {
            let due = encode_srgb(0.6 * near + 0.4 * light[code]);
            assert!(color.rgb[6 + p].abs_diff(due) <= 1, "{} not {due}", color.rgb[6 + p]);
        }
        // The same of something in front: it goes on blurring over the backdrop.
        (color, map) = before.clone();
        map.matte.pixels = vec![pixel(0.5, 3.0)];
        lay(&GREEN, &mut color, &mut map);
        let [left] = map.matte.pixels[..] else { panic!("it shows two surfaces") };
        assert_eq!((left.near_m, left.far_m, left.share, left.behind), (0.5, 1.0, 0.6, 1.0));
        for (p, code) in [0, 177, 64].into_iter().enumerate() {
            assert!((left.difference[p] - (near - light[code])).abs() < 0.02);
        }
        // Nothing changes where neither is behind.
        (color, map) = before;
        map.matte.pixels = vec![pixel(0.5, 1.0)];
        lay(&GREEN, &mut color, &mut map);
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
        lay(&Behind::Picture(Arc::new(BehindPicture { file: None, image: wide })), &mut color, &mut map);
        let at = |x: usize, y: usize| color.rgb.as_chunks::<3>().0[20 * y + x];
        // Columns 20 to 60 of the picture are left, two to a pixel.
        for x in [2, 7, 12, 17] {
            assert_eq!(at(x, 5)[0], ((20 + 2 * x) / 10 * 30) as u8, "{x}");
        }
        assert!(at(3, 2)[1] < 8 && at(3, 17)[1] > 30);
    }
}
