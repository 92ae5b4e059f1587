//! Status badges that are always visible: active recording or virtual camera with its duration, frozen picture, pending
//! look change.

use std::time::Duration;

use egui::{Align2, Color32, Context, Id, LayerId, Order, vec2};

use super::dock::picture_area;
use super::icons;
use super::marks::draw_label;
use super::state::State;
use super::theme::{GAP, OVERLAY_COLOR};
use crate::texts::{format_number, tr};

/// Red that is bright enough for a dot on a dark badge.
const ACTIVE_COLOR: Color32 = Color32::from_rgb(255, 90, 80);

/// Start times of the active outputs and of a pending look change, in egui's seconds.
#[derive(Debug, Default)]
pub struct Badges {
    recording_s: Option<f64>,
    camera_s: Option<f64>,
    change_since_s: Option<f64>,
}

/// A look change that takes less time shows no badge, in seconds.
const MIN_SHOWN_S: f64 = 0.06;

impl Badges {
    /// Draws the badges at the top right of the picture.
    pub fn show(&mut self, ctx: &Context, state: &State) {
        let now_s = ctx.input(|input| input.time);
        let text = |name: &str, is_on: bool, since_s: &mut Option<f64>| {
            *since_s = is_on.then(|| since_s.unwrap_or(now_s));
            since_s.map(|since_s| format!("{} {}", tr(name), format_duration(now_s - since_s)))
        };
        let recording = text("Recording", state.recording().is_some(), &mut self.recording_s);
        let sized = |text| match state.recorded_bytes {
            Some(bytes) => format!("{text}, {}", format_size(bytes)),
            None => text,
        };
        self.change_since_s = state.is_transitional.then(|| self.change_since_s.unwrap_or(now_s));
        let is_late = self.change_since_s.is_some_and(|since_s| now_s - since_s >= MIN_SHOWN_S);
        if state.is_transitional && !is_late {
            ctx.request_repaint_after(Duration::from_secs_f64(MIN_SHOWN_S));
        }
        let camera = if state.is_watched { "In a call" } else { "For calls, nobody watches" };
        let all = [
            (recording.map(sized), ACTIVE_COLOR),
            (text(camera, state.virtual_camera().is_some(), &mut self.camera_s), ACTIVE_COLOR),
            (state.off.then(|| tr("Off: a still card is shown").to_owned()), OVERLAY_COLOR),
            (freeze_text(state).map(|text| tr(text).to_owned()), OVERLAY_COLOR),
            (is_late.then(|| tr("Working…").to_owned()), OVERLAY_COLOR),
        ];
        if self.recording_s.or(self.camera_s).is_some() {
            ctx.request_repaint_after(Duration::from_secs(1));
        }
        let painter = ctx.layer_painter(LayerId::new(Order::Middle, Id::unique("badges")));
        // Leaves room for the button that reopens the panel.
        let reserved = if state.panel || state.controls_hidden { 0.0 } else { icons::ICON_SIZE + 14.0 };
        let mut corner = picture_area(ctx).right_top() + vec2(-GAP - reserved, GAP);
        for (text, color) in all.into_iter().filter_map(|(text, color)| Some((text?, color))) {
            corner.y += draw_label(&painter, corner, Align2::RIGHT_TOP, &text, Some(color)).height() + 6.0;
        }
    }
}

/// Returns the text of the freeze badge; `None` if the picture is live.
fn freeze_text(state: &State) -> Option<&'static str> {
    let text = match (state.can_pause(), state.outputs.is_empty()) {
        (true, _) => "Paused",
        (false, true) => "Frozen",
        (false, false) => "Frozen here, live elsewhere",
    };
    state.frozen.then_some(text)
}

/// Formats a size in decimal units.
fn format_size(bytes: u64) -> String {
    let (kb, mb) = (bytes as f64 / 1e3, bytes as f64 / 1e6);
    if mb >= 1e3 {
        format!("{} GB", format_number(mb / 1e3, 2))
    } else if mb >= 1.0 {
        format!("{} MB", format_number(mb, 1))
    } else {
        format!("{kb:.0} kB")
    }
}

/// Formats a duration as `m:ss`, or `h:mm:ss` from one hour on.
fn format_duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}
