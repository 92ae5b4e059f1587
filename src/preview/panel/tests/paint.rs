//! Shapes to pixels, to look at: slow and simple.

use std::collections::HashMap;

use egui::epaint::{ImageDelta, Primitive, Vertex};
use egui::{ClippedPrimitive, Color32, FullOutput, ImageData, Mesh, TextureId};

use crate::frame::ColorImage;

#[derive(Default)]
pub struct Painter {
    textures: HashMap<TextureId, egui::ColorImage>,
}

impl Painter {
    /// Takes over the textures of a pass.
    pub fn learn(&mut self, mut output: FullOutput) -> FullOutput {
        for (id, deltas) in std::mem::take(&mut output.textures_delta.set) {
            deltas.into_iter().for_each(|delta| self.set(id, delta));
        }
        output
    }

    fn set(&mut self, id: TextureId, delta: ImageDelta) {
        let ImageData::Color(image) = delta.image;
        match delta.pos {
            None => drop(self.textures.insert(id, (*image).clone())),
            Some([left, top]) => {
                let whole = self.textures.get_mut(&id).unwrap();
                for y in 0..image.height() {
                    for x in 0..image.width() {
                        whole[(left + x, top + y)] = image[(x, y)];
                    }
                }
            }
        }
    }

    /// Paints the primitives of a pass on a picture as large as the window.
    pub fn paint(&self, primitives: &[ClippedPrimitive], scale: f32, onto: &mut ColorImage) {
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let texture = &self.textures[&mesh.texture_id];
            let clip = [clip_rect.min * scale, clip_rect.max * scale];
            for triangle in mesh.indices.chunks_exact(3) {
                self.triangle(mesh, triangle, texture, clip, scale, onto);
            }
        }
    }

    fn triangle(
        &self,
        mesh: &Mesh,
        triangle: &[u32],
        texture: &egui::ColorImage,
        clip: [egui::Pos2; 2],
        scale: f32,
        onto: &mut ColorImage,
    ) {
        let corners: [Vertex; 3] = [0, 1, 2].map(|k| mesh.vertices[triangle[k] as usize]);
        let at = corners.map(|corner| corner.pos * scale);
        let area = (at[1] - at[0]).x * (at[2] - at[0]).y - (at[1] - at[0]).y * (at[2] - at[0]).x;
        if area == 0.0 {
            return;
        }
        let low = |axis: fn(egui::Pos2) -> f32, clip: f32| {
            at.map(axis).into_iter().fold(f32::MAX, f32::min).max(clip).max(0.0)
        };
        let high = |axis: fn(egui::Pos2) -> f32, clip: f32, most: u32| {
            at.map(axis).into_iter().fold(f32::MIN, f32::max).min(clip).min(most as f32)
        };
        let (left, top) = (low(|p| p.x, clip[0].x.round()), low(|p| p.y, clip[0].y.round()));
        let (right, bottom) =
            (high(|p| p.x, clip[1].x.round(), onto.width), high(|p| p.y, clip[1].y.round(), onto.height));
        for y in top.floor() as u32..bottom.max(0.0).ceil() as u32 {
            for x in left.floor() as u32..right.max(0.0).ceil() as u32 {
                // Off the middle by a little, so that no sample lies on an edge of two triangles.
                let (px, py) = (x as f32 + 0.50013, y as f32 + 0.50007);
                if px < left || px > right || py < top || py > bottom {
                    continue;
                }
                let edge = |a: usize, b: usize| {
                    ((at[b] - at[a]).x * (py - at[a].y) - (at[b] - at[a]).y * (px - at[a].x)) / area
                };
                let weights = [edge(1, 2), edge(2, 0), edge(0, 1)];
                if weights.iter().any(|&weight| weight < 0.0) {
                    continue;
                }
                let mix = |value: &dyn Fn(&Vertex) -> f32| (0..3).map(|k| value(&corners[k]) * weights[k]).sum::<f32>();
                let (u, v) = (mix(&|c| c.uv.x), mix(&|c| c.uv.y));
                let texel = sample(texture, u, v);
                let color: [f32; 4] =
                    std::array::from_fn(|k| mix(&|c| f32::from(c.color.to_array()[k])) * texel[k] / 255.0);
                let pixel = &mut onto.rgb[(y as usize * onto.width as usize + x as usize) * 3..][..3];
                for k in 0..3 {
                    pixel[k] =
                        (color[k] + f32::from(pixel[k]) * (1.0 - color[3] / 255.0)).round().clamp(0.0, 255.0) as u8;
                }
            }
        }
    }
}

fn sample(texture: &egui::ColorImage, u: f32, v: f32) -> [f32; 4] {
    let [width, height] = texture.size;
    let place = |t: f32, size: usize| {
        let t = (t * size as f32 - 0.5).clamp(0.0, size as f32 - 1.0);
        (t as usize, (t as usize + 1).min(size - 1), t.fract())
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (place(u, width), place(v, height));
    let at = |x: usize, y: usize| texture[(x, y)].to_array().map(f32::from);
    let mix = |a: [f32; 4], b: [f32; 4], t: f32| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t);
    mix(mix(at(x0, y0), at(x1, y0), fx), mix(at(x0, y1), at(x1, y1), fx), fy)
}

/// A colour over a grey picture, as it comes out.
pub fn over(color: Color32, grey: u8) -> [f32; 3] {
    let [r, g, b, a] = color.to_array().map(f32::from);
    [r, g, b].map(|channel| channel + f32::from(grey) * (1.0 - a / 255.0))
}
