//! The probe: depth and blur under the pointer.

use egui::{Align, Align2, Context, Id, LayerId, Order, Ui, vec2};

use super::marks::draw_label;
use super::state::{State, ViewMode};
use super::viewport::Viewport;
use crate::texts::{format_number, tr, tr_with};
use crate::views::Probe;
use bokehcam::frame::DepthMap;

/// Update interval of the values while the pointer rests, in seconds: frames continue to change them.
const PERIOD_S: f32 = 0.2;

/// Returns the probed position as fractions of the picture. The probe is active while the instruments or a diagnostic
/// view are shown, or Alt is held.
pub fn probed_point(ui: &Ui, state: &State, viewport: &Viewport) -> Option<[f32; 2]> {
    let (at, alt) = ui.input(|input| (input.pointer.hover_pos(), input.modifiers.alt));
    let is_wanted = alt || !state.controls_hidden && (state.instruments || state.shown != ViewMode::Picture);
    let at = at.filter(|at| is_wanted && viewport.visible.contains(*at))?;
    // Not through the panel.
    let layer = ui.ctx().layer_id_at(at);
    (layer.is_none() || layer == Some(ui.layer_id())).then(|| viewport.to_fractions(at))
}

/// Draws the probe's values beside the pointer.
pub fn show(ctx: &Context, state: &State) {
    ctx.request_repaint_after_secs(PERIOD_S);
    let Some((probe, at)) = state.probe.zip(ctx.pointer_latest_pos()) else { return };
    let painter = ctx.layer_painter(LayerId::new(Order::Middle, Id::unique("probe")));
    let text = format_probe(probe, state.camera.is_relative);
    // At the lower right of the pointer, unless that would be outside the window.
    let window = super::dock::picture_area(ctx);
    let (x, dx) = if at.x + 240.0 < window.right() { (Align::Min, 16.0) } else { (Align::Max, -12.0) };
    let (y, dy) = if at.y + 50.0 < window.bottom() { (Align::Min, 20.0) } else { (Align::Max, -12.0) };
    draw_label(&painter, at + vec2(dx, dy), Align2([x, y]), &text, None);
}

/// Formats the probe's values. Relative distances are in units of the nearest one, not in metres.
fn format_probe(probe: Probe, is_relative: bool) -> String {
    let depth = match (probe.depth_m, is_relative) {
        (None, _) => tr("no depth").to_owned(),
        (Some(far), true) if far >= 0.99 * DepthMap::FAR_M => tr("far").to_owned(),
        (Some(near), true) => tr_with("{} × the nearest", &[&format_number(near, 2)]),
        (Some(metres), false) if metres >= 100.0 => format!("{metres:.0} m"),
        (Some(metres), false) => format!("{} m", format_number(metres, 2)),
    };
    tr_with("{}, CoC {} px", &[&depth, &format!("{:+.1}", probe.coc_px)]).replace('-', "−")
}
