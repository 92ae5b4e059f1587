//! The settings of a look: one table for the command line, the environment, the settings file, presets, snapshots and
//! the window. [`Look::default`] has their defaults.

use std::ops::RangeInclusive;
use std::str::FromStr;

use super::number::{OrAuto, in_range_parser, parse_non_negative, parse_positive};
use super::{
    ApertureSetting, BackgroundMemory, BackgroundSetting, Effect, FramingZoom, Look, MAX_RADIUS_PX, Privacy, Refine,
    Reuse, Strength, Tilt,
};
use crate::bokeh::{Method, Rank};
use crate::budget::Quality;
use crate::depth::focus::FocusRule;
use crate::names::Named;

/// The valid radial intensities of the aperture.
pub const INTENSITIES: RangeInclusive<f32> = -1.0..=1.0;
/// The valid widths of the soft rim, as fractions of the radius.
pub const RIMS: RangeInclusive<f32> = 0.0..=1.0;
/// The valid factors of highlight recovery.
pub const HIGHLIGHTS: RangeInclusive<f32> = 0.0..=1000.0;

/// The range that [`parse_positive`] accepts.
const ABOVE_ZERO: RangeInclusive<f32> = f32::from_bits(1)..=f32::MAX;

/// A group of settings, with a heading of its own in the help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// The blur as such.
    Blur,
    /// The lens opening.
    Aperture,
    /// The precision of the blur.
    Computing,
}

/// A setting of a look.
pub struct Setting {
    /// Its name: the flag without dashes, and the key in a file.
    pub name: &'static str,
    /// The name of its field in [`Patch`].
    pub id: &'static str,
    /// The placeholder of its value in the help.
    pub value: &'static str,
    /// Its group.
    pub group: Group,
    /// The help text.
    pub help: &'static str,
    /// Its values; empty if they are not enumerated.
    pub choices: fn() -> Vec<Choice>,
    /// The range of its numbers, ends included; `None` if it accepts other values.
    pub range: fn() -> Option<RangeInclusive<f32>>,
    /// Whether its default depends on the picture or the quality level, so that it has no fixed value.
    pub computed: bool,
    pub(super) set: fn(&mut Patch, &str) -> Result<(), String>,
    pub(super) get: fn(&Patch) -> Option<String>,
    pub(super) clear: fn(&mut Patch),
}

macro_rules! settings {
    ($(
        $(#[doc = $help:literal])+
        $field:ident: $type:ty = $name:literal $value:literal $group:ident $parse:expr $(, one of $choices:expr)? $(, in $range:expr)? $(, is $computed:ident)*;
    )+) => {
        /// Some settings of a look, as in a preset, a snapshot, the settings file or flags. `None` leaves a setting
        /// unset.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Patch { $(#[doc = concat!("The setting `", $name, "`.")] pub $field: Option<$type>,)+ }

        /// All settings of a look, in the order of the help. Presets consist of these only.
        pub static SETTINGS: [Setting; [$($name),+].len()] = [$(Setting {
            name: $name,
            id: stringify!($field),
            value: $value,
            group: Group::$group,
            help: concat!($($help),+),
            choices: || <[Vec<Choice>]>::concat(&[$($choices)?]),
            range: || <[RangeInclusive<f32>]>::first(&[$($range)?]).cloned(),
            computed: !<[&str]>::is_empty(&[$(stringify!($computed)),*]),
            set: |patch, text| {
                patch.$field = Some(($parse)(text)?);
                Ok(())
            },
            get: |patch| patch.$field.as_ref().map(ToString::to_string),
            clear: |patch| patch.$field = None,
        }),+];
    };
}

/// A value of a setting.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Its name.
    pub name: &'static str,
    /// What it does.
    pub help: &'static str,
    /// Names of earlier versions that mean this value now.
    pub former_names: &'static [&'static str],
}

