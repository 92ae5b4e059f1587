//! Badges while the panel is hidden: that something is being written, or that the picture is frozen.

use egui::{Align2, Color32, Context, CornerRadius, FontId, Id, LayerId, Order, vec2};

use super::state::State;
use super::theme::{GAP, ON_PICTURE, medium};

const HEIGHT: f32 = 24.0;
/// Red enough for a dot on a dark badge.
const LIVE: Color32 = Color32::from_rgb(255, 90, 80);

/// Draws the badges at the top right.
pub fn show(ctx: &Context, state: &State) {
    let all = [
        (state.recording().is_some(), "Recording", LIVE),
        (state.virtual_camera().is_some(), "Virtual camera", LIVE),
        (state.frozen, "Frozen", ON_PICTURE),
    ];
    let painter = ctx.layer_painter(LayerId::new(Order::Middle, Id::unique("badges")));
    let mut corner = ctx.content_rect().right_top() + vec2(-GAP, GAP);
    for (_, text, color) in all.into_iter().filter(|(on, ..)| *on) {
        let galley = painter.layout_no_wrap(text.to_owned(), FontId::new(12.5, medium()), ON_PICTURE);
        let rect = Align2::RIGHT_TOP.anchor_size(corner, vec2(galley.size().x + 34.0, HEIGHT));
        painter.rect_filled(rect, CornerRadius::same(12), Color32::from_black_alpha(190));
        painter.circle_filled(rect.left_center() + vec2(13.0, 0.0), 4.5, color);
        painter.galley(rect.left_center() + vec2(23.0, -galley.size().y / 2.0), galley, ON_PICTURE);
        corner.y += HEIGHT + 6.0;
    }
}
