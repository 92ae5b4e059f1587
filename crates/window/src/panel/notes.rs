//! Messages: notes that fade, failures of outputs, and the reason why a source delivers no frames.

use std::time::Duration;

use egui::{Context, Id};

use super::cards::CardStack;
use super::plate;
use super::state::{Action, Source, State};
use super::theme::GAP;
use super::timer::SelfTimer;
use crate::texts::tr_with;

/// Time a note is shown, plus reading time per character, in seconds.
const SHOWN_S: f64 = 3.5;
const PER_CHARACTER_S: f64 = 0.05;
/// Fade-out at the end of that time, in seconds.
const FADE_S: f64 = 0.4;
/// Maximum number of notes shown at once; above a card only the last one is.
const MAX_SHOWN: usize = 3;
/// Title for the demonstration source, and texts: it was chosen, or is shown for want of a camera.
const DEMONSTRATION: &str = "This is a demonstration";
const DEMONSTRATION_CHOSEN: &str =
    "No camera is in use. Choose one in the list “Camera”; if there is none, `bokehcam doctor` says why.";
const DEMONSTRATION_AS_FALLBACK: &str =
    "No camera was found. One that you connect is used at once; `bokehcam doctor` says why there is none.";

/// First display times of the notes.
#[derive(Default)]
pub struct NoteTimes {
    /// Number of a note, and its first display time in egui's seconds.
    seen: Vec<(u64, f64)>,
}

impl NoteTimes {
    /// Draws the banner, output failures, and notes, stacked from `bottom` points above the window's bottom upwards.
    pub fn show(
        &mut self,
        ctx: &Context,
        state: &State,
        (bottom, timer): (f32, &mut SelfTimer),
        actions: &mut Vec<Action>,
    ) {
        let mut stack = CardStack { ctx, bottom: bottom + GAP };
        timer.show(&mut stack, state, actions);
        plate::show(&mut stack, state, actions);
        if state.is_demonstration() && !state.controls_hidden && !state.demonstration_dismissed {
            let buttons = [("OK", "Esc", Action::DismissDemonstration)];
            let why = if state.camera.is_fallback { DEMONSTRATION_AS_FALLBACK } else { DEMONSTRATION_CHOSEN };
            stack.add_buttons("demonstration", 460.0, [DEMONSTRATION, why], buttons, actions);
        }
        add_drop_question(&mut stack, state, actions);
        add_banner(&mut stack, state, actions);
        if let Some(why) = &state.output_failure {
            let [title, why] = failure_texts(why);
            stack.add_buttons("trouble", 460.0, [title, why], [("OK", "Esc", Action::DismissFailure)], actions);
        }
        plate::show_offer(&mut stack, state, actions);
        let now_s = ctx.input(|input| input.time);
        self.seen.retain(|(number, _)| state.notes.iter().any(|note| note.number == *number));
        for note in &state.notes {
            if !self.seen.iter().any(|(number, _)| *number == note.number) {
                self.seen.push((note.number, now_s));
            }
        }
        // Time until the next visible change: the start of a fade, or its next step.
        let mut next_s = f64::INFINITY;
        let shown: Vec<(&str, f32)> = state
            .notes
            .iter()
            .filter_map(|note| {
                let first_s = self.seen.iter().find(|(number, _)| *number == note.number)?.1;
                let left_s = first_s + SHOWN_S + PER_CHARACTER_S * note.text.chars().count() as f64 - now_s;
                if left_s <= 0.0 {
                    return None;
                }
                next_s = next_s.min(if left_s > FADE_S { left_s - FADE_S } else { 1.0 / 20.0 });
                Some((note.text.as_str(), (left_s / FADE_S).min(1.0) as f32))
            })
            .collect();
        if next_s.is_finite() {
            ctx.request_repaint_after(Duration::from_secs_f64(next_s + 0.005));
        }
        let max_shown = if stack.bottom > bottom + GAP { 1 } else { MAX_SHOWN };
        for (&(text, opacity), place) in shown.iter().rev().take(max_shown).zip(0..) {
            stack.add_text(Id::unique(("note", place)), 460.0, opacity, text);
        }
    }
}

/// Asks what a dropped file is for, if opening it would replace a camera or what others see.
fn add_drop_question(stack: &mut CardStack, state: &State, actions: &mut Vec<Action>) {
    let Some(name) = state.asked_file() else { return };
    let title = tr_with("What is {} for?", &[&name.trim_end_matches('/').rsplit('/').next().unwrap_or(name)]);
    let why = "Opening it replaces the picture that is shown now, also in calls.";
    let background = ("Use as background", "It replaces what is behind you", Action::UseDroppedAsBackground);
    let buttons = state.asked_background().map(|_| background).into_iter().chain([
        ("Open instead", "What is shown now is closed", Action::OpenDropped),
        ("Cancel", "Esc", Action::DismissDropped),
    ]);
    stack.add_buttons("dropped", 460.0, [&title, why], buttons, actions);
}

/// Returns the title and text for an output failure.
fn failure_texts(why: &str) -> [&str; 2] {
    let is_full = why.contains("No space left on device");
    let kept = why.split_once("; ").map_or(why, |(_, kept)| kept);
    if is_full { ["The disk is full: the recording has ended", kept] } else { ["An output has ended", why] }
}

/// Draws the reason why the source delivers no frames with a retry button, at the bottom so as not to cover the
/// picture's middle.
fn add_banner(stack: &mut CardStack, state: &State, actions: &mut Vec<Action>) {
    let silent;
    let (title, why, button) = match (&state.source, state.silent_s) {
        (Source::Running(_), None) => return,
        (Source::Running(_), Some(silent_s)) => {
            silent = tr_with(
                "{}: no frames for {} s. It continues by itself once frames arrive.",
                &[&state.title(), &silent_s],
            );
            ("No picture", silent.as_str(), Some("Try again"))
        }
        (Source::Opening, _) => ("Opening…", "", None),
        (Source::Lost(why), _) => ("No picture", why.as_str(), Some("Try again")),
        (Source::Ended, _) => ("The end", "The recording is over.", Some("Play again")),
    };
    stack.add_buttons("banner", 360.0, [title, why], button.map(|text| (text, "F5", Action::Retry)), actions);
}
