//! The colour legend of a diagnostic view, drawn over the picture.

use egui::{Align2, Color32, FontFamily, FontId, Mesh, Painter, Rect, Shape, Stroke, Ui, Vec2, pos2, vec2};

use super::state::State;
use super::theme::{Colors, GAP, PAD, card_frame};
use super::views::{BIN_COLORS, Legend, depth_fraction, diverging_color, viridis};
use crate::texts::{format_number, tr, tr_with};

const WIDTH: f32 = 260.0;
/// Height of a colour bar, in points.
const BAR_HEIGHT: f32 = 14.0;
/// Number of steps in a colour bar.
const STEPS_PER_BAR: usize = 64;

/// Draws the legend at the left, `above` points from the bottom, unless the window is too small.
pub fn show(ui: &Ui, state: &State, above: f32) {
    let Some(legend) = state.legend else { return };
    let window = super::dock::picture_area(ui.ctx());
    if window.width() < WIDTH * 1.2 || window.height() < 120.0 {
        return;
    }
    // Bins are listed in two columns.
    let rows = match legend {
        Legend::Bins { count, .. } => count.div_ceil(2),
        Legend::Depth { .. } | Legend::Coc { .. } => 0,
    };
    let height = if rows > 0 { 40.0 + 20.0 * rows as f32 } else { 76.0 };
    let rect =
        Rect::from_min_size(pos2(window.left() + GAP, window.bottom() - GAP - above - height), vec2(WIDTH, height));
    let colors = Colors::for_ui(ui);
    let painter = ui.painter();
    // The card adds its inner margin.
    painter.add(card_frame(&colors).paint(rect.shrink(PAD)));
    let inner = rect.shrink2(vec2(16.0, 10.0));
    let title = |text: &str| {
        let text = tr(text);
        let font = FontId::new(12.5, super::theme::medium_font());
        painter.text(inner.left_top(), Align2::LEFT_TOP, text, font, colors.text);
    };
    let bar = Rect::from_min_size(inner.min + vec2(0.0, 22.0), vec2(inner.width(), BAR_HEIGHT));
    match legend {
        Legend::Depth { near_m, far_m } => {
            title(if state.source_depth().is_relative { "Depth: far to near" } else { "Depth in metres" });
            draw_ramp(painter, bar, |fraction| viridis()[(fraction * 255.0) as usize]);
            let in_metres = !state.source_depth().is_relative;
            for metres in round_tick_depths(near_m, far_m).into_iter().filter(|_| in_metres) {
                let x = bar.left() + depth_fraction(metres, near_m, far_m).clamp(0.0, 1.0) * bar.width();
                draw_tick(painter, &colors, bar, x, &format_metres(metres));
            }
        }
        Legend::Coc { max_px } => {
            title("Blur radius in pixels");
            draw_ramp(painter, bar, |fraction| diverging_color(2.0 * fraction - 1.0));
            draw_hatch(painter, Rect::from_min_max(bar.min, bar.center_bottom()));
            let max_radius = format!("{max_px:.0}");
            let [in_front, behind] = ["{} in front", "{} behind"].map(|text| tr_with(text, &[&max_radius]));
            let labels = [in_front, "0".to_owned(), behind];
            for (label, side) in labels.iter().zip([-1.0, 0.0, 1.0]) {
                draw_tick(painter, &colors, bar, bar.center().x + side * bar.width() / 2.0, label);
            }
        }
        Legend::Bins { count, high_px } => {
            title("Layers, front to back: blur radius");
            for index in 0..count {
                let (column, row) = (index / rows.max(1), index % rows.max(1));
                let at = inner.min + vec2(inner.width() / 2.0 * column as f32, 24.0 + 20.0 * row as f32);
                draw_bin_entry(painter, &colors, at, index, &high_px[..count]);
            }
        }
    }
}

/// Fills a bar with `color(t)`, where t runs from 0 at the left to 1 at the right.
fn draw_ramp(painter: &Painter, bar: Rect, color: impl Fn(f32) -> [u8; 3]) {
    let mut mesh = Mesh::default();
    let width = bar.width() / STEPS_PER_BAR as f32;
    for cell in 0..STEPS_PER_BAR {
        let [r, g, b] = color((cell as f32 + 0.5) / STEPS_PER_BAR as f32);
        // Cells overlap slightly, to avoid gaps between them.
        let at = Rect::from_min_size(bar.min + vec2(cell as f32 * width, 0.0), vec2(width + 0.25, bar.height()));
        mesh.add_colored_rect(at, Color32::from_rgb(r, g, b));
    }
    painter.add(Shape::mesh(mesh));
}

