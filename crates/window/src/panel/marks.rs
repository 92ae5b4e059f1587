//! Marks drawn on the picture: the point of focus, the split line, the band of tilt-shift.
//!
//! They are light with a dark border, so that they stand out on any picture.

use egui::{Align2, Color32, CornerRadius, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2, pos2, vec2};

use super::place::Place;
use super::state::tweak::turned;
use super::theme::{ON_PICTURE, SHADE, medium};
use crate::texts::tr;
use bokehcam::frame::crop::Crop;
use bokehcam::look::Tilt;

/// A mark can be grabbed this near to it, in points.
const HOLD: f32 = 16.0;

/// The mark of tilt-shift that is being dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tilting {
    /// The middle, which moves the band.
    Middle,
    /// An edge, which changes its width.
    Edge,
    /// The grip beside the middle, which turns it.
    Turn,
}

impl Tilting {
    /// The stroke of this mark: changes of one stroke are undone together.
    pub fn stroke(self) -> &'static str {
        match self {
            Self::Middle => "tilt middle",
            Self::Edge => "tilt edge",
            Self::Turn => "tilt turn",
        }
    }
}

fn line(painter: &Painter, ends: [Pos2; 2], width: f32) {
    painter.line_segment(ends, Stroke::new(width + 2.0, SHADE));
    painter.line_segment(ends, Stroke::new(width, ON_PICTURE));
}

fn dot(painter: &Painter, at: Pos2, radius: f32) {
    painter.circle_filled(at, radius + 1.5, SHADE);
    painter.circle_filled(at, radius, ON_PICTURE);
}

/// The ring where one clicked, which shrinks and fades as `age` goes from 0 to 1.
pub fn ring(painter: &Painter, at: Pos2, age: f32) {
    let settle = (age / 0.3).min(1.0);
    let radius = 40.0 - 18.0 * (1.0 - (1.0 - settle) * (1.0 - settle));
    let opacity = ((1.0 - age) / 0.5).min(1.0);
    painter.circle_stroke(at, radius, Stroke::new(4.0, SHADE.gamma_multiply(opacity)));
    painter.circle_stroke(at, radius, Stroke::new(2.0, ON_PICTURE.gamma_multiply(opacity)));
}

/// The point of focus: four corners of a square.
pub fn point(painter: &Painter, at: Pos2) {
    for (width, color) in [(3.5, SHADE), (1.5, ON_PICTURE)] {
        for corner in [vec2(-1.0, -1.0), vec2(1.0, -1.0), vec2(1.0, 1.0), vec2(-1.0, 1.0)] {
            let tip = at + corner * 13.0;
            let points = vec![tip - vec2(corner.x * 6.0, 0.0), tip, tip - vec2(0.0, corner.y * 6.0)];
            painter.add(Shape::line(points, Stroke::new(width, color)));
        }
    }
}

/// The part of the picture that goes out, within a dashed line.
pub fn part(painter: &Painter, place: &Place, part: &Crop) {
    let size = place.rect.size() / part.zoom;
    let rect = Rect::from_center_size(place.point(part.center), size).shrink(1.0);
    let corners = [rect.left_top(), rect.right_top(), rect.right_bottom(), rect.left_bottom(), rect.left_top()];
    for (width, color) in [(3.5, SHADE), (1.5, ON_PICTURE)] {
        painter.extend(Shape::dashed_line(&corners, Stroke::new(width, color), 10.0, 7.0));
    }
}

/// The line between before (left) and after.
pub fn split(painter: &Painter, place: &Place, at: f32, held: bool, after: &str) {
    let x = place.rect.left() + at * place.rect.width();
    let rect = place.seen;
    line(painter, [pos2(x, rect.top()), pos2(x, rect.bottom())], if held { 3.0 } else { 2.0 });
    let grip = pos2(x, rect.center().y);
    dot(painter, grip, if held { 15.0 } else { 13.0 });
    for side in [-1.0, 1.0] {
        let tip = grip + vec2(side * 7.5, 0.0);
        let points = vec![tip + vec2(side * -3.5, -4.0), tip, tip + vec2(side * -3.5, 4.0)];
        painter.add(Shape::line(points, Stroke::new(1.8, Color32::from_gray(40))));
    }
    label(painter, pos2(x - 12.0, rect.top() + 14.0), Align2::RIGHT_TOP, tr("Before"), None);
    label(painter, pos2(x + 12.0, rect.top() + 14.0), Align2::LEFT_TOP, tr(after), None);
}

/// Words on the picture, on a dark field, after a dot if it has a colour. Where they are.
pub fn label(painter: &Painter, at: Pos2, align: Align2, text: &str, dot: Option<Color32>) -> Rect {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::new(12.5, medium()), ON_PICTURE);
    let left = if dot.is_some() { 23.0 } else { 8.0 };
    let rect = align.anchor_size(at, galley.size() + vec2(left + 8.0, 8.0));
    painter.rect_filled(rect, CornerRadius::same(9), Color32::from_black_alpha(190));
    if let Some(color) = dot {
        painter.circle_filled(rect.left_center() + vec2(13.0, 0.0), 4.5, color);
    }
    painter.galley(rect.min + vec2(left, 4.0), galley, ON_PICTURE);
    rect
}

