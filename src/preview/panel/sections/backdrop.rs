//! What is behind the subject, and whether the picture follows it.

use egui::{Role, Ui, WidgetInfo};

use super::Sheet;
use crate::depth::backdrop::Behind;
use crate::look::Follow;
use crate::preview::panel::parts::{Hinted, choose, remark, switch};
use crate::preview::texts::tr;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Room,
    Color,
    Picture,
}

const KINDS: [(&str, &str, Kind); 3] = [
    ("Room", "The room, blurred", Kind::Room),
    ("Colour", "One colour, for a page of your own, or for programs that put something in its place", Kind::Color),
    ("Picture", "The picture that --behind image:FILE or a preset names", Kind::Picture),
];
/// The green of screens that are replaced later.
const GREEN: [u8; 3] = [0, 177, 64];
/// Room to move, and little loss of detail.
const ZOOM: f32 = 1.5;

/// What is behind, and whether the picture follows.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let kind = match sheet.look.behind {
        Behind::Blur => Kind::Room,
        Behind::Color(_) => Kind::Color,
        Behind::Picture(_) => Kind::Picture,
    };
    let named = match &sheet.state.first_look.behind {
        Behind::Picture(picture) => Some(Behind::Picture(picture.clone())),
        _ => None,
    };
    let can = |other| other != Kind::Picture || kind == Kind::Picture || named.is_some();
    if let Some(chosen) = choose(ui, "Behind the subject", &KINDS, kind, can).filter(|chosen| *chosen != kind) {
        sheet.look.behind = match chosen {
            Kind::Room => Behind::Blur,
            Kind::Color => Behind::Color(GREEN),
            Kind::Picture => named.unwrap_or_default(),
        };
        sheet.changed(true, "behind");
    }
    if let Behind::Color(mut color) = sheet.look.behind {
        ui.horizontal(|ui| {
            ui.label(tr("Colour"));
            let picker = ui.color_edit_button_srgb(&mut color);
            picker.widget_info(|| WidgetInfo::labeled(Role::ColorWell, true, tr("Colour")));
            if picker.hint("Another colour").changed() {
                sheet.look.behind = Behind::Color(color);
                sheet.changed(true, "colour behind");
            }
        });
    }
    let follows = sheet.look.follow.zoom().is_some();
    if switch(
        ui,
        "Follow the subject",
        "What goes out is a part of the picture, with the subject in its middle",
        follows,
    ) {
        sheet.look.follow = if follows { Follow::OFF } else { Follow::to(ZOOM) };
        sheet.changed(true, "follow");
    }
    if follows {
        remark(ui, "In what goes out; this window shows the whole picture.");
    }
}
