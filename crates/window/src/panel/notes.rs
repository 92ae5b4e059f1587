//! Messages: notes that fade, failures of outputs, and why a source gives no frames.

use std::time::Duration;

use egui::{Context, Id};

use super::cards::Stack;
use super::plate;
use super::state::{Action, Source, State};
use super::theme::GAP;
use super::timer::Timer;
use crate::texts::tr_with;

/// A note is shown for this long, plus some time per letter to read it.
const SHOWN_S: f64 = 3.5;
const PER_LETTER_S: f64 = 0.05;
/// Of that time, it fades during the last part.
const FADES_S: f64 = 0.4;
/// The most notes that are shown at once.
const MOST: usize = 3;
/// What the source is when it is no camera and no recording.
const DEMONSTRATION: [&str; 2] = [
    "This is a demonstration",
    "No camera is in use. Choose one under “Camera”; `bokehcam doctor` says why there is none.",
];

/// When notes were first shown.
#[derive(Default)]
pub struct Ages {
    /// Number of a note, and the time in egui's seconds.
    seen: Vec<(u64, f64)>,
}

impl Ages {
    /// Draws, upwards from `bottom` points above the bottom of the window: the banner, the
    /// failure of an output, and the notes.
    pub fn show(
        &mut self,
        ctx: &Context,
        state: &State,
        (bottom, timer): (f32, &mut Timer),
        actions: &mut Vec<Action>,
    ) {
        let mut stack = Stack { ctx, bottom: bottom + GAP };
        timer.show(&mut stack, state, actions);
        plate::show(&mut stack, state, actions);
        if state.is_demonstration() && !state.bare && !state.knows_demonstration {
            stack.ask("demonstration", 460.0, DEMONSTRATION, [("OK", "Esc", Action::KnowDemonstration)], actions);
        }
        banner(&mut stack, state, actions);
        if let Some(why) = &state.trouble {
            let [title, why] = trouble(why);
            stack.ask("trouble", 460.0, [title, why], [("OK", "Esc", Action::Dismiss)], actions);
        }
        plate::offer(&mut stack, state, actions);
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
            stack.tell(Id::unique(("note", place)), 460.0, opacity, text);
        }
    }
}

/// What is said of an output that failed: a title, and what became of it.
fn trouble(why: &str) -> [&str; 2] {
    let is_full = why.contains("No space left on device");
    let kept = why.split_once("; ").map_or(why, |(_, kept)| kept);
    if is_full { ["The disk is full: the recording has ended", kept] } else { ["What was written has ended", why] }
}

/// Draws why the source gives no frames and a button to try again, clear of the picture's middle.
fn banner(stack: &mut Stack, state: &State, actions: &mut Vec<Action>) {
    let silent;
    let (title, why, button) = match (&state.source, state.silent_s) {
        (Source::Running(_), None) => return,
        (Source::Running(running), Some(silent_s)) => {
            silent =
                tr_with("{}: nothing for {} s. It goes on by itself once frames come.", &[&running.label, &silent_s]);
            ("No picture", silent.as_str(), Some("Try again"))
        }
        (Source::Opening, _) => ("Opening…", "", None),
        (Source::Lost(why), _) => ("No picture", why.as_str(), Some("Try again")),
        (Source::Ended, _) => ("The end", "The recording is over.", Some("Play again")),
    };
    stack.ask("banner", 360.0, [title, why], button.map(|text| (text, "F5", Action::Retry)), actions);
}
