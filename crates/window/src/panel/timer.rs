//! The self-timer: a countdown to a snapshot, below the picture's middle so as not to cover the face.

use egui::RichText;

use super::cards::CardStack;
use super::state::{Action, State};
use super::theme::medium_font;

/// Delay of the snapshot, in seconds.
const DELAY_S: f64 = 3.0;

/// Due time of the snapshot, in egui's seconds.
#[derive(Debug, Default)]
pub struct SelfTimer {
    due_s: Option<f64>,
}

impl SelfTimer {
    /// Draws the remaining seconds, and triggers the snapshot at 0.
    pub fn show(&mut self, stack: &mut CardStack, state: &State, actions: &mut Vec<Action>) {
        let ctx = stack.ctx;
        let now_s = ctx.input(|input| input.time);
        self.due_s = state.self_timer.then(|| self.due_s.unwrap_or(now_s + DELAY_S));
        let Some(left_s) = self.due_s.map(|due_s| due_s - now_s) else { return };
        if left_s <= 0.0 {
            self.due_s = None;
            actions.extend([Action::SelfTimer(false), Action::Snapshot]);
            return;
        }
        ctx.request_repaint_after_secs((left_s.fract() + 0.005) as f32);
        stack.add_card("self-timer", 200.0, |ui, _| {
            ui.label(RichText::new(left_s.ceil().to_string()).family(medium_font()).size(40.0));
        });
    }
}