/// Returns all values of an enumeration.
fn list_choices<T: Named>() -> Vec<Choice> {
    let choice = |value: &T| Choice { name: value.name(), help: value.help(), former_names: value.former_names() };
    T::VALUES.iter().map(choice).collect()
}

fn list_choices_with_auto<T: Named>() -> Vec<Choice> {
    let auto = Choice { name: "auto", help: "The best for the available time", former_names: &[] };
    [vec![auto], list_choices::<T>()].concat()
}

settings! {
    /// What the blur follows
    effect: Effect = "effect" "WHAT" Blur Effect::from_str, one of list_choices::<Effect>();
    /// How dof is composited
    method: Method = "method" "HOW" Blur Method::from_str, one of list_choices::<Method>();
    /// Distance of the focal plane: METRES (in relative depth a place from 0, the nearest, to 1, the farthest), auto, X,Y
    /// as fractions of width and height, or track:X,Y, the object there at the start
    focus: FocusRule = "focus" "WHERE" Blur FocusRule::from_str;
    /// Range of distances that is completely sharp, in metres, half of it on either side of the focal plane
    focus_range_m: f32 = "focus-range" "METRES" Blur parse_non_negative, in 0.0..=f32::MAX;
    /// Strength of the blur: the radius of a point at infinity, in pixels, or as a share of the height such as 3%
    /// [default: auto, which is height / 45]
    coc_at_infinity: Strength = "blur" "PX" Blur Strength::from_str, is computed;
    /// Strength of the blur by a lens instead: its f-number, with --focal-length and --sensor-width
    f_number: f32 = "f-number" "N" Blur parse_positive, in ABOVE_ZERO, is computed;
    /// Focal length of that lens, in millimetres
    focal_length_mm: f32 = "focal-length" "MM" Blur parse_positive, in ABOVE_ZERO, is computed;
    /// Width of the sensor behind that lens, in millimetres
    sensor_width_mm: f32 = "sensor-width" "MM" Blur parse_positive, in ABOVE_ZERO, is computed;
    /// Largest blur radius, in pixels [default: auto, which is 0.06 x height]
    max_coc_px: OrAuto<f32> = "max-coc" "PX" Blur OrAuto::parser(in_range_parser(0.0..=MAX_RADIUS_PX)), is computed;
    /// Whether depth is fitted to the picture: edges onto colour edges, less noise and flicker
    refine: Refine = "refine" "WHEN" Blur Refine::from_str, one of list_choices::<Refine>();
    /// Background that shows through blurred outlines in a stream
    background_memory: BackgroundMemory = "background-memory" "WHETHER" Blur BackgroundMemory::from_str, one of list_choices::<BackgroundMemory>();
    /// What is behind the subject: blur (the room), color:#RRGGBB, image:FILE, video:FILE (played in a loop) or
    /// transparent (an alpha channel in PNG, WebM and MOV)
    behind: BackgroundSetting = "behind" "WHAT" Blur BackgroundSetting::from_str;
    /// Whether the blur behind cannot be undone: detail is averaged over cells of half its radius
    privacy: Privacy = "privacy" "WHEN" Blur Privacy::from_str, one of list_choices::<Privacy>();
    /// Keep the subject in the middle by showing a part of the picture: the largest zoom, up to 4, or off
    follow: FramingZoom = "follow" "ZOOM" Blur FramingZoom::from_str;
    /// Sharp band of tilt-shift: CENTER_Y[:BAND[:ANGLE_DEG]], the first two as fractions of the height
    tilt: Tilt = "tilt" "BAND" Blur Tilt::from_str;
    /// disc, ring:INNER, polygon:N[:ROTATION_DEG[:CURVATURE]], heart, star:N or image:FILE
    aperture: ApertureSetting = "aperture" "SHAPE" Aperture ApertureSetting::from_str;
    /// Radial intensity: -1 soap bubbles, 0 flat, 1 bright in the middle
    intensity: f32 = "intensity" "I" Aperture in_range_parser(INTENSITIES), in INTENSITIES;
    /// Width of the soft rim, as a fraction of the radius
    rim: f32 = "rim" "W" Aperture in_range_parser(RIMS), in RIMS;
    /// Separable terms, 1 to 16 or full [default: auto, which is the quality level's]
    rank: OrAuto<Rank> = "rank" "TERMS" Aperture OrAuto::from_str, is computed;
    /// Brighten clipped white by this factor; 0 is off
    highlights: f32 = "highlights" "M" Aperture in_range_parser(HIGHLIGHTS), in HIGHLIGHTS;
    /// Quality level: changes fidelity, never the amount of blur. In real time, auto is the best level for the
    /// available time (--budget-ms), up to balanced on the CPU and best on a GPU; otherwise it is balanced
    quality: OrAuto<Quality> = "quality" "LEVEL" Computing OrAuto::from_str, one of list_choices_with_auto::<Quality>();
    /// Whether a stream keeps what hardly changes: noise behind is averaged over time
    reuse: Reuse = "reuse" "WHEN" Computing Reuse::from_str, one of list_choices::<Reuse>();
}

