//! Marks drawn on the picture: focus point, split line, tilt-shift band.
//!
//! They are light with a dark border, to stand out on any picture.

use egui::{Align2, Color32, CornerRadius, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2, pos2, vec2};

use super::state::tweak::rotate_band;
use super::theme::{OVERLAY_COLOR, OVERLAY_OUTLINE, medium_font};
use super::viewport::Viewport;
use crate::texts::tr;
use bokehcam::frame::crop::Crop;
use bokehcam::look::Tilt;

/// Distance within which a mark can be grabbed, in points.
const GRAB_RADIUS: f32 = 16.0;

/// A draggable mark of tilt-shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TiltHandle {
    /// The centre, which moves the band.
    Middle,
    /// An edge, which sets the width.
    Edge,
    /// The handle beside the centre, which rotates the band.
    Turn,
}

impl TiltHandle {
    /// Returns the undo stroke of this mark: changes with the same stroke share one undo step.
    pub fn stroke(self) -> &'static str {
        match self {
            Self::Middle => "tilt middle",
            Self::Edge => "tilt edge",
            Self::Turn => "tilt turn",
        }
    }
}

fn draw_line(painter: &Painter, ends: [Pos2; 2], width: f32) {
    painter.line_segment(ends, Stroke::new(width + 2.0, OVERLAY_OUTLINE));
    painter.line_segment(ends, Stroke::new(width, OVERLAY_COLOR));
}

fn draw_dot(painter: &Painter, at: Pos2, radius: f32) {
    painter.circle_filled(at, radius + 1.5, OVERLAY_OUTLINE);
    painter.circle_filled(at, radius, OVERLAY_COLOR);
}

/// Draws the click ring, which shrinks and fades as `age` goes from 0 to 1.
pub fn draw_ring(painter: &Painter, at: Pos2, age: f32) {
    let settle = (age / 0.3).min(1.0);
    let radius = 40.0 - 18.0 * (1.0 - (1.0 - settle) * (1.0 - settle));
    let opacity = ((1.0 - age) / 0.5).min(1.0);
    painter.circle_stroke(at, radius, Stroke::new(4.0, OVERLAY_OUTLINE.gamma_multiply(opacity)));
    painter.circle_stroke(at, radius, Stroke::new(2.0, OVERLAY_COLOR.gamma_multiply(opacity)));
}

/// Draws the focus point: the four corners of a square.
pub fn draw_focus_point(painter: &Painter, at: Pos2) {
    for (width, color) in [(3.5, OVERLAY_OUTLINE), (1.5, OVERLAY_COLOR)] {
        for corner in [vec2(-1.0, -1.0), vec2(1.0, -1.0), vec2(1.0, 1.0), vec2(-1.0, 1.0)] {
            let tip = at + corner * 13.0;
            let points = vec![tip - vec2(corner.x * 6.0, 0.0), tip, tip - vec2(0.0, corner.y * 6.0)];
            painter.add(Shape::line(points, Stroke::new(width, color)));
        }
    }
}

/// Draws the crop that the outputs get as a dashed rectangle.
pub fn draw_crop(painter: &Painter, viewport: &Viewport, part: &Crop) {
    let size = viewport.rect.size() / part.zoom;
    let rect = Rect::from_center_size(viewport.to_screen(part.center), size).shrink(1.0);
    let corners = [rect.left_top(), rect.right_top(), rect.right_bottom(), rect.left_bottom(), rect.left_top()];
    for (width, color) in [(3.5, OVERLAY_OUTLINE), (1.5, OVERLAY_COLOR)] {
        painter.extend(Shape::dashed_line(&corners, Stroke::new(width, color), 10.0, 7.0));
    }
}

/// Draws the line between before (left) and after.
pub fn draw_split(painter: &Painter, viewport: &Viewport, at: f32, held: bool, after: &str) {
    let x = viewport.rect.left() + at * viewport.rect.width();
    let rect = viewport.visible;
    draw_line(painter, [pos2(x, rect.top()), pos2(x, rect.bottom())], if held { 3.0 } else { 2.0 });
    let grip = pos2(x, rect.center().y);
    draw_dot(painter, grip, if held { 15.0 } else { 13.0 });
    for side in [-1.0, 1.0] {
        let tip = grip + vec2(side * 7.5, 0.0);
        let points = vec![tip + vec2(side * -3.5, -4.0), tip, tip + vec2(side * -3.5, 4.0)];
        painter.add(Shape::line(points, Stroke::new(1.8, Color32::from_gray(40))));
    }
    draw_label(painter, pos2(x - 12.0, rect.top() + 14.0), Align2::RIGHT_TOP, tr("Before"), None);
    draw_label(painter, pos2(x + 12.0, rect.top() + 14.0), Align2::LEFT_TOP, tr(after), None);
}

/// Draws text on a dark field, after a dot if `dot` has a colour. Returns its rectangle.
pub fn draw_label(painter: &Painter, at: Pos2, align: Align2, text: &str, dot: Option<Color32>) -> Rect {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::new(12.5, medium_font()), OVERLAY_COLOR);
    let left = if dot.is_some() { 23.0 } else { 8.0 };
    let rect = align.anchor_size(at, galley.size() + vec2(left + 8.0, 8.0));
    painter.rect_filled(rect, CornerRadius::same(9), Color32::from_black_alpha(190));
    if let Some(color) = dot {
        painter.circle_filled(rect.left_center() + vec2(13.0, 0.0), 4.5, color);
    }
    painter.galley(rect.min + vec2(left, 4.0), galley, OVERLAY_COLOR);
    rect
}

