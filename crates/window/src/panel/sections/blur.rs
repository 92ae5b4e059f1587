//! How strong the blur is: by amount, or by the numbers of a lens.

use egui::Ui;

use super::Sheet;
use crate::panel::parts::{Number, choose, remark};
use crate::state::tweak::{F_NUMBERS, LENS, amount, amount_of, f_number_of, lens_of};
use crate::texts::tr_with;
use bokehcam::look::{MAX_COC_PER_HEIGHT, Strength};
use bokehcam::optics::Lens;

/// Whether it is by the numbers of a lens.
const WAYS: [(&str, &str, bool); 2] = [
    ("Amount", "Blur as a share of the picture, the same at every distance of focus", false),
    ("Lens", "What a real lens does: its f-number and focal length", true),
];

/// The strength.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let follows_depth = sheet.follows_depth();
    let by_lens = matches!(sheet.look.strength, Strength::Lens(_));
    if (follows_depth || by_lens) && !sheet.is_relative() {
        let chosen = choose(ui, "Blur by", &WAYS, by_lens, |by_lens| !by_lens || follows_depth);
        let focus_m = sheet.state.distance_m();
        match (chosen, sheet.look.strength) {
            (Some(true), _) => sheet.look.strength = Strength::Lens(lens_of(&sheet.look, focus_m, sheet.size)),
            (Some(false), Strength::Lens(lens)) => {
                sheet.look.strength = Strength::of_share(amount_of(lens, focus_m, sheet.size));
            }
            _ => {}
        }
        sheet.changed(chosen.is_some(), "blur by");
    }
    match sheet.look.strength {
        Strength::Lens(lens) => lens_numbers(ui, sheet, lens),
        Strength::Default | Strength::AtInfinity(_) | Strength::Percent(_) => by_amount(ui, sheet),
    }
}

/// The strength as a radius, with a lens to compare it with.
fn by_amount(ui: &mut Ui, sheet: &mut Sheet) {
    let Some(share) = amount(&sheet.look, sheet.size.1) else { return };
    let hint = "Radius of a far light, as a share of the picture's height. The wheel over the picture does the same";
    let how = Number::new("Amount of blur", hint, 0.0..=MAX_COC_PER_HEIGHT * 100.0, 1).unit("", " %");
    sheet.number(ui, &how, share * 100.0, |look, percent| look.strength = Strength::Percent(percent));
    if sheet.follows_depth() && sheet.state.focus_m.is_some() && !sheet.is_relative() {
        remark(ui, &like_lens(sheet));
    }
}

/// Says at which f-number [`LENS`] would blur as much, focused as the last frame was.
fn like_lens(sheet: &Sheet) -> String {
    let share = amount(&sheet.look, sheet.size.1).unwrap_or_default();
    let (f_number, focal_mm) = (f_number_of(share, sheet.state.distance_m(), sheet.size), LENS.focal_length_mm);
    if f_number.is_finite() && f_number < 64.0 {
        tr_with("Like {} mm at f/{} on full frame", &[&format!("{focal_mm:.0}"), &format!("{f_number:.1}")])
    } else {
        "No blur to be seen".to_owned()
    }
}

/// The strength as the numbers of a lens.
fn lens_numbers(ui: &mut Ui, sheet: &mut Sheet, lens: Lens) {
    let how = Number::new("Aperture", "f-number: smaller is more blur", F_NUMBERS, 1).unit("f/", "").ratios();
    sheet.number(ui, &how, lens.f_number, |look, f_number| look.strength = Strength::Lens(Lens { f_number, ..lens }));
    let how = Number::new("Focal length", "Longer is more blur", 14.0..=200.0, 0).unit("", " mm").ratios();
    sheet.number(ui, &how, lens.focal_length_mm, |look, focal_length_mm| {
        look.strength = Strength::Lens(Lens { focal_length_mm, ..lens });
    });
    let hint = "36 mm is full frame; smaller is more blur";
    let how = Number::new("Sensor width", hint, 4.0..=54.0, 1).unit("", " mm").ratios();
    sheet.number(ui, &how, lens.sensor_width_mm, |look, sensor_width_mm| {
        look.strength = Strength::Lens(Lens { sensor_width_mm, ..lens });
    });
}
