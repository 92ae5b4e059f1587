//! Geometry of the picture on the screen.

use egui::{Context, Pos2, Rect, Vec2, pos2};

use super::Canvas;

/// The picture's rectangle on the screen, in points.
#[derive(Clone, Copy, Debug)]
pub struct Viewport {
    pub rect: Rect,
    /// The part of `rect` inside the window.
    pub visible: Rect,
    /// The picture's width and height, in pixels.
    pub size: Vec2,
    /// Whether it is displayed mirrored.
    pub mirror: bool,
}

/// Returns the scale at which the whole picture fits its area: window pixels per picture pixel.
pub fn fit_scale(ctx: &Context, (width, height): (u32, u32)) -> f32 {
    let window = super::dock::picture_area(ctx).size() * ctx.pixels_per_point();
    (window.x / width.max(1) as f32).min(window.y / height.max(1) as f32)
}

impl Viewport {
    /// Computes the geometry of a canvas; `None` without a picture.
    pub fn new(canvas: Canvas, pixels_per_point: f32, mirror: bool) -> Option<Self> {
        let area = canvas.area;
        if area.width == 0 || area.height == 0 || canvas.size.0 == 0 || canvas.size.1 == 0 {
            return None;
        }
        let rect = |(x, y): (f32, f32), (width, height): (u32, u32)| {
            let size = Vec2::new(width as f32, height as f32);
            Rect::from_min_size(pos2(x, y) / pixels_per_point, size / pixels_per_point)
        };
        let corner = (area.x as f32, area.y as f32);
        let visible = rect(corner, (area.width, area.height));
        let whole = canvas.visible_region.map_or(visible, |region| {
            let corner = (corner.0 - region.origin.0 as f32, corner.1 - region.origin.1 as f32);
            rect(corner, (canvas.size.0 * region.factor, canvas.size.1 * region.factor))
        });
        Some(Self { rect: whole, visible, size: Vec2::new(canvas.size.0 as f32, canvas.size.1 as f32), mirror })
    }

    /// Converts a point of the picture, as fractions of its width and height, to a screen position.
    pub fn to_screen(self, [x, y]: [f32; 2]) -> Pos2 {
        let x = if self.mirror { 1.0 - x } else { x };
        self.rect.min + Vec2::new(x, y) * self.rect.size()
    }

    /// Converts a screen position to fractions of the picture, clamped to 0 to 1.
    pub fn to_fractions(self, at: Pos2) -> [f32; 2] {
        let at = (at - self.rect.min) / self.rect.size();
        let x = if self.mirror { 1.0 - at.x } else { at.x };
        [x, at.y].map(|fraction| fraction.clamp(0.0, 1.0))
    }
}
