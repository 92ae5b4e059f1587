//! The playback bar of a recording: pause, step and a seek slider.

use egui::{Area, Context, Id, Margin, Order, Slider, pos2};

use super::cards;
use super::dock::picture_area;
use super::icons::{self, Icon};
use super::state::{Action, Source, State};
use super::theme::GAP;
use crate::texts::tr_with;

const HEIGHT: f32 = 44.0;
/// Minimum width that shows the time beside the slider, in points.
const MIN_TIME_WIDTH: f32 = 330.0;

/// Minimum width for the slider, in points: below, the bar is hidden.
const MIN_WIDTH: f32 = 200.0;

/// State of the bar between frames.
#[derive(Debug, Default)]
pub struct TransportBar {
    /// Whether playback resumes when the slider is released.
    resumes_playback: bool,
}

impl TransportBar {
    /// Draws the bar at the bottom of the picture's area if the source is a recording. Returns its height with the gap.
    pub fn show(&mut self, ctx: &Context, state: &State, actions: &mut Vec<Action>) -> f32 {
        let running = matches!(state.source, Source::Running(_));
        let Some(transport) = state.transport.filter(|_| running) else { return 0.0 };
        let area = picture_area(ctx);
        let (left, width) = (area.left() + GAP, area.width() - 2.0 * GAP);
        if width < MIN_WIDTH {
            return 0.0;
        }
        let corner = pos2(left, area.bottom() - GAP - HEIGHT);
        let area = Area::new(Id::unique("transport")).fixed_pos(corner).order(Order::Middle);
        cards::show(ctx, area, width, Margin::symmetric(8, 4), |ui, _| {
            ui.set_width(width - 16.0);
            ui.set_height(HEIGHT - 8.0);
            ui.horizontal_centered(|ui| {
                ui.spacing_mut().item_spacing.x = 4.0;
                let (play, hint) = match (state.frozen, state.can_pause()) {
                    (true, _) => (Icon::Play, "Play (Z)"),
                    (false, true) => (Icon::Pause, "Pause (Z)"),
                    (false, false) => (Icon::Pause, "Freeze the window; outputs go on (Z)"),
                };
                let buttons = [
                    (Icon::Back, "One frame back (Page Up)", Action::Step(-1)),
                    (play, hint, Action::Freeze(!state.frozen)),
                    (Icon::Forward, "One frame forward (Page Down)", Action::Step(1)),
                ];
                for (icon, hint, action) in buttons {
                    if icons::add_button(ui, icon, hint, true) {
                        actions.push(action);
                    }
                }
                let times = format!("{} / {}", format_time(transport.time_ns), format_time(transport.length_ns));
                let frame = tr_with("Frame {} of {}", &[&(transport.frame + 1), &transport.frames]);
                let shows_time = width >= MIN_TIME_WIDTH;
                let text = egui::RichText::new(if shows_time { &times } else { "" }).monospace().size(12.5);
                let label = ui.label(text).on_hover_text(&frame);
                ui.spacing_mut().slider_width = (ui.available_width() - 6.0).max(20.0);
                let mut place = transport.frame;
                let line = Slider::new(&mut place, 0..=transport.frames.saturating_sub(1)).show_value(false);
                let line = ui.add(line).labelled_by(label.id);
                let is_moved = line.changed();
                // Pauses during the drag, so that playback does not move the slider.
                if line.drag_started() && !state.frozen && state.can_pause() {
                    self.resumes_playback = true;
                    actions.push(Action::Freeze(true));
                }
                if is_moved {
                    actions.push(Action::Seek(place));
                }
                if line.drag_stopped() && std::mem::take(&mut self.resumes_playback) {
                    actions.push(Action::Freeze(false));
                }
                line.on_hover_text_at_pointer(&frame);
            });
        });
        HEIGHT + 6.0
    }
}

/// Formats a time as minutes, seconds and hundredths.
fn format_time(ns: u64) -> String {
    let hundredths = ns / 10_000_000;
    format!("{}:{:02}.{:02}", hundredths / 6000, hundredths / 100 % 60, hundredths % 100)
}