/// The band of tilt-shift on the screen, in points.
struct Band {
    middle: Pos2,
    /// The directions along the band and across it, each as long as the picture is high.
    along: Vec2,
    across: Vec2,
}

impl Band {
    fn new(tilt: &Tilt, place: &Place) -> Self {
        let (sin, cos) = tilt.angle_deg.to_radians().sin_cos();
        let side = if place.mirror { -1.0 } else { 1.0 };
        let height = place.rect.height();
        Self {
            middle: place.point([0.5, tilt.center_y]),
            along: vec2(side * cos, sin) * height,
            across: vec2(side * -sin, cos) * height,
        }
    }

    /// The middle of an edge: the upper one (`side` is -1) or the lower one (1) of a level band.
    fn edge(&self, tilt: &Tilt, side: f32) -> Pos2 {
        self.middle + self.across * (side * tilt.band / 2.0)
    }

    /// The grip that turns it, within the picture.
    fn turn_grip(&self, place: &Place) -> Pos2 {
        let shorter_side = place.rect.width().min(place.rect.height()) / place.rect.height();
        self.middle + self.along * (0.32 * shorter_side)
    }
}

/// The mark of tilt-shift that a press at `at` grabs: one that is near, or else the band itself.
pub fn grip(tilt: &Tilt, place: &Place, at: Pos2) -> Option<Tilting> {
    let band = Band::new(tilt, place);
    let near = |mark: Pos2| mark.distance(at) <= HOLD;
    if near(band.turn_grip(place)) {
        Some(Tilting::Turn)
    } else if near(band.middle) {
        Some(Tilting::Middle)
    } else if [-1.0, 1.0].into_iter().any(|side| near(band.edge(tilt, side))) {
        Some(Tilting::Edge)
    } else {
        let across = (at - band.middle).dot(band.across) / band.across.length_sq();
        (across.abs() <= tilt.band / 2.0).then_some(Tilting::Middle)
    }
}

/// Drags a mark to `at`.
pub fn drag(tilt: &mut Tilt, tilting: Tilting, place: &Place, at: Pos2) {
    let band = Band::new(tilt, place);
    let from_middle = at - band.middle;
    match tilting {
        Tilting::Middle => tilt.center_y = ((at.y - place.rect.top()) / place.rect.height()).clamp(0.0, 1.0),
        Tilting::Edge => {
            let across = from_middle.dot(band.across) / band.across.length_sq();
            tilt.band = (2.0 * across.abs()).clamp(0.0, 1.0);
        }
        // Nearer to the middle the angle would jump.
        Tilting::Turn if from_middle.length() > 4.0 => {
            let side = if place.mirror { -1.0 } else { 1.0 };
            let angle = from_middle.y.atan2(side * from_middle.x).to_degrees();
            // Snaps to multiples of 45 degrees.
            let nearest = (angle / 45.0).round() * 45.0;
            tilt.angle_deg = turned(if (angle - nearest).abs() < 2.0 { nearest } else { angle }, 0.0);
        }
        Tilting::Turn => {}
    }
}

/// The `center_y` with which the middle of the band runs through a point, given as fractions of the picture; `size` is
/// the picture's own, in pixels.
pub fn center_through(tilt: &Tilt, size: Vec2, [x, y]: [f32; 2]) -> f32 {
    let (sin, cos) = tilt.angle_deg.to_radians().sin_cos();
    if cos.abs() < 0.2 {
        // Nearly upright: the `center_y` would lie far outside of the picture.
        return y;
    }
    (y - sin / cos * (x - 0.5) * size.x / size.y).clamp(0.0, 1.0)
}

/// The band of tilt-shift and its grips; the one that is `near` the pointer is larger.
pub fn tilt(painter: &Painter, tilt: &Tilt, place: &Place, near: Option<Tilting>) {
    let band = Band::new(tilt, place);
    // As long as the picture's diagonal, so that the edges cross all of it.
    let reach = band.along * (place.rect.size().length() / place.rect.height());
    for side in [-1.0, 1.0] {
        let at = band.edge(tilt, side);
        for (width, color) in [(3.5, SHADE), (1.5, ON_PICTURE)] {
            painter.extend(Shape::dashed_line(&[at - reach, at + reach], Stroke::new(width, color), 10.0, 7.0));
        }
    }
    let turn_grip = band.turn_grip(place);
    line(painter, [band.middle, turn_grip], 1.5);
    let size = |tilting: Tilting, usual: f32| if near == Some(tilting) { usual + 2.5 } else { usual };
    for side in [-1.0, 1.0] {
        dot(painter, band.edge(tilt, side), size(Tilting::Edge, 5.5));
    }
    dot(painter, turn_grip, size(Tilting::Turn, 6.5));
    painter.circle_filled(turn_grip, 3.0, Color32::from_gray(40));
    dot(painter, band.middle, size(Tilting::Middle, 9.0));
    if near == Some(Tilting::Turn) {
        let text = format!("{:.0}°", tilt.angle_deg);
        label(painter, turn_grip + vec2(0.0, -24.0), Align2::CENTER_CENTER, &text, None);
    }
}
