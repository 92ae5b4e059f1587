//! Badges: that something is being written, and for how long, that the picture is frozen, or that the next look is being
//! worked on. Always to be seen.

use std::time::Duration;

use egui::{Align2, Color32, Context, Id, LayerId, Order, vec2};

use super::dock::room;
use super::icons;
use super::marks::label;
use super::state::State;
use super::theme::{GAP, ON_PICTURE};
use crate::texts::tr;

/// Red enough for a dot on a dark badge.
const LIVE: Color32 = Color32::from_rgb(255, 90, 80);

/// When what is written now was begun, in egui's seconds.
#[derive(Debug, Default)]
pub struct Badges {
    recording_s: Option<f64>,
    camera_s: Option<f64>,
    between_s: Option<f64>,
}

/// What takes less time needs no word.
const UNNOTICED_S: f64 = 0.06;

impl Badges {
    /// Draws them at the top right of the picture.
    pub fn show(&mut self, ctx: &Context, state: &State) {
        let now_s = ctx.input(|input| input.time);
        let text = |name: &str, is_on: bool, since_s: &mut Option<f64>| {
            *since_s = is_on.then(|| since_s.unwrap_or(now_s));
            since_s.map(|since_s| format!("{} {}", tr(name), elapsed(now_s - since_s)))
        };
        let recording = text("Recording", state.recording().is_some(), &mut self.recording_s);
        let sized = |text| match state.recorded_bytes {
            Some(bytes) => format!("{text}, {}", size(bytes)),
            None => text,
        };
        self.between_s = state.between.then(|| self.between_s.unwrap_or(now_s));
        let is_late = self.between_s.is_some_and(|since_s| now_s - since_s >= UNNOTICED_S);
        if state.between && !is_late {
            ctx.request_repaint_after(Duration::from_secs_f64(UNNOTICED_S));
        }
        let all = [
            (recording.map(sized), LIVE),
            (text("Virtual camera", state.virtual_camera().is_some(), &mut self.camera_s), LIVE),
            (state.off.then(|| tr("Off: a still card is shown").to_owned()), ON_PICTURE),
            (frozen(state).map(|text| tr(text).to_owned()), ON_PICTURE),
            (is_late.then(|| tr("Working…").to_owned()), ON_PICTURE),
        ];
        if self.recording_s.or(self.camera_s).is_some() {
            ctx.request_repaint_after(Duration::from_secs(1));
        }
        let painter = ctx.layer_painter(LayerId::new(Order::Middle, Id::unique("badges")));
        // Beside the panel, or the button that brings it back.
        let beside = if state.panel || state.bare { 0.0 } else { icons::SIDE + 14.0 };
        let mut corner = room(ctx).right_top() + vec2(-GAP - beside, GAP);
        for (text, color) in all.into_iter().filter_map(|(text, color)| Some((text?, color))) {
            corner.y += label(&painter, corner, Align2::RIGHT_TOP, &text, Some(color)).height() + 6.0;
        }
    }
}

/// That the picture stays, and what does not.
fn frozen(state: &State) -> Option<&'static str> {
    let text = match (state.can_pause(), state.outputs.is_empty()) {
        (true, _) => "Paused",
        (false, true) => "Frozen",
        (false, false) => "Frozen here, live outside",
    };
    state.frozen.then_some(text)
}

/// A size as one says it.
fn size(bytes: u64) -> String {
    let (kb, mb) = (bytes as f64 / 1e3, bytes as f64 / 1e6);
    if mb >= 1e3 {
        format!("{:.2} GB", mb / 1e3)
    } else if mb >= 1.0 {
        format!("{mb:.1} MB")
    } else {
        format!("{kb:.0} kB")
    }
}

/// Minutes and seconds, after an hour with hours.
fn elapsed(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}
