//! The question whether the window shall close while something is recorded.

use egui::{Checkbox, Context, Id, Label, Modal, RichText};

use super::state::{Action, State};
use super::theme::{Colors, card, medium};
use crate::preview::texts::tr;

/// Draws it over everything, with the focus on what loses nothing. Esc and the keys that close are among the keys.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let ticked = Id::unique("closing never asks");
    if !state.closing {
        ctx.data_mut(|data| data.remove::<bool>(ticked));
        return;
    }
    let frame = card(&Colors::of(ctx.theme()));
    let asked = Modal::new(Id::unique("closing")).frame(frame).show(ctx, |ui| {
        ui.label(RichText::new(tr("Stop recording and close?")).family(medium()).size(16.0));
        let text = "The recording is completed first: what is in it so far is kept.";
        ui.add(Label::new(tr(text)).wrap());
        let mut never = ctx.data(|data| data.get_temp(ticked)).unwrap_or(false);
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            let keep = ui.button(tr("Keep recording")).on_hover_text(tr("Esc"));
            if ctx.memory(|memory| memory.focused().is_none()) {
                keep.request_focus();
            }
            if keep.clicked() {
                actions.push(Action::StayOpen);
            }
            if ui.button(tr("Stop and close")).on_hover_text(tr("Q again")).clicked() {
                // Only who closes has decided.
                actions.extend([Action::AskBeforeClosing(!never), Action::Close]);
            }
        });
        if ui.add(Checkbox::new(&mut never, tr("Do not ask again"))).changed() {
            ctx.data_mut(|data| data.insert_temp(ticked, never));
        }
    });
    if asked.backdrop_response.clicked() {
        actions.push(Action::StayOpen);
    }
}
