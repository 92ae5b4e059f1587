//! Auto-framing.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_remark, add_switch};
use bokehcam::look::FramingZoom;

/// Default zoom: room to move with little loss of detail.
const DEFAULT_ZOOM: f32 = 1.5;
/// Minimum zoom; below, the crop could hardly move.
const MIN_ZOOM: f32 = 1.1;

/// Adds the switch, and the largest zoom while it is on.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let zoom = form.look.follow.zoom();
    let hint = "Recordings and calls show a part of the picture, with the subject in the middle";
    if add_switch(ui, "Follow the subject", hint, zoom.is_some()) {
        form.look.follow = if zoom.is_some() { FramingZoom::OFF } else { FramingZoom::from_zoom(DEFAULT_ZOOM) };
        form.stroke = Some("follow");
    }
    // `zoom` is from before the click, so the slider appears in the next pass.
    if let Some(zoom) = zoom {
        let how =
            Number::new("Largest zoom", "Largest magnification of the subject", MIN_ZOOM..=FramingZoom::MAX_ZOOM, 1);
        form.add_number(ui, &how.with_affixes("", "×"), zoom, |look, zoom| look.follow = FramingZoom::from_zoom(zoom));
        add_remark(ui, "Recordings and calls show the part in the dashed line; this window shows the whole picture.");
    }
}
