//! Textures of the controls: glyphs and images.

use std::collections::HashMap;

use egui::epaint::ImageDelta;
use egui::{Color32, ImageData, TextureId, TexturesDelta};

/// Subtexel steps per texel: 8 bits of interpolation weight.
const SUBTEXELS: f32 = 256.0;

/// A texture set by egui. Filtering is bilinear with clamp to edge; the controls use no other mode.
#[derive(Debug)]
pub struct Texture {
    size: [usize; 2],
    /// Row-major, premultiplied `0xAARRGGBB`.
    texels: Vec<u32>,
}

/// Textures by egui's ids.
#[derive(Debug, Default)]
pub struct Textures(pub HashMap<TextureId, Texture>);

impl Textures {
    /// Adds and updates textures.
    pub fn apply_delta(&mut self, delta: &TexturesDelta) {
        delta.set.iter().for_each(|(id, changes)| changes.iter().for_each(|change| self.apply_change(*id, change)));
    }

    /// Replaces a texture, or its region at `change.pos`. Empty or out-of-range changes are ignored.
    fn apply_change(&mut self, id: TextureId, change: &ImageDelta) {
        let ImageData::Color(image) = &change.image;
        let texels = image.pixels.iter().map(|&color| pack_argb(color));
        let [width, height] = image.size;
        if image.pixels.is_empty() {
            return;
        }
        let Some([left, top]) = change.pos else {
            self.0.insert(id, Texture { size: image.size, texels: texels.collect() });
            return;
        };
        let Some(texture) = self.0.get_mut(&id) else { return };
        let [texture_width, texture_height] = texture.size;
        if left + width > texture_width || top + height > texture_height {
            return;
        }
        let texels: Vec<u32> = texels.collect();
        for (row, changed) in texture.texels.chunks_exact_mut(texture_width).skip(top).zip(texels.chunks_exact(width)) {
            row[left..left + width].copy_from_slice(changed);
        }
    }
}

/// Packs a colour as `0xAARRGGBB`.
fn pack_argb(color: Color32) -> u32 {
    let [r, g, b, a] = color.to_array();
    u32::from_be_bytes([a, r, g, b])
}

impl Texture {
    /// Converts a position `uv` (0 to 1) to texels.
    pub fn to_texels(&self, uv: [f32; 2]) -> [f32; 2] {
        [uv[0] * self.size[0] as f32, uv[1] * self.size[1] as f32]
    }

    /// Samples bilinearly at a position in texels, whose centres lie at half-integers.
    #[inline]
    pub fn sample_bilinear(&self, [x, y]: [f32; 2]) -> u32 {
        let (x, y) = (((x - 0.5) * SUBTEXELS).round() as i64, ((y - 0.5) * SUBTEXELS).round() as i64);
        let (parts, weight_x, weight_y) = (SUBTEXELS as i64, x & 255, y & 255);
        let (x, y) = (x.div_euclid(parts), y.div_euclid(parts));
        if weight_x == 0 && weight_y == 0 {
            // At a texel's centre, as always in text.
            return self.texel(x, y);
        }
        let upper = lerp(self.texel(x, y), self.texel(x + 1, y), weight_x as u32);
        let lower = lerp(self.texel(x, y + 1), self.texel(x + 1, y + 1), weight_x as u32);
        lerp_rows(upper, lower, weight_y as u32)
    }

    /// Returns the texel at a column and row, clamped to the edge.
    #[inline]
    fn texel(&self, x: i64, y: i64) -> u32 {
        let [x, y] = [(x, self.size[0]), (y, self.size[1])].map(|(at, side)| at.clamp(0, side as i64 - 1) as usize);
        self.texels[y * self.size[0] + x]
    }
}

/// Interpolates from `a` to `b` by `weight` / 256. Each channel gains 8 fractional bits, so two fit a word: blue and red,
/// and green and alpha.
fn lerp(a: u32, b: u32, weight: u32) -> [u64; 2] {
    let pair = |color: u32| u64::from(color & 0xff) | u64::from(color >> 16 & 0xff) << 32;
    let (inverse, weight) = (u64::from(256 - weight), u64::from(weight));
    [pair(a) * inverse + pair(b) * weight, pair(a >> 8) * inverse + pair(b >> 8) * weight]
}

/// Interpolates between two results of [`lerp`] by `weight` / 256, rounded to `0xAARRGGBB`.
fn lerp_rows(upper: [u64; 2], lower: [u64; 2], weight: u32) -> u32 {
    let (inverse, weight) = (u64::from(256 - weight), u64::from(weight));
    let [low, high] = std::array::from_fn(|k| {
        let sum = upper[k] * inverse + lower[k] * weight + 0x0000_8000_0000_8000;
        (sum >> 16 & 0xff) as u32 | ((sum >> 48 & 0xff) as u32) << 16
    });
    low | high << 8
}

#[cfg(test)]
mod tests {
    use egui::{ColorImage, TextureOptions};

    use super::*;

    fn texture() -> Textures {
        let colors = [[0, 0, 0, 0], [255, 255, 255, 255], [200, 100, 50, 255], [10, 20, 30, 40]];
        let colors = colors.map(|[r, g, b, a]| Color32::from_rgba_premultiplied(r, g, b, a));
        let image = ColorImage::new([2, 2], colors.to_vec());
        let mut delta = TexturesDelta::default();
        delta.push(TextureId::default(), ImageDelta::full(image, TextureOptions::LINEAR));
        let mut textures = Textures::default();
        textures.apply_delta(&delta);
        delta.clear();
        textures
    }

    #[test]
    fn texels_are_met_at_their_centres_and_mixed_between() {
        let textures = texture();
        let texture = &textures.0[&TextureId::default()];
        assert_eq!(texture.sample_bilinear([0.5, 0.5]), 0);
        assert_eq!(texture.sample_bilinear([1.5, 1.5]), 0x280a_141e);
        assert_eq!(texture.sample_bilinear([1.0, 0.5]), 0x8080_8080, "half way");
        assert_eq!(texture.sample_bilinear([1.0, 1.0]), 0x8a74_5e54, "the mean of four");
        assert_eq!(texture.sample_bilinear([-9.0, 40.0]), 0xffc8_6432, "beyond the edge");
    }

    #[test]
    fn a_part_may_change_and_a_texture_go() {
        let mut textures = texture();
        let mut delta = TexturesDelta::default();
        let dot = ColorImage::new([1, 1], vec![Color32::RED]);
        delta.push(TextureId::default(), ImageDelta::partial([1, 0], dot.clone(), TextureOptions::LINEAR));
        delta.push(TextureId::default(), ImageDelta::partial([2, 0], dot, TextureOptions::LINEAR));
        textures.apply_delta(&delta);
        delta.clear();
        let texture = &textures.0[&TextureId::default()];
        assert_eq!(
            (texture.sample_bilinear([1.5, 0.5]), texture.sample_bilinear([0.5, 1.5])),
            (0xffff_0000, 0xffc8_6432)
        );
        textures.0.remove(&TextureId::default());
        assert!(textures.0.is_empty());
    }
}
