//! A look as settings of the command line: those that give exactly this look.

use super::{ApertureName, Look, Refine, Strength};
use crate::bokeh::aperture::Shape;
use crate::bokeh::{Effect, Method};
use crate::budget::Quality;
use crate::depth::focus::FocusRule;
use crate::optics::CocField;

/// The settings that a look is made of, by their flags without the dashes. Nothing else can be in a preset.
pub const NAMES: [&str; 17] = [
    "effect",
    "method",
    "focus",
    "focus-range",
    "coc-at-infinity",
    "f-number",
    "focal-length",
    "sensor-width",
    "max-coc",
    "refine",
    "tilt",
    "aperture",
    "intensity",
    "rim",
    "rank",
    "highlights",
    "quality",
];

/// A setting and its value, as they follow the dashes.
pub type Flag = (&'static str, String);

impl Look {
    /// The settings that differ from the defaults: with no others, they give this look for a source with depth.
    /// Numbers are as short as they can be and give the same value back.
    pub fn flags(&self) -> Vec<Flag> {
        self.flags_beside(&Look::plain(Some(Effect::Dof)))
    }

    /// The settings that make this look of `other`.
    pub fn flags_beside(&self, other: &Look) -> Vec<Flag> {
        let there = other.every_flag();
        self.every_flag().into_iter().filter(|flag| !there.contains(flag)).collect()
    }

    /// All settings, so that the look depends on no other, in the order of [`NAMES`]. The effect `dof` is `auto`, which
    /// it is where there is depth; elsewhere a look without depth takes its place. A picture of an aperture whose file is
    /// not known has no setting.
    pub fn every_flag(&self) -> Vec<Flag> {
        let effect = match self.effect {
            None => "none",
            Some(Effect::Blur) => "blur",
            Some(Effect::TiltShift) => "tilt-shift",
            Some(Effect::Dof) => "auto",
        };
        let method = match self.method {
            Method::Layered => "layered",
            Method::Gather => "gather",
        };
        let refine = match self.refine {
            Refine::Auto => "auto",
            Refine::On => "on",
            Refine::Off => "off",
        };
        let aperture = match (&self.aperture_file, &self.aperture.shape) {
            (Some(file), _) => Some(ApertureName::Image(file.clone())),
            (None, Shape::Picture(_)) => None,
            (None, shape) => Some(ApertureName::Drawn(shape.clone())),
        };
        let mut flags = vec![
            ("effect", effect.to_string()),
            ("method", method.to_string()),
            ("focus", self.focus.to_string()),
            ("focus-range", self.focus_range_m.to_string()),
        ];
        match self.strength {
            Strength::Lens(lens) => flags.extend([
                ("f-number", lens.f_number.to_string()),
                ("focal-length", lens.focal_length_mm.to_string()),
                ("sensor-width", lens.sensor_width_mm.to_string()),
            ]),
            strength => flags.push(("coc-at-infinity", strength.to_string())),
        }
        flags.extend([("max-coc", or_auto(self.max_coc_px)), ("refine", refine.to_string())]);
        flags.push(("tilt", self.tilt.to_string()));
        flags.extend(aperture.map(|name| ("aperture", name.to_string())));
        flags.extend([
            ("intensity", self.aperture.intensity.to_string()),
            ("rim", self.rim.to_string()),
            ("rank", or_auto(self.rank)),
            ("highlights", self.highlights.to_string()),
            ("quality", or_auto(self.quality)),
        ]);
        flags
    }
}

impl Look {
    /// All settings of one frame, as it was blurred: those that give the same picture of the same colours and depth.
    /// `coc` is the frame's, which knows where the focus was, and `quality` its rung, if it was blurred.
    pub fn flags_of_frame(&self, coc: &CocField, quality: Option<Quality>) -> Vec<Flag> {
        let focus = match coc {
            CocField::Depth(lens) => FocusRule::Metres(lens.focus_m),
            CocField::Uniform { .. } | CocField::Ramp(_) => self.focus,
        };
        let mut flags = Look { focus, quality: quality.or(self.quality), ..self.clone() }.every_flag();
        if self.effect == Some(Effect::Dof) {
            // Without its depth it cannot be repeated.
            flags.iter_mut().filter(|(name, _)| *name == "effect").for_each(|(_, value)| *value = "dof".to_string());
        }
        flags
    }
}

fn or_auto(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "auto".to_string(), |value| value.to_string())
}
