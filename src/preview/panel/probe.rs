//! What is under the pointer: its depth and its blur.

use egui::{Align2, Context, CornerRadius, FontFamily, FontId, Id, LayerId, Order, Ui, vec2};

use super::place::Place;
use super::state::{Shown, State};
use super::theme::{ON_PICTURE, SHADE};
use crate::frame::DepthMap;
use crate::preview::texts::{tr, tr_with};
use crate::preview::views::Probe;

/// While the pointer rests, frames go on: what is said of them is renewed this often, in seconds.
const PERIOD_S: f32 = 0.2;

/// The place under the pointer, as fractions of the picture, where somebody wants to know of it: while instruments or a view
/// other than the picture are shown, or Alt is held.
pub fn place(ui: &Ui, state: &State, place: &Place) -> Option<[f32; 2]> {
    let (at, alt) = ui.input(|input| (input.pointer.hover_pos(), input.modifiers.alt));
    let is_wanted = alt || !state.bare && (state.instruments || state.shown != Shown::Picture);
    let at = at.filter(|at| is_wanted && place.seen.contains(*at))?;
    // Not through the panel.
    let layer = ui.ctx().layer_id_at(at);
    (layer.is_none() || layer == Some(ui.layer_id())).then(|| place.fractions(at))
}

/// Draws what is known there beside the pointer.
pub fn show(ctx: &Context, state: &State) {
    ctx.request_repaint_after_secs(PERIOD_S);
    let Some((probe, at)) = state.probe.zip(ctx.pointer_latest_pos()) else { return };
    let painter = ctx.layer_painter(LayerId::new(Order::Middle, Id::unique("probe")));
    let text = text(probe, state.camera.is_relative);
    let galley = painter.layout_no_wrap(text, FontId::new(12.5, FontFamily::Proportional), ON_PICTURE);
    let (window, size) = (ctx.content_rect(), galley.size() + vec2(14.0, 8.0));
    // Right and below, unless that is outside.
    let right = at.x + 16.0 + size.x < window.right();
    let below = at.y + 20.0 + size.y < window.bottom();
    let corner = match (right, below) {
        (true, true) => at + vec2(16.0, 20.0),
        (false, true) => at + vec2(-12.0 - size.x, 20.0),
        (true, false) => at + vec2(16.0, -12.0 - size.y),
        (false, false) => at + vec2(-12.0 - size.x, -12.0 - size.y),
    };
    let rect = Align2::LEFT_TOP.anchor_size(corner, size);
    painter.rect_filled(rect, CornerRadius::same(6), SHADE);
    painter.galley(rect.min + vec2(7.0, 4.0), galley, ON_PICTURE);
}

/// Relative distances are in units of the nearest one, and have no metres.
fn text(probe: Probe, is_relative: bool) -> String {
    let depth = match (probe.depth_m, is_relative) {
        (None, _) => tr("no depth").to_owned(),
        (Some(far), true) if far >= 0.99 * DepthMap::FAR_M => tr("far").to_owned(),
        (Some(near), true) => tr_with("{} × the nearest", &[&format!("{near:.2}")]),
        (Some(metres), false) if metres >= 100.0 => format!("{metres:.0} m"),
        (Some(metres), false) => format!("{metres:.2} m"),
    };
    tr_with("{}, CoC {} px", &[&depth, &format!("{:+.1}", probe.coc_px)]).replace('-', "−")
}
