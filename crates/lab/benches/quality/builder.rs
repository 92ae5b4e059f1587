//! Builds a scene surface by surface.

use bokehcam::bokeh::aperture::Aperture;
use glam::Vec2;

use super::lens::{Rgba, Scene, Surface};
use super::picture::Rgb;
use super::scenes::SIZE;
use super::texture::{
    Pattern, coverage_from_distance, ellipse_distance, pattern_color, premultiply, rect_distance, render_texture,
};

pub const GREY: Rgb = [0.8, 0.8, 0.8];
pub const BRICK: Rgb = [1.0, 0.62, 0.45];
pub const SKY: Rgb = [0.5, 0.7, 1.0];
pub const LEAF: Rgb = [0.5, 0.9, 0.4];
pub const SKIN: Rgb = [1.0, 0.75, 0.6];

/// A scene being built.
pub struct SceneBuilder {
    /// What was added so far.
    pub scene: Scene,
}

impl SceneBuilder {
    /// Begins an empty scene.
    pub fn new(coc_at_infinity_px: f32) -> Self {
        let (width, height) = SIZE;
        let scene = Scene { width, height, coc_at_infinity_px, aperture: Aperture::default(), surfaces: Vec::new() };
        Self { scene }
    }

    /// Adds a plane with its CoC at the picture's centre and the change of the CoC per pixel.
    pub fn add_plane(mut self, coc_px: f32, slope: Vec2, of: impl Fn(Vec2) -> Rgba + Sync) -> Self {
        self.scene.surfaces.push(Surface { coc_px, slope, texture: render_texture(SIZE, 0, of), margin_px: 0 });
        self
    }

    /// Adds a plane that faces the camera, cut to an outline (signed distance, negative inside).
    pub fn add_cutout(
        self,
        coc_px: f32,
        outline: impl Fn(Vec2) -> f32 + Sync,
        color: impl Fn(Vec2) -> Rgb + Sync,
    ) -> Self {
        self.add_plane(coc_px, Vec2::ZERO, |p| {
            let alpha = coverage_from_distance(outline(p));
            if alpha > 0.0 { premultiply(color(p), alpha) } else { [0.0; 4] }
        })
    }

    /// Adds a wall that fills the picture.
    pub fn add_wall(self, coc_px: f32, pattern: Pattern, seed: u32) -> Self {
        let tint = [SKY, BRICK, GREY, LEAF][seed as usize % 4];
        self.add_cutout(coc_px, |_| -1.0, |p| pattern_color(p, tint, pattern, seed))
    }

    /// Adds a head and shoulders in focus.
    pub fn add_bust(self, x: f32, seed: u32) -> Self {
        self.add_moved_bust(x, 0.0, seed)
    }

    /// Adds the same, moved to the right.
    pub fn add_moved_bust(self, x: f32, by: f32, seed: u32) -> Self {
        let own = move |p: Vec2| p - Vec2::new(by, 0.0);
        self.add_cutout(
            0.0,
            |p| bust_distance(own(p), x),
            |p| if p.y < 255.0 { face_color(own(p), seed) } else { coat_color(own(p), seed) },
        )
    }
}

/// Returns the signed distance to a head and shoulders at column `x`.
pub fn bust_distance(p: Vec2, x: f32) -> f32 {
    let head = ellipse_distance(p, Vec2::new(x, 150.0), Vec2::new(62.0, 84.0));
    let neck = rect_distance(p, Vec2::new(x - 28.0, 200.0), Vec2::new(x + 28.0, 290.0));
    head.min(neck).min(ellipse_distance(p, Vec2::new(x, 395.0), Vec2::new(165.0, 140.0)))
}

/// Returns the colour of skin.
pub fn face_color(p: Vec2, seed: u32) -> Rgb {
    pattern_color(p, SKIN, Pattern::Noise, seed)
}

/// Returns the colour of a coat.
pub fn coat_color(p: Vec2, seed: u32) -> Rgb {
    pattern_color(p, [0.5, 0.5, 0.8], Pattern::Stripes(9.0), seed)
}
