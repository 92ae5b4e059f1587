//! The blur strength: as an amount, or by lens parameters.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, Tooltip, add_choice, add_dropdown, add_remark};
use crate::state::tweak::{
    DEFAULT_LENS, F_NUMBER_RANGE, coc_fraction, f_number_for_coc, lens_coc_fraction, lens_for_look,
};
use crate::texts::{format_number, tr, tr_with};
use bokehcam::look::{MAX_COC_PER_HEIGHT, Privacy, SmallBlur, Strength};
use bokehcam::optics::Lens;

/// The two modes; the value is whether lens parameters are used.
const MODES: [(&str, &str, bool); 2] = [
    ("Amount", "Blur as a share of the picture, the same at every distance of focus", false),
    ("Lens", "What a real lens does: its f-number and focal length", true),
];

const PRIVACY: [(Privacy, &str); 3] = [(Privacy::Auto, "Auto: in calls"), (Privacy::On, "On"), (Privacy::Off, "Off")];
/// Shown while privacy makes the blur larger than it is set.
const RAISED: &str = "For privacy, the blur is 1.1 % of the height";
/// Shown while a call gets a blur that is too small for privacy.
const TOO_SMALL: &str = "The call could make out what is behind: so little blur can be undone, from 1.2 % on it cannot";

/// Adds the mode and its parameters, and privacy.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let follows_depth = form.follows_depth();
    let by_lens = matches!(form.look.strength, Strength::Lens(_));
    if (follows_depth || by_lens) && !form.state.lacks_metres() {
        let chosen = add_choice(ui, "Blur by", &MODES, by_lens, |by_lens| !by_lens || follows_depth);
        let focus_m = form.state.focus_distance_m();
        match (chosen, form.look.strength) {
            (Some(true), _) => form.look.strength = Strength::Lens(lens_for_look(&form.look, focus_m, form.size)),
            (Some(false), Strength::Lens(lens)) => {
                form.look.strength = Strength::from_fraction(lens_coc_fraction(lens, focus_m, form.size));
            }
            _ => {}
        }
        form.stroke = chosen.map(|_| "blur by").or(form.stroke);
    }
    match form.look.strength {
        Strength::Lens(lens) => lens_numbers(ui, form, lens),
        Strength::Default | Strength::AtInfinity(_) | Strength::Percent(_) => amount_number(ui, form),
    }
    privacy(ui, form);
}

/// Adds the list for privacy, with a remark on a blur that is too small for it.
fn privacy(ui: &mut Ui, form: &mut PanelForm) {
    let hint = "What is behind cannot be made out again by any filter: its detail is gone, and not only blurred";
    ui.label(tr("Privacy")).tooltip(hint);
    let name = |chosen: Privacy| PRIVACY.iter().find(|(of, _)| *of == chosen).map_or("", |(_, name)| tr(name));
    let all = PRIVACY.map(|(privacy, name)| (tr(name).to_owned(), "", privacy));
    if let Some(chosen) = add_dropdown(ui, "Privacy", name(form.look.privacy), all, &form.look.privacy) {
        form.look.privacy = chosen;
        form.stroke = Some("privacy");
    }
    match form.state.small_blur() {
        Some(SmallBlur { is_raised: true, .. }) => add_remark(ui, RAISED),
        Some(SmallBlur { is_raised: false, .. }) => add_remark(ui, TOO_SMALL),
        None => {}
    }
}

/// Adds the strength as a percentage, with a comparable lens.
fn amount_number(ui: &mut Ui, form: &mut PanelForm) {
    let Some(fraction) = coc_fraction(&form.look, form.size.1) else { return };
    let hint = "Radius of a far light, relative to the picture's height. The wheel over the picture does the same";
    let how = Number::new("Amount of blur", hint, 0.0..=MAX_COC_PER_HEIGHT * 100.0, 1).with_affixes("", " %");
    form.add_number(ui, &how, fraction * 100.0, |look, percent| look.strength = Strength::Percent(percent));
    if form.follows_depth() && form.state.focus_m.is_some() && !form.state.lacks_metres() {
        add_remark(ui, &equivalent_lens(form));
    }
}

/// Returns a text with the f-number at which [`DEFAULT_LENS`] would blur equally at the current focus distance.
fn equivalent_lens(form: &PanelForm) -> String {
    let fraction = coc_fraction(&form.look, form.size.1).unwrap_or_default();
    let (f_number, focal_mm) =
        (f_number_for_coc(fraction, form.state.focus_distance_m(), form.size), DEFAULT_LENS.focal_length_mm);
    if f_number.is_finite() && f_number < 64.0 {
        tr_with("Like {} mm at f/{} on full frame", &[&format!("{focal_mm:.0}"), &format_number(f_number, 1)])
    } else {
        "No visible blur".to_owned()
    }
}

/// Adds the lens parameters.
fn lens_numbers(ui: &mut Ui, form: &mut PanelForm, lens: Lens) {
    let how = Number::new("Aperture", "f-number: smaller means more blur", F_NUMBER_RANGE, 1)
        .with_affixes("f/", "")
        .logarithmic();
    form.add_number(ui, &how, lens.f_number, |look, f_number| {
        look.strength = Strength::Lens(Lens { f_number, ..lens })
    });
    let how =
        Number::new("Focal length", "Longer means more blur", 14.0..=200.0, 0).with_affixes("", " mm").logarithmic();
    form.add_number(ui, &how, lens.focal_length_mm, |look, focal_length_mm| {
        look.strength = Strength::Lens(Lens { focal_length_mm, ..lens });
    });
    let hint = "36 mm is full frame; smaller means more blur";
    let how = Number::new("Sensor width", hint, 4.0..=54.0, 1).with_affixes("", " mm").logarithmic();
    form.add_number(ui, &how, lens.sensor_width_mm, |look, sensor_width_mm| {
        look.strength = Strength::Lens(Lens { sensor_width_mm, ..lens });
    });
}