/// Returns the setting with this name or alias; `None` if a look has no such setting.
pub fn find_setting(name: &str) -> Option<&'static Setting> {
    let name = resolve_alias(name);
    SETTINGS.iter().find(|setting| setting.name == name)
}

/// Resolves an alias to the setting's name; returns any other text unchanged.
pub fn resolve_alias(called: &str) -> &str {
    ALIASES.iter().find(|(_, alias)| *alias == called).map_or(called, |(name, _)| name)
}

/// The settings of a lens, which exclude the strength at infinity.
pub(super) const LENS_SETTINGS: [&str; 3] = ["f-number", "focal-length", "sensor-width"];
/// The strength at infinity, which excludes the settings of a lens.
const COC_AT_INFINITY: &str = "blur";
/// Setting names and their aliases, valid wherever settings are written.
const ALIASES: [(&str, &str); 1] = [(COC_AT_INFINITY, "coc-at-infinity")];

impl Setting {
    /// Returns the names of the settings that cannot be combined with this one.
    pub fn excluded_settings(&self) -> &'static [&'static str] {
        match self.name {
            COC_AT_INFINITY => &LENS_SETTINGS,
            name if LENS_SETTINGS.contains(&name) => &[COC_AT_INFINITY],
            _ => &[],
        }
    }

    /// Returns its alias, if any.
    pub fn alias(&self) -> Option<&'static str> {
        ALIASES.iter().find(|(name, _)| *name == self.name).map(|(_, alias)| *alias)
    }

    /// Returns whether it sets the strength of the blur: at infinity or by a lens, which exclude each other.
    pub fn sets_strength(&self) -> bool {
        !self.excluded_settings().is_empty()
    }

    /// Returns its default value; `None` if that is [computed](Setting::computed).
    pub fn default(&self) -> Option<String> {
        (self.get)(&Patch::from_look(&Look::default())).filter(|_| !self.computed)
    }

    /// Removes it from a patch.
    pub fn clear_in(&self, patch: &mut Patch) {
        (self.clear)(patch);
    }

    /// Parses a value into a patch.
    ///
    /// # Errors
    /// The value is invalid: returns what is accepted.
    pub fn parse_into(&self, patch: &mut Patch, text: &str) -> Result<(), String> {
        (self.set)(patch, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_what_is_accepted() {
        let mut ranged = 0;
        for setting in &SETTINGS {
            let accepts = |number: f32| setting.parse_into(&mut Patch::default(), &number.to_string()).is_ok();
            let Some(range) = (setting.range)() else { continue };
            ranged += 1;
            let (low, high) = range.into_inner();
            assert!(accepts(low) && accepts(high), "{}", setting.name);
            assert!(!accepts(low.next_down()) && !accepts(high.next_up()), "{}", setting.name);
        }
        assert_eq!(ranged, 7);
    }
}
