//! Depth that several frames share.

use crate::color::light_of_codes;
use crate::frame::{ColorImage, DepthMap, MixedPixel};

/// A map that later frames are given. Around a subject it has a matte of its own: what is behind stays as it was, and the
/// nearer surface's colours follow those of each frame.
pub(super) struct Held {
    /// Its mixed pixels have the light of the farther surface in place of the difference.
    map: DepthMap,
    light: Box<[f32; 256]>,
}

/// Of less than this share of a pixel, no colour is told from a frame.
const LEAST_SHARE: f32 = 0.05;

impl Held {
    pub fn new() -> Self {
        Self { map: DepthMap::default(), light: light_of_codes() }
    }

    /// Whether there was none yet.
    pub fn is_empty(&self) -> bool {
        self.map.metres.is_empty()
    }

    /// Keeps the map of a picture.
    pub fn keep(&mut self, map: &DepthMap, color: &ColorImage) {
        copy(map, &mut self.map);
        let matte = &mut self.map.matte.pixels;
        matte.clear();
        if map.subject_m.is_some() && map.size() == color.size() {
            matte.extend(map.matte.pixels.iter().map(|pixel| {
                let own = own(&self.light, color, pixel);
                let far = |p: usize| own[p] - pixel.share * pixel.difference[p];
                MixedPixel { difference: std::array::from_fn(far), ..*pixel }
            }));
        }
    }

    /// Gives a later picture the map.
    pub fn give(&self, map: &mut DepthMap, color: &ColorImage) {
        copy(&self.map, map);
        map.matte.pixels.clear();
        if map.size() != color.size() {
            return;
        }
        map.matte.pixels.extend(self.map.matte.pixels.iter().map(|pixel| {
            let own = own(&self.light, color, pixel);
            let (share, rest) = (pixel.share.max(LEAST_SHARE), (1.0 - pixel.share).max(1e-3));
            let difference = |p: usize| {
                let difference = (own[p] - pixel.difference[p]) / share;
                // No surface is darker than black, or brighter than white.
                difference.clamp(-own[p] / rest, (1.0 - own[p]) / rest)
            };
            MixedPixel { difference: std::array::from_fn(difference), ..*pixel }
        }));
    }
}

/// The light of a pixel in a picture.
fn own(light: &[f32; 256], color: &ColorImage, pixel: &MixedPixel) -> [f32; 3] {
    [0, 1, 2].map(|p| light[usize::from(color.rgb[3 * pixel.at as usize + p])])
}

fn copy(from: &DepthMap, to: &mut DepthMap) {
    to.resize(from.width, from.height);
    to.metres.copy_from_slice(&from.metres);
    (to.subject_m, to.is_smooth) = (from.subject_m, from.is_smooth);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rests_is_as_it_was_and_what_moved_has_its_own_colours() {
        let light = light_of_codes();
        let mut color = ColorImage::new(3, 1);
        color.rgb.copy_from_slice(&[200, 60, 60, 148, 60, 148, 30, 60, 200]);
        let pixel = |at: u32, share: f32, behind: f32| {
            let own = [0, 1, 2].map(|p| light[usize::from(color.rgb[3 * at as usize + p])]);
            let far = [light[30], light[60], light[200]];
            let difference = std::array::from_fn(|p| (own[p] - far[p]) / share);
            MixedPixel { at, near_m: 1.0, far_m: 9.0, share, behind, difference }
        };
        let mut map = DepthMap { subject_m: Some(1.0), ..DepthMap::new(3, 1) };
        map.matte.pixels = vec![pixel(0, 1.0, 1.0), pixel(1, 0.5, 1.0)];
        let mut held = Held::new();
        held.keep(&map, &color);
        let mut given = DepthMap::default();
        held.give(&mut given, &color);
        for (a, b) in given.matte.pixels.iter().zip(&map.matte.pixels) {
            assert!(a.difference.iter().zip(&b.difference).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
        }
        // The person has gone: what was mixed shows what is behind, and both its surfaces are that.
        color.rgb[3..6].copy_from_slice(&[30, 60, 200]);
        held.give(&mut given, &color);
        assert!(given.matte.pixels[1].difference.iter().all(|difference| difference.abs() < 1e-5));
        // A map that was measured has none: each frame finds its own.
        held.keep(&DepthMap { subject_m: None, ..map }, &color);
        held.give(&mut given, &color);
        assert!(given.matte.pixels.is_empty() && given.subject_m.is_none());
    }
}
