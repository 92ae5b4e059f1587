//! The textures of the controls: glyphs and pictures.

use std::collections::HashMap;

use egui::epaint::ImageDelta;
use egui::{Color32, ImageData, TextureId, TexturesDelta};

/// Positions are rounded to this fraction of a texel: 8 bits of weight.
const PARTS: f32 = 256.0;

/// A texture as egui set it. It is interpolated, and ends with its edge: no control of ours has another kind.
#[derive(Debug)]
pub struct Texture {
    size: [usize; 2],
    /// Row by row, premultiplied `0xAARRGGBB`.
    texels: Vec<u32>,
}

/// The textures by egui's ids.
#[derive(Debug, Default)]
pub struct Textures(pub HashMap<TextureId, Texture>);

impl Textures {
    /// Adds new textures and changes others.
    pub fn set(&mut self, delta: &TexturesDelta) {
        delta.set.iter().for_each(|(id, changes)| changes.iter().for_each(|change| self.apply(*id, change)));
    }

    /// Replaces a texture, or the part of it at `change.pos`. What has no texels, or does not fit, is ignored.
    fn apply(&mut self, id: TextureId, change: &ImageDelta) {
        let ImageData::Color(image) = &change.image;
        let texels = image.pixels.iter().map(|&color| packed(color));
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
        for (row, part) in texture.texels.chunks_exact_mut(texture_width).skip(top).zip(texels.chunks_exact(width)) {
            row[left..left + width].copy_from_slice(part);
        }
    }
}

/// A colour as `0xAARRGGBB`.
fn packed(color: Color32) -> u32 {
    let [r, g, b, a] = color.to_array();
    u32::from_be_bytes([a, r, g, b])
}

impl Texture {
    /// The position `uv` (0 to 1) in texels.
    pub fn to_texels(&self, uv: [f32; 2]) -> [f32; 2] {
        [uv[0] * self.size[0] as f32, uv[1] * self.size[1] as f32]
    }

    /// The colour at a position in texels, whose centres lie at halves: bilinear.
    #[inline]
    pub fn sample(&self, [x, y]: [f32; 2]) -> u32 {
        let (x, y) = (((x - 0.5) * PARTS).round() as i64, ((y - 0.5) * PARTS).round() as i64);
        let (parts, part_x, part_y) = (PARTS as i64, x & 255, y & 255);
        let (x, y) = (x.div_euclid(parts), y.div_euclid(parts));
        if part_x == 0 && part_y == 0 {
            // At a texel's centre, as always in text.
            return self.texel(x, y);
        }
        let upper = mix(self.texel(x, y), self.texel(x + 1, y), part_x as u32);
        let lower = mix(self.texel(x, y + 1), self.texel(x + 1, y + 1), part_x as u32);
        mix_rows(upper, lower, part_y as u32)
    }

    /// The texel of a column and row, that of the edge beyond it.
    #[inline]
    fn texel(&self, x: i64, y: i64) -> u32 {
        let [x, y] = [(x, self.size[0]), (y, self.size[1])].map(|(at, side)| at.clamp(0, side as i64 - 1) as usize);
        self.texels[y * self.size[0] + x]
    }
}

/// From `a` to `b` by `part` / 256. Each channel gains 8 fractional bits, so there are two to a word: blue and red, and
/// green and alpha.
fn mix(a: u32, b: u32, part: u32) -> [u64; 2] {
    let pair = |color: u32| u64::from(color & 0xff) | u64::from(color >> 16 & 0xff) << 32;
    let (rest, part) = (u64::from(256 - part), u64::from(part));
    [pair(a) * rest + pair(b) * part, pair(a >> 8) * rest + pair(b >> 8) * part]
}

/// From one result of [`mix`] to another by `part` / 256, rounded to `0xAARRGGBB`.
fn mix_rows(upper: [u64; 2], lower: [u64; 2], part: u32) -> u32 {
    let (rest, part) = (u64::from(256 - part), u64::from(part));
    let [low, high] = std::array::from_fn(|k| {
        let sum = upper[k] * rest + lower[k] * part + 0x0000_8000_0000_8000;
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
        textures.set(&delta);
        delta.clear();
        textures
    }

    #[test]
    fn texels_are_met_at_their_centres_and_mixed_between() {
        let textures = texture();
        let texture = &textures.0[&TextureId::default()];
        assert_eq!(texture.sample([0.5, 0.5]), 0);
        assert_eq!(texture.sample([1.5, 1.5]), 0x280a_141e);
        assert_eq!(texture.sample([1.0, 0.5]), 0x8080_8080, "half way");
        assert_eq!(texture.sample([1.0, 1.0]), 0x8a74_5e54, "the mean of four");
        assert_eq!(texture.sample([-9.0, 40.0]), 0xffc8_6432, "beyond the edge");
    }

    #[test]
    fn a_part_may_change_and_a_texture_go() {
        let mut textures = texture();
        let mut delta = TexturesDelta::default();
        let dot = ColorImage::new([1, 1], vec![Color32::RED]);
        delta.push(TextureId::default(), ImageDelta::partial([1, 0], dot.clone(), TextureOptions::LINEAR));
        delta.push(TextureId::default(), ImageDelta::partial([2, 0], dot, TextureOptions::LINEAR));
        textures.set(&delta);
        delta.clear();
        let texture = &textures.0[&TextureId::default()];
        assert_eq!((texture.sample([1.5, 0.5]), texture.sample([0.5, 1.5])), (0xffff_0000, 0xffc8_6432));
        textures.0.remove(&TextureId::default());
        assert!(textures.0.is_empty());
    }
}
