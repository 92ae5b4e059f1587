//! Messages: notes that fade, failures of outputs, and why a source gives no frames.

use std::time::Duration;

use egui::{Align2, Area, Context, Id, Label, Order, RichText, Ui, vec2};

use super::plate;
use super::state::{Action, Source, State};
use super::theme::{Colors, GAP, card, medium};
use crate::preview::texts::{tr, tr_with};

/// A note is shown for this long, plus some time per letter to read it.
const SHOWN_S: f64 = 3.5;
const PER_LETTER_S: f64 = 0.05;
/// Of that time, it fades during the last part.
const FADES_S: f64 = 0.4;
/// The most notes that are shown at once.
const MOST: usize = 3;
/// What the source is when it is no camera and no recording.
const DEMONSTRATION: &str = "A demonstration, no camera: bokehcam devices lists them, bokehcam doctor helps.";

/// When notes were first shown.
#[derive(Default)]
pub struct Ages {
    /// Number of a note, and the time in egui's seconds.
    seen: Vec<(u64, f64)>,
}

impl Ages {
    /// Draws, upwards from `bottom` points above the bottom of the window: the banner, the
    /// failure of an output, and the notes.
    pub fn show(&mut self, ctx: &Context, state: &State, mut bottom: f32, actions: &mut Vec<Action>) {
        bottom += GAP + demonstration(ctx, state, bottom);
        bottom += banner(ctx, state, bottom, actions);
        bottom += trouble(ctx, state, bottom, actions);
        bottom += plate::offer(ctx, state, bottom, actions);
        let now_s = ctx.input(|input| input.time);
        self.seen.retain(|(number, _)| state.notes.iter().any(|note| note.number == *number));
        for note in &state.notes {
            if !self.seen.iter().any(|(number, _)| *number == note.number) {
                self.seen.push((note.number, now_s));
            }
        }
        // Time to the next pass that shows a change: the begin of a fade, or a step of it.
        let mut next_s = f64::INFINITY;
        let shown: Vec<(&str, f32)> = state
            .notes
            .iter()
            .filter_map(|note| {
                let first_s = self.seen.iter().find(|(number, _)| *number == note.number)?.1;
                let left_s = first_s + SHOWN_S + PER_LETTER_S * note.text.chars().count() as f64 - now_s;
                if left_s <= 0.0 {
                    return None;
                }
                next_s = next_s.min(if left_s > FADES_S { left_s - FADES_S } else { 1.0 / 20.0 });
                Some((note.text.as_str(), (left_s / FADES_S).min(1.0) as f32))
            })
            .collect();
        if next_s.is_finite() {
            ctx.request_repaint_after(Duration::from_secs_f64(next_s + 0.005));
        }
        for (&(text, opacity), place) in shown.iter().rev().take(MOST).zip(0..) {
            let area = Area::new(Id::unique(("note", place))).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -bottom));
            let drawn = area.order(Order::Foreground).interactable(false).fade_in(false).show(ctx, |ui| {
                ui.set_max_width((ctx.content_rect().width() - 2.0 * GAP).clamp(60.0, 460.0));
                ui.set_opacity(opacity);
                let colors = Colors::here(ui);
                card(&colors).inner_margin(egui::Margin::symmetric(14, 9)).show(ui, |ui| {
                    ui.add(Label::new(RichText::new(tr(text)).color(colors.text)).wrap());
                });
            });
            bottom += drawn.response.rect.height() + 6.0;
        }
    }
}

/// Draws that the source is the demonstration, for as long as it is, `bottom` points above the window's edge. Its height.
fn demonstration(ctx: &Context, state: &State, bottom: f32) -> f32 {
    if !state.is_demonstration() || state.bare {
        return 0.0;
    }
    let area = Area::new(Id::unique("demonstration")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -bottom - GAP));
    let drawn = area.order(Order::Middle).interactable(false).fade_in(false).show(ctx, |ui| {
        ui.set_max_width((ctx.content_rect().width() - 2.0 * GAP).clamp(60.0, 620.0));
        let colors = Colors::here(ui);
        card(&colors).inner_margin(egui::Margin::symmetric(14, 6)).show(ui, |ui| {
            ui.add(Label::new(RichText::new(tr(DEMONSTRATION)).color(colors.text)).wrap());
        });
    });
    drawn.response.rect.height() + 6.0
}

/// Draws why an output failed, `bottom` points above the window's edge, until that is dismissed. Its height.
fn trouble(ctx: &Context, state: &State, bottom: f32, actions: &mut Vec<Action>) -> f32 {
    let Some(why) = &state.trouble else { return 0.0 };
    let area = Area::new(Id::unique("trouble")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -bottom)).order(Order::Middle);
    let drawn = area.fade_in(false).show(ctx, |ui| {
        let colors = Colors::here(ui);
        ui.set_max_width((ctx.content_rect().width() - 2.0 * GAP).clamp(60.0, 460.0));
        card(&colors).show(ui, |ui| {
            ui.label(RichText::new(tr("An output failed")).family(medium()).size(16.0));
            ui.add(Label::new(RichText::new(tr(why)).color(colors.text)).wrap());
            ui.add_space(2.0);
            if ui.button(tr("I see")).clicked() {
                actions.push(Action::Dismiss);
            }
        });
    });
    drawn.response.rect.height() + 6.0
}

/// Draws why the source gives no frames and a button to try again, `bottom` points above the window's edge: clear of the
/// picture's middle. Its height, 0 while frames come.
fn banner(ctx: &Context, state: &State, bottom: f32, actions: &mut Vec<Action>) -> f32 {
    let silent;
    let (title, why, button) = match &state.source {
        Source::Running(running) => {
            let Some(silent_s) = state.silent_s else { return 0.0 };
            silent =
                tr_with("{}: nothing for {} s. It goes on by itself once frames come.", &[&running.label, &silent_s]);
            ("No picture", silent.as_str(), Some("Try again"))
        }
        Source::Opening => ("Opening…", "", None),
        Source::Lost(why) => ("No picture", why.as_str(), Some("Try again")),
        Source::Ended => ("The end", "The recording is over.", Some("Play again")),
    };
    let area = Area::new(Id::unique("banner")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -bottom)).order(Order::Middle);
    let drawn = area.fade_in(false).show(ctx, |ui| {
        let colors = Colors::here(ui);
        ui.set_max_width((ctx.content_rect().width() - 2.0 * GAP).clamp(60.0, 360.0));
        card(&colors).show(ui, |ui| banner_text(ui, &colors, (title, why, button), actions));
    });
    drawn.response.rect.height() + 6.0
}

/// The banner's title, reason and button.
fn banner_text(
    ui: &mut Ui,
    colors: &Colors,
    (title, why, button): (&str, &str, Option<&str>),
    actions: &mut Vec<Action>,
) {
    ui.label(RichText::new(tr(title)).family(medium()).size(16.0));
    if !why.is_empty() {
        ui.add(Label::new(RichText::new(tr(why)).color(colors.text)).wrap());
    }
    if let Some(button) = button {
        ui.add_space(2.0);
        if ui.button(tr(button)).on_hover_text(tr("F5")).clicked() {
            actions.push(Action::Retry);
        }
    }
}
