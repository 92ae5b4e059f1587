//! The subject alone, over nothing: colours and alpha.
//!
//! The picture is blurred over black, which gives premultiplied colours. A second picture, which is white where the
//! first one is kept and black where it is replaced, is blurred in the same way, which gives alpha: the blur is linear,
//! and mixes both alike. Straight colours are the first divided by the second (Porter and Duff, 1984).

use super::VirtualBackground;
use super::light::LightTables;
use crate::frame::{ColorImage, DepthMap};
use crate::optics::DepthCoc;

/// sRGB code of "white": half of the light, which highlight recovery hardly changes.
const KEPT_CODE: u8 = 188;

impl VirtualBackground {
    /// Draws the foreground mask of a frame of `size` with this `map`: grey where [`Self::replace_background`] keeps
    /// it, else black. Blurring `kept` by `kept_map` gives alpha.
    pub fn draw_kept(
        &mut self,
        (size, map): ((u32, u32), &DepthMap),
        lens: &DepthCoc,
        kept: &mut ColorImage,
        kept_map: &mut DepthMap,
    ) {
        kept.resize(size.0, size.1);
        kept.rgb.fill(KEPT_CODE);
        kept_map.copy_from(map);
        // Both surfaces of a mixed pixel are equally grey.
        kept_map.matte.pixels.iter_mut().for_each(|pixel| pixel.difference = [0.0; 3]);
        self.replace_background(kept, kept_map, lens);
    }
}

/// Makes straight colours and alpha of blurred pictures.
#[derive(Debug, Default)]
pub struct CutOut {
    light: LightTables,
    /// Alpha of each pixel, 0 to 255, row by row.
    pub alpha: Vec<u8>,
}

impl CutOut {
    /// Divides the colours of a picture that was blurred over black by its foreground mask
    /// ([`VirtualBackground::draw_kept`], blurred in the same way), and sets alpha. Transparent pixels become black.
    pub fn unpremultiply(&mut self, color: &mut ColorImage, kept: &ColorImage) {
        let Self { light, alpha } = self;
        let full = light.decode(KEPT_CODE);
        alpha.resize(color.rgb.len() / 3, 0);
        let pixels = color.rgb.as_chunks_mut::<3>().0.iter_mut().zip(kept.rgb.as_chunks::<3>().0);
        for ((pixel, kept), alpha) in pixels.zip(alpha) {
            let share = (light.decode(kept[1]) / full).min(1.0);
            *alpha = (share * 255.0).round() as u8;
            match *alpha {
                0 => *pixel = [0; 3],
                u8::MAX => {}
                _ => *pixel = pixel.map(|code| light.encode(light.decode(code) / share)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::encode_srgb;
    use crate::depth::backdrop::Background;
    use crate::frame::MixedPixel;

    #[test]
    fn a_subject_keeps_its_colour_and_share_and_nothing_of_the_wall() {
        let lens = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
        let light = LightTables::default();
        // A red subject before a green wall; the pixel between them is 60 % subject.
        let (near, far) = ([200, 30, 20], [20, 220, 60]);
        let [red, green] = [near, far].map(|rgb: [u8; 3]| rgb.map(|code| light.decode(code)));
        let mixed = std::array::from_fn(|p| encode_srgb(0.6 * red[p] + 0.4 * green[p]));
        let mut color = ColorImage { width: 3, height: 1, rgb: [near, mixed, far].concat() };
        let mut map = DepthMap { width: 3, height: 1, metres: vec![1.0, 1.0, 3.0], ..DepthMap::default() };
        let difference = std::array::from_fn(|p| red[p] - green[p]);
        map.matte.pixels =
            vec![MixedPixel { at: 1, near_m: 1.0, far_m: 3.0, alpha: 0.6, background_alpha: 0.4, difference }];

        let mut backdrop = VirtualBackground::new(&Background::Transparent).unwrap();
        let (mut kept, mut kept_map) = (ColorImage::default(), DepthMap::default());
        backdrop.draw_kept((color.size(), &map), &lens, &mut kept, &mut kept_map);
        backdrop.replace_background(&mut color, &mut map, &lens);
        assert_eq!(kept_map.metres, map.metres, "both are blurred alike");
        let mut cut_out = CutOut::default();
        cut_out.unpremultiply(&mut color, &kept);

        assert!(cut_out.alpha[0] == 255 && cut_out.alpha[2] == 0, "{:?}", cut_out.alpha);
        assert!(cut_out.alpha[1].abs_diff(153) <= 2, "60 % of 255 is 153: {:?}", cut_out.alpha);
        let pixels = color.rgb.as_chunks::<3>().0;
        assert_eq!((pixels[0], pixels[2]), (near, [0; 3]));
        for (code, due) in pixels[1].iter().zip(near) {
            assert!(code.abs_diff(due) <= 3, "{:?} is not the subject's {near:?}", pixels[1]);
        }
    }

    #[test]
    fn what_is_transparent_has_no_colour() {
        // Each code of the mask, over the colour of a blurred subject.
        let codes: Vec<u8> = (0..=255).collect();
        let grey = |code: &u8| [*code; 3];
        let kept = ColorImage { width: 256, height: 1, rgb: codes.iter().flat_map(grey).collect() };
        let mut color = ColorImage { width: 256, height: 1, rgb: [90, 30, 60].repeat(256) };
        let mut cut_out = CutOut::default();
        cut_out.unpremultiply(&mut color, &kept);
        let pixels = color.rgb.as_chunks::<3>().0.iter().zip(&cut_out.alpha);
        let transparent: Vec<_> = pixels.filter(|(_, alpha)| **alpha == 0).collect();
        assert!(transparent.len() > 1 && transparent.iter().all(|(rgb, _)| **rgb == [0; 3]), "{transparent:?}");
        assert!(cut_out.alpha.is_sorted() && cut_out.alpha[usize::from(KEPT_CODE)..].iter().all(|alpha| *alpha == 255));
    }
}
