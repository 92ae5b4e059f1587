//! Icons drawn as line art.

use std::f32::consts::TAU;

use egui::{Color32, CornerRadius, Painter, Pos2, Rect, Sense, Shape, Stroke, StrokeKind, Ui, Vec2, WidgetInfo};
use egui::{Role, vec2};

use super::theme::Colors;
use super::widgets::Tooltip;
use crate::texts::tr;

/// Side of an icon button, in points.
pub const ICON_SIZE: f32 = 26.0;

/// The available icons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Icon {
    /// An arrow that curves to the left.
    Undo,
    /// An arrow that curves to the right.
    Redo,
    /// A circular arrow.
    Reset,
    Help,
    Close,
    /// Sliders.
    Panel,
    Play,
    Pause,
    /// Step one frame back.
    Back,
    /// Step one frame forward.
    Forward,
}

/// Adds an icon button. Returns whether it was clicked.
pub fn add_button(ui: &mut Ui, icon: Icon, hint: &str, enabled: bool) -> bool {
    let colors = Colors::for_ui(ui);
    // A button that becomes disabled keeps the focus, so that Tab continues from there.
    let id = ui.scope_id().with(hint);
    let keeps_focus = ui.memory(|memory| memory.has_focus(id));
    let sense = match (enabled, keeps_focus) {
        (true, _) => Sense::click(),
        (false, true) => Sense::focusable_noninteractive(),
        (false, false) => Sense::hover(),
    };
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(ICON_SIZE), Sense::hover());
    let response = ui.interact(rect, id, sense);
    response.widget_info(|| WidgetInfo::labeled(Role::Button, enabled, tr(hint)));
    if enabled && response.hovered() {
        ui.painter().rect_filled(rect, CornerRadius::same(7), colors.hover);
    }
    let color = if enabled { colors.text } else { colors.weak.gamma_multiply(0.65) };
    draw(ui.painter(), icon, rect.center(), color);
    response.tooltip(hint).clicked()
}

/// Draws an icon around its centre `at`; offsets are in points.
fn draw(painter: &Painter, icon: Icon, at: Pos2, color: Color32) {
    let stroke = Stroke::new(1.6, color);
    match icon {
        Icon::Undo | Icon::Redo => {
            let side = if icon == Icon::Undo { -1.0 } else { 1.0 };
            draw_arc(painter, at + vec2(side, 1.5), 5.5, [0.5, 1.0], stroke);
            let tip = at + vec2(side * 6.5, 3.0);
            painter.add(Shape::line(vec![tip + vec2(-3.6, -3.4), tip, tip + vec2(3.6, -3.4)], stroke));
        }
        Icon::Reset => {
            draw_arc(painter, at, 6.0, [0.12, 0.92], stroke);
            let tip = at + Vec2::angled(0.12 * TAU) * 6.0;
            painter.add(Shape::line(vec![tip + vec2(-4.6, -0.6), tip, tip + vec2(0.8, 4.6)], stroke));
        }
        Icon::Help => {
            draw_arc(painter, at + vec2(0.0, -3.0), 3.2, [0.5, 1.12], stroke);
            let foot = at + vec2(0.0, 2.0);
            painter.add(Shape::line(vec![at + vec2(2.3, -0.8), at + vec2(0.2, 0.7), foot], stroke));
            painter.circle_filled(at + vec2(0.0, 5.6), 1.2, color);
        }
        Icon::Panel => {
            for (y, knob) in [(-5.0, 2.5), (0.0, -3.0), (5.0, 1.0)] {
                painter.line_segment([at + vec2(-7.0, y), at + vec2(7.0, y)], stroke);
                painter.circle_filled(at + vec2(knob, y), 2.4, color);
            }
        }
        Icon::Play => draw_triangle(painter, at + vec2(1.0, 0.0), 1.0, color),
        Icon::Pause => {
            for x in [-3.5, 3.5] {
                draw_bar(painter, at + vec2(x, 0.0), color);
            }
        }
        Icon::Back | Icon::Forward => {
            let side = if icon == Icon::Back { -1.0 } else { 1.0 };
            draw_triangle(painter, at + vec2(-2.0 * side, 0.0), side, color);
            draw_bar(painter, at + vec2(6.0 * side, 0.0), color);
        }
        Icon::Close => {
            for down in [-1.0, 1.0] {
                painter.line_segment([at + vec2(-4.5, -4.5 * down), at + vec2(4.5, 4.5 * down)], stroke);
            }
        }
    }
}

/// Draws a triangle that points right (`side` is 1) or left (-1).
fn draw_triangle(painter: &Painter, at: Pos2, side: f32, color: Color32) {
    let points = [vec2(-4.0, -6.0), vec2(6.0, 0.0), vec2(-4.0, 6.0)].map(|point| at + vec2(side * point.x, point.y));
    painter.add(Shape::convex_polygon(points.to_vec(), color, Stroke::NONE));
}

/// Draws a vertical bar.
fn draw_bar(painter: &Painter, at: Pos2, color: Color32) {
    painter.rect_filled(Rect::from_center_size(at, vec2(3.0, 12.0)), CornerRadius::same(1), color);
}

/// Draws an arc between two angles in turns, clockwise from the right.
fn draw_arc(painter: &Painter, center: Pos2, radius: f32, turns: [f32; 2], stroke: Stroke) {
    let points = (0..=20).map(|k| {
        let turn = turns[0] + (turns[1] - turns[0]) * k as f32 / 20.0;
        center + Vec2::angled(turn * TAU) * radius
    });
    painter.add(Shape::line(points.collect(), stroke));
}

/// Draws a camera.
pub fn draw_camera(painter: &Painter, center: Pos2, color: Color32) {
    let stroke = Stroke::new(1.5, color);
    let body = Rect::from_center_size(center + vec2(0.0, 1.0), vec2(18.0, 12.0));
    painter.rect_stroke(body, CornerRadius::same(3), stroke, StrokeKind::Middle);
    painter.circle_stroke(body.center(), 3.2, stroke);
    painter.line_segment([center + vec2(-3.0, -7.0), center + vec2(3.0, -7.0)], stroke);
}

/// Draws the record button: a dot, or a stop square while it records.
pub fn draw_record(painter: &Painter, center: Pos2, on: bool, color: Color32) {
    if on {
        painter.rect_filled(Rect::from_center_size(center, Vec2::splat(9.0)), CornerRadius::same(2), color);
    } else {
        painter.circle_filled(center, 5.0, color);
        painter.rect_stroke(
            Rect::from_center_size(center, Vec2::splat(14.0)),
            CornerRadius::same(7),
            Stroke::new(1.0, color),
            StrokeKind::Inside,
        );
    }
}
