//! How strong the blur is: by amount, or by the numbers of a lens.

use egui::Ui;

use super::Sheet;
use crate::look::{Look, MAX_COC_PER_HEIGHT, Strength};
use crate::optics::Lens;
use crate::preview::panel::parts::{Number, choose, number, remark, switch};
use crate::preview::state::tweak::{F_NUMBERS, LENS, amount, amount_of, f_number_of, lens_of, short};
use crate::preview::texts::tr_with;

const WAYS: [(&str, &str); 2] = [
    ("Amount", "Blur as a share of the picture, the same at every distance of focus"),
    ("Lens", "What a real lens does: its f-number and focal length"),
];

/// The strength.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let by_lens = matches!(sheet.look.strength, Strength::Lens(_));
    if sheet.follows_depth() || by_lens {
        let follows_depth = sheet.follows_depth();
        let chosen = choose(ui, "Blur by", &WAYS, usize::from(by_lens), |index| index == 0 || follows_depth);
        let focus_m = sheet.state.distance_m();
        match (chosen, sheet.look.strength) {
            (Some(1), _) => sheet.look.strength = Strength::Lens(lens_of(&sheet.look, focus_m, sheet.size)),
            (Some(0), Strength::Lens(lens)) => {
                let share = amount_of(lens, focus_m, sheet.size);
                sheet.look.strength = Strength::Percent(short(100.0 * share.min(MAX_COC_PER_HEIGHT)));
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
    let mut percent = share * 100.0;
    let how = Number {
        label: "Amount of blur",
        hint: "Radius of a far light, as a share of the picture's height. The wheel over the picture does the same",
        range: 0.0..=MAX_COC_PER_HEIGHT * 100.0,
        ratios: false,
        digits: 1,
        around: ["", " %"],
    };
    if number(ui, how, &mut percent) {
        sheet.look.strength = Strength::Percent(percent);
        sheet.changed(true, "amount");
    }
    if sheet.follows_depth() && sheet.state.focus_m.is_some() {
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
fn lens_numbers(ui: &mut Ui, sheet: &mut Sheet, mut lens: Lens) {
    let number_of = |label, hint, range, digits, around| Number { label, hint, range, ratios: true, digits, around };
    let f = number_of("Aperture", "f-number: smaller is more blur", F_NUMBERS, 1, ["f/", ""]);
    let focal = number_of("Focal length", "Longer is more blur", 14.0..=200.0, 0, ["", " mm"]);
    let sensor = number_of("Sensor width", "36 mm is full frame; smaller is more blur", 4.0..=54.0, 1, ["", " mm"]);
    let f_changed = number(ui, f, &mut lens.f_number);
    let focal_changed = number(ui, focal, &mut lens.focal_length_mm);
    let sensor_changed = number(ui, sensor, &mut lens.sensor_width_mm);
    if f_changed || focal_changed || sensor_changed {
        sheet.look.strength = Strength::Lens(lens);
    }
    sheet.changed(f_changed, "f-number");
    sheet.changed(focal_changed, "focal length");
    sheet.changed(sensor_changed, "sensor width");
}

/// The largest radius, where the person sets one: without any, near objects would blur without bound.
pub fn limit(ui: &mut Ui, sheet: &mut Sheet) {
    let height_px = sheet.size.1 as f32;
    let has_limit = sheet.look.max_coc_px.is_some();
    if switch(ui, "Own limit", "Largest blur of anything, near or far; otherwise 6 % of the height", has_limit) {
        let Look { max_coc_px, .. } = &mut sheet.look;
        *max_coc_px = if has_limit { None } else { Some((MAX_COC_PER_HEIGHT * height_px).round()) };
        sheet.changed(true, "own limit");
    }
    if let Some(limit_px) = sheet.look.max_coc_px {
        let mut percent = limit_px / height_px * 100.0;
        let how = Number {
            label: "Largest blur",
            hint: "Radius, as a share of the picture's height",
            range: 0.0..=15.0,
            ratios: false,
            digits: 1,
            around: ["", " %"],
        };
        if number(ui, how, &mut percent) {
            sheet.look.max_coc_px = Some(percent / 100.0 * height_px);
            sheet.changed(true, "limit");
        }
    }
}
