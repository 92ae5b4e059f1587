//! The question whether the window shall close while something is recorded.

use egui::{Checkbox, Context, Id, Key, Label, Modal, RichText};

use super::state::{Action, State};
use super::theme::{Colors, card, medium};
use crate::preview::texts::tr;

/// Draws it over everything. Enter closes the window; Esc is among the keys.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    if !state.closing {
        return;
    }
    let frame = card(&Colors::of(ctx.theme()));
    let asked = Modal::new(Id::unique("closing")).frame(frame).show(ctx, |ui| {
        ui.label(RichText::new(tr("Stop recording and close?")).family(medium()).size(16.0));
        let text = "The recording is completed first: what is in it so far is kept.";
        ui.add(Label::new(tr(text)).wrap());
        let mut never = !state.habits.ask_before_closing;
        if ui.add(Checkbox::new(&mut never, tr("Do not ask again"))).changed() {
            actions.push(Action::AskBeforeClosing(!never));
        }
        ui.add_space(2.0);
        ui.horizontal(|ui| {
            if ui.button(tr("Stop and close")).on_hover_text(tr("Enter, or Q again")).clicked() {
                actions.push(Action::Close);
            }
            if ui.button(tr("Keep recording")).on_hover_text(tr("Esc")).clicked() {
                actions.push(Action::StayOpen);
            }
        });
    });
    if asked.backdrop_response.clicked() {
        actions.push(Action::StayOpen);
    }
    if ctx.memory(|memory| memory.focused().is_none()) && ctx.input(|input| input.key_pressed(Key::Enter)) {
        actions.push(Action::Close);
    }
}
