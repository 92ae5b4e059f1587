//! Depth that several frames share.

use bokehcam::color::srgb_to_linear_table;
use bokehcam::depth::motion::{Motion, MotionEstimator};
use bokehcam::frame::{ColorImage, DepthMap, MixedPixel};
use bokehcam::optics::CocField;

/// A depth map that is reused for later frames, warped by the motion between the pictures. A map with a subject keeps
/// its matte: the background stays, and the colours of the nearer surface follow each frame.
pub(super) struct ReusedDepth {
    /// Its mixed pixels have the light of the farther surface in place of the difference.
    map: DepthMap,
    light: Box<[f32; 256]>,
    motion: MotionEstimator,
    /// Whether anything moved to the last picture that was compared.
    has_moved: bool,
}

/// Smallest alpha by which a colour difference is divided: below, noise would dominate.
const MIN_ALPHA: f32 = 0.05;
/// Surfaces whose CoC differs by this much, in pixels, move separately.
const SEPARATE_MOTION_COC_PX: f32 = 1.0;

impl ReusedDepth {
    pub fn new() -> Self {
        Self {
            map: DepthMap::default(),
            light: srgb_to_linear_table(),
            motion: MotionEstimator::default(),
            has_moved: false,
        }
    }

    /// Returns whether no map was kept yet.
    pub fn is_empty(&self) -> bool {
        self.map.metres.is_empty()
    }

    /// Keeps the map of the picture `color`, which has the CoC `field`.
    pub fn store(&mut self, map: &DepthMap, color: &ColorImage, field: &CocField) {
        copy_map(map, &mut self.map);
        let depth_step = if let CocField::Depth(lens) = field {
            lens.inverse_depth_step(SEPARATE_MOTION_COC_PX)
        } else {
            f32::INFINITY
        };
        self.motion.set_reference(map, color, depth_step);
        let matte = &mut self.map.matte.pixels;
        matte.clear();
        if map.subject_m.is_some() && map.size() == color.size() {
            matte.extend(map.matte.pixels.iter().map(|pixel| {
                // Compositing solved for the background: own = far + alpha * difference.
                let own = linear_rgb(&self.light, color, pixel);
                let far = |p: usize| own[p] - pixel.alpha * pixel.difference[p];
                MixedPixel { difference: std::array::from_fn(far), ..*pixel }
            }));
        }
    }

    /// Compares the later picture `color` with that of the kept map. Returns whether the map, once moved, fits: where
    /// a person has left, it would keep sharp what the person hid.
    pub fn fits(&mut self, color: &ColorImage) -> bool {
        let motion = self.motion.estimate(&self.map, color);
        self.has_moved = motion != Motion::Rest;
        motion != Motion::Unexplained
    }

    /// Writes the kept map, warped to the picture `color` that was compared last, into `map`.
    pub fn warp_to(&mut self, map: &mut DepthMap, color: &ColorImage) {
        copy_map(&self.map, map);
        let Self { map: held, light, motion, has_moved } = self;
        let moved = *has_moved;
        if moved {
            motion.warp(held, map);
        }
        map.matte.pixels.clear();
        if map.size() != color.size() {
            return;
        }
        let (width, height) = (color.width as i32, color.height as i32);
        map.matte.pixels.extend(held.matte.pixels.iter().filter_map(|pixel| {
            let [right, down] = if moved { motion.vector_at(pixel.at as usize, pixel.near_m) } else { [0; 2] };
            let (x, y) = (pixel.at as i32 % width + right, pixel.at as i32 / width + down);
            let pixel = MixedPixel { at: (y * width + x) as u32, ..*pixel };
            ((0..width).contains(&x) && (0..height).contains(&y)).then(|| solve_color_difference(light, color, &pixel))
        }));
        if moved {
            // If two pixels moved to one place, the one with the larger alpha stays.
            let pixels = &mut map.matte.pixels;
            pixels.sort_unstable_by(|a, b| a.at.cmp(&b.at).then(b.alpha.total_cmp(&a.alpha)));
            pixels.dedup_by_key(|pixel| pixel.at);
        }
    }
}