/// The tilt-shift band in window coordinates, in points.
struct TiltBand {
    middle: Pos2,
    /// Directions along and across the band, scaled to the picture's height.
    along: Vec2,
    across: Vec2,
}

impl TiltBand {
    fn new(tilt: &Tilt, viewport: &Viewport) -> Self {
        let (sin, cos) = tilt.angle_deg.to_radians().sin_cos();
        let side = if viewport.mirror { -1.0 } else { 1.0 };
        let height = viewport.rect.height();
        Self {
            middle: viewport.to_screen([0.5, tilt.center_y]),
            along: vec2(side * cos, sin) * height,
            across: vec2(side * -sin, cos) * height,
        }
    }

    /// Returns the midpoint of an edge: the upper (`side` is -1) or lower (1) one for a horizontal band.
    fn edge(&self, tilt: &Tilt, side: f32) -> Pos2 {
        self.middle + self.across * (side * tilt.band / 2.0)
    }

    /// Returns the handle that rotates the band, inside the picture.
    fn rotation_handle(&self, viewport: &Viewport) -> Pos2 {
        let shorter_side = viewport.rect.width().min(viewport.rect.height()) / viewport.rect.height();
        self.middle + self.along * (0.32 * shorter_side)
    }
}

/// Returns the tilt-shift mark that a press at `at` grabs: a mark nearby, else the band if `at` is inside it.
pub fn handle_at(tilt: &Tilt, viewport: &Viewport, at: Pos2) -> Option<TiltHandle> {
    let band = TiltBand::new(tilt, viewport);
    let near = |mark: Pos2| mark.distance(at) <= GRAB_RADIUS;
    if near(band.rotation_handle(viewport)) {
        Some(TiltHandle::Turn)
    } else if near(band.middle) {
        Some(TiltHandle::Middle)
    } else if [-1.0, 1.0].into_iter().any(|side| near(band.edge(tilt, side))) {
        Some(TiltHandle::Edge)
    } else {
        let across = (at - band.middle).dot(band.across) / band.across.length_sq();
        (across.abs() <= tilt.band / 2.0).then_some(TiltHandle::Middle)
    }
}

/// Drags a mark to `at`.
pub fn drag_handle(tilt: &mut Tilt, handle: TiltHandle, viewport: &Viewport, at: Pos2) {
    let band = TiltBand::new(tilt, viewport);
    let from_middle = at - band.middle;
    match handle {
        TiltHandle::Middle => tilt.center_y = ((at.y - viewport.rect.top()) / viewport.rect.height()).clamp(0.0, 1.0),
        TiltHandle::Edge => {
            let across = from_middle.dot(band.across) / band.across.length_sq();
            tilt.band = (2.0 * across.abs()).clamp(0.0, 1.0);
        }
        // Closer to the centre, the angle would be unstable.
        TiltHandle::Turn if from_middle.length() > 4.0 => {
            let side = if viewport.mirror { -1.0 } else { 1.0 };
            let angle = from_middle.y.atan2(side * from_middle.x).to_degrees();
            // Snaps to multiples of 45 degrees.
            let nearest = (angle / 45.0).round() * 45.0;
            tilt.angle_deg = rotate_band(if (angle - nearest).abs() < 2.0 { nearest } else { angle }, 0.0);
        }
        TiltHandle::Turn => {}
    }
}

/// Returns the `center_y` that makes the band's centre line pass through a point, given as fractions of the picture;
/// `size` is the picture's size in pixels.
pub fn center_y_through(tilt: &Tilt, size: Vec2, [x, y]: [f32; 2]) -> f32 {
    let (sin, cos) = tilt.angle_deg.to_radians().sin_cos();
    if cos.abs() < 0.2 {
        // Nearly vertical band: `center_y` would lie far outside the picture.
        return y;
    }
    (y - sin / cos * (x - 0.5) * size.x / size.y).clamp(0.0, 1.0)
}

/// Draws the tilt-shift band and its marks; the mark `near` the pointer is enlarged.
pub fn draw_tilt(painter: &Painter, tilt: &Tilt, viewport: &Viewport, near: Option<TiltHandle>) {
    let band = TiltBand::new(tilt, viewport);
    // Extends by the picture's diagonal in each direction, so that the edges cross the whole picture.
    let extent = band.along * (viewport.rect.size().length() / viewport.rect.height());
    for side in [-1.0, 1.0] {
        let at = band.edge(tilt, side);
        for (width, color) in [(3.5, OVERLAY_OUTLINE), (1.5, OVERLAY_COLOR)] {
            painter.extend(Shape::dashed_line(&[at - extent, at + extent], Stroke::new(width, color), 10.0, 7.0));
        }
    }
    let rotation_handle = band.rotation_handle(viewport);
    draw_line(painter, [band.middle, rotation_handle], 1.5);
    let size = |handle: TiltHandle, usual: f32| if near == Some(handle) { usual + 2.5 } else { usual };
    for side in [-1.0, 1.0] {
        draw_dot(painter, band.edge(tilt, side), size(TiltHandle::Edge, 5.5));
    }
    draw_dot(painter, rotation_handle, size(TiltHandle::Turn, 6.5));
    painter.circle_filled(rotation_handle, 3.0, Color32::from_gray(40));
    draw_dot(painter, band.middle, size(TiltHandle::Middle, 9.0));
    if near == Some(TiltHandle::Turn) {
        let text = format!("{:.0}°", tilt.angle_deg);
        draw_label(painter, rotation_handle + vec2(0.0, -24.0), Align2::CENTER_CENTER, &text, None);
    }
}