/// Hatches part of a bar like the view hatches pixels in front of the focal plane.
fn draw_hatch(painter: &Painter, rect: Rect) {
    let painter = painter.with_clip_rect(rect);
    let mut x = rect.left();
    while x < rect.right() + rect.height() {
        let ends = [pos2(x, rect.top()), pos2(x - rect.height(), rect.bottom())];
        painter.line_segment(ends, Stroke::new(1.5, Color32::from_black_alpha(140)));
        x += 7.0;
    }
}

/// Draws a tick below a bar with its label, shifted inwards if it would stick out.
fn draw_tick(painter: &Painter, colors: &Colors, bar: Rect, x: f32, label: &str) {
    painter.line_segment([pos2(x, bar.bottom()), pos2(x, bar.bottom() + 4.0)], Stroke::new(1.0, colors.text));
    let font = FontId::new(12.0, FontFamily::Proportional);
    let galley = painter.layout_no_wrap(label.to_owned(), font, colors.text);
    let left = (x - galley.size().x / 2.0).clamp(bar.left() - 2.0, bar.right() + 2.0 - galley.size().x);
    painter.galley(pos2(left, bar.bottom() + 5.0), galley, colors.text);
}

/// Draws a row of the bin legend: colour, index, and the CoC range from the previous bin's end to its own.
fn draw_bin_entry(painter: &Painter, colors: &Colors, at: egui::Pos2, index: usize, high_px: &[f32]) {
    let [r, g, b] = BIN_COLORS[index % BIN_COLORS.len()];
    let swatch = Rect::from_min_size(at, Vec2::new(22.0, 15.0));
    painter.rect_filled(swatch, egui::CornerRadius::same(3), Color32::from_rgb(r, g, b));
    // White text if the luma (weights 0.3, 0.6, 0.1) is below 120 of 255.
    let dark = u32::from(r) * 3 + u32::from(g) * 6 + u32::from(b) < 1200;
    let ink = if dark { Color32::WHITE } else { Color32::BLACK };
    let font = FontId::new(11.0, super::theme::medium_font());
    painter.text(swatch.center(), Align2::CENTER_CENTER, index + 1, font, ink);
    let low_px = index.checked_sub(1).map(|before| high_px[before]);
    let number = |px: f32| if px < 0.0 { format!("−{}", format_number(-px, 1)) } else { format_number(px, 1) };
    let range = match (low_px, high_px[index].is_finite()) {
        (None, false) => tr("all").to_owned(),
        (None, true) => tr_with("to {} px", &[&number(high_px[index])]),
        (Some(low_px), false) => tr_with("from {} px", &[&number(low_px)]),
        (Some(low_px), true) => tr_with("{} to {} px", &[&number(low_px), &number(high_px[index])]),
    };
    let font = FontId::new(12.0, FontFamily::Proportional);
    painter.text(swatch.right_center() + vec2(6.0, 0.0), Align2::LEFT_CENTER, range, font, colors.text);
}

/// Returns round distances within a range, in metres from near to far, spaced so that their labels do not overlap.
pub fn round_tick_depths(near_m: f32, far_m: f32) -> Vec<f32> {
    const STEPS: [f32; 9] = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0];
    // Minimum distance of two labels, as a fraction of the bar's width.
    const MIN_SPACING: f32 = 0.17;
    let mut chosen: Vec<f32> = Vec::new();
    let nice = (-1..3).flat_map(|decade| STEPS.map(|step| step * 10f32.powi(decade)));
    for metres in nice.filter(|metres| (near_m..=far_m).contains(metres)) {
        let fraction = depth_fraction(metres, near_m, far_m);
        if chosen.last().is_none_or(|&last| depth_fraction(last, near_m, far_m) - fraction >= MIN_SPACING) {
            chosen.push(metres);
        }
    }
    chosen
}

fn format_metres(metres: f32) -> String {
    format_number(metres, usize::from(metres < 10.0 && metres.fract() > 0.01))
}