/// Returns a held pixel with the colour difference for a picture: own = far + alpha * difference, solved for it.
fn solve_color_difference(light: &[f32; 256], color: &ColorImage, pixel: &MixedPixel) -> MixedPixel {
    let own = linear_rgb(light, color, pixel);
    let (alpha, rest) = (pixel.alpha.max(MIN_ALPHA), (1.0 - pixel.alpha).max(1e-3));
    let difference = |p: usize| {
        let difference = (own[p] - pixel.difference[p]) / alpha;
        // The light of both surfaces stays within black and white.
        difference.clamp(-own[p] / rest, (1.0 - own[p]) / rest)
    };
    MixedPixel { difference: std::array::from_fn(difference), ..*pixel }
}

/// Returns the linear light of a pixel of a picture.
fn linear_rgb(light: &[f32; 256], color: &ColorImage, pixel: &MixedPixel) -> [f32; 3] {
    [0, 1, 2].map(|p| light[usize::from(color.rgb[3 * pixel.at as usize + p])])
}

fn copy_map(from: &DepthMap, to: &mut DepthMap) {
    to.resize(from.width, from.height);
    to.metres.copy_from_slice(&from.metres);
    (to.subject_m, to.is_smooth) = (from.subject_m, from.is_smooth);
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::optics::DepthCoc;

    const FIELD: CocField =
        CocField::Depth(DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 });

    /// Renders a person of noise, shifted `right` pixels, in front of a wall of noise.
    fn person(right: i32) -> (ColorImage, DepthMap) {
        let (width, height) = (640, 360);
        let (mut color, mut map) = (ColorImage::new(width, height), DepthMap::new(width, height));
        map.subject_m = Some(1.0);
        for at in 0..width * height {
            let (x, y) = ((at % width) as i32 - right, (at / width) as i32);
            let near = (240..400).contains(&x) && (80..280).contains(&y);
            let hash = ((if near { x } else { x + right } / 2) as u32).wrapping_mul(7919)
                ^ (y as u32 / 2).wrapping_mul(104_729);
            let luma = 60 + (hash.wrapping_mul(0x9e37_79b9) >> 25) as u8;
            color.rgb[3 * at as usize..][..3].copy_from_slice(&if near { [luma, 40, 40] } else { [40, luma, 200] });
            map.metres[at as usize] = if near { 1.0 } else { 9.0 };
            if near && x == 240 {
                let pixel =
                    MixedPixel { at, near_m: 1.0, far_m: 9.0, alpha: 0.5, background_alpha: 0.5, difference: [0.1; 3] };
                map.matte.pixels.push(pixel);
            }
        }
        (color, map)
    }

    #[test]
    fn a_map_and_its_matte_move_with_the_picture() {
        let (then, now) = (person(0), person(6));
        let mut held = ReusedDepth::new();
        held.store(&then.1, &then.0, &FIELD);
        let mut given = DepthMap::default();
        assert!(held.fits(&now.0));
        held.warp_to(&mut given, &now.0);
        assert!(given.metres == now.1.metres, "the map has moved");
        let places = |map: &DepthMap| map.matte.pixels.iter().map(|pixel| pixel.at).collect::<Vec<_>>();
        assert_eq!(places(&given), places(&now.1));
        assert!(held.fits(&then.0));
        held.warp_to(&mut given, &then.0);
        assert!(given.metres == then.1.metres && places(&given) == places(&then.1), "what rests is where it was");
    }

    #[test]
    fn what_rests_is_as_it_was_and_what_moved_has_its_own_colours() {
        let light = srgb_to_linear_table();
        let mut color = ColorImage::new(3, 1);
        color.rgb.copy_from_slice(&[200, 60, 60, 148, 60, 148, 30, 60, 200]);
        let pixel = |at: u32, alpha: f32, background_alpha: f32| {
            let own = [0, 1, 2].map(|p| light[usize::from(color.rgb[3 * at as usize + p])]);
            let far = [light[30], light[60], light[200]];
            let difference = std::array::from_fn(|p| (own[p] - far[p]) / alpha);
            MixedPixel { at, near_m: 1.0, far_m: 9.0, alpha, background_alpha, difference }
        };
        let mut map = DepthMap { subject_m: Some(1.0), ..DepthMap::new(3, 1) };
        map.matte.pixels = vec![pixel(0, 1.0, 1.0), pixel(1, 0.5, 1.0)];
        let mut held = ReusedDepth::new();
        held.store(&map, &color, &FIELD);
        let mut given = DepthMap::default();
        assert!(held.fits(&color));
        held.warp_to(&mut given, &color);
        for (a, b) in given.matte.pixels.iter().zip(&map.matte.pixels) {
            assert!(a.difference.iter().zip(&b.difference).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
        }
        // The person has left: the mixed pixel shows the background, so both its surfaces have that colour.
        color.rgb[3..6].copy_from_slice(&[30, 60, 200]);
        assert!(held.fits(&color));
        held.warp_to(&mut given, &color);
        assert!(given.matte.pixels[1].difference.iter().all(|difference| difference.abs() < 1e-5));
        // A measured map has no matte here: each frame estimates its own.
        held.store(&DepthMap { subject_m: None, ..map }, &color, &FIELD);
        assert!(held.fits(&color));
        held.warp_to(&mut given, &color);
        assert!(given.matte.pixels.is_empty() && given.subject_m.is_none());
    }

    /// The bundled recording, whose frames are 1/12 s apart: blurred with warped depth, frames are closer to those
    /// blurred with their own depth than with unwarped depth.
    #[test]
    fn what_moved_blurs_a_real_motion_more_like_its_own_depth() {
        use bokehcam::computing::ComputeOptions;
        use bokehcam::depth::focus::FocusRule;
        use bokehcam::engine::still::{Depth, blur_picture};
        use bokehcam::look::{Effect, Look, Strength};
        use bokehcam_media::recording::still::{read_color, read_depth};

        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/portrait");
        let frame = |k: usize| {
            let file = |of: &str| folder.join(format!("{of}/{k:06}.png"));
            (read_color(&file("rgb")).unwrap(), read_depth(&file("depth"), 5000.0, None).unwrap())
        };
        let lens = DepthCoc { coc_at_infinity_px: 14.0, focus_m: 1.2, range_m: 0.0, max_coc_px: 20.0 };
        let strength = Strength::AtInfinity(14.0);
        let look = Look { focus: FocusRule::Metres(1.2), strength, ..Look::with_effect(Effect::Dof) };
        let blurred = |color: &ColorImage, map: &DepthMap| {
            blur_picture(&look, color.clone(), Some(Depth::Final(map.clone())), &ComputeOptions::default()).unwrap().0
        };
        // Sums of squared differences: over all pixels, and near depth edges.
        let (mut off, mut counts) = ([[0.0; 2]; 2], [0.0; 2]);
        for k in [1, 7, 13, 19] {
            let (then, now) = (frame(k - 1), frame(k));
            let mut held = ReusedDepth::new();
            held.store(&then.1, &then.0, &CocField::Depth(lens));
            let mut moved = DepthMap::default();
            assert!(held.fits(&now.0));
            held.warp_to(&mut moved, &now.0);
            let own = blurred(&now.0, &now.1);
            let others = [&then.1, &moved].map(|map| blurred(&now.0, map));
            let width = own.width as usize;
            let coc = |at: usize| lens.coc_px(now.1.metres[at]);
            for at in 4 * width..own.rgb.len() / 3 - 4 * width {
                let around = [at - 4, at + 4, at - 4 * width, at + 4 * width];
                let at_outline = around.iter().any(|&other| (coc(at) - coc(other)).abs() > 1.0);
                for part in 0..1 + usize::from(at_outline) {
                    counts[part] += 3.0;
                    for (other, off) in others.iter().zip(&mut off) {
                        let apart = |p: usize| f64::from(own.rgb[3 * at + p].abs_diff(other.rgb[3 * at + p])).powi(2);
                        off[part] += (0..3).map(apart).sum::<f64>();
                    }
                }
            }
        }
        let psnr = off.map(|off| [0, 1].map(|part: usize| 10.0 * (65025.0 * counts[part] / off[part]).log10()));
        println!("PSNR in dB, all and at outlines: {:.1?} held, {:.1?} moved", psnr[0], psnr[1]);
        assert!((0..2).all(|part| psnr[1][part] > psnr[0][part] + 1.2), "{psnr:?}");
    }
}
