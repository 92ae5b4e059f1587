//! The settings of a look: one table that the command line, the environment, the settings file, presets, snapshots and
//! the window go by. [`Look::default`] has their defaults.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::number::{OrAuto, above_zero, not_negative, within};
use super::{ApertureName, Effect, Look, MOST_RADIUS_PX, Refine, Strength, Tilt};
use crate::bokeh::{Method, Rank};
use crate::budget::Quality;
use crate::depth::focus::FocusRule;
use crate::names::Named;
use crate::optics::Lens;
use crate::recording::RecordingError;

/// Radial intensity of the aperture that can be chosen.
pub const INTENSITIES: RangeInclusive<f32> = -1.0..=1.0;
/// Soft rims that can be chosen, as fractions of the radius.
pub const RIMS: RangeInclusive<f32> = 0.0..=1.0;
/// Highlight recovery that can be chosen.
pub const HIGHLIGHTS: RangeInclusive<f32> = 0.0..=1000.0;

/// What settings are about: the headings of the help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// What the blur does.
    Blur,
    /// The lens opening.
    Aperture,
    /// How finely the blur is computed.
    Computing,
}

/// A setting.
pub struct Setting {
    /// Its name: its flag without the dashes, its key in a file.
    pub name: &'static str,
    /// The field of [`Patch`] that has it.
    pub id: &'static str,
    /// What stands for its value in the help.
    pub value: &'static str,
    /// What it is about.
    pub group: Group,
    /// What it does.
    pub help: &'static str,
    /// Its values by name, and what each does, where it has but a few.
    pub choices: fn() -> Vec<Choice>,
    /// Whether its default is worked out from the picture or the quality level, and has no value of its own.
    pub computed: bool,
    set: fn(&mut Patch, &str) -> Result<(), String>,
    get: fn(&Patch) -> Option<String>,
    clear: fn(&mut Patch),
}

macro_rules! settings {
    ($(
        $(#[doc = $help:literal])+
        $field:ident: $type:ty = $name:literal $value:literal $group:ident $parse:expr $(, one of $choices:expr)? $(, is $computed:ident)*;
    )+) => {
        /// Some settings of a look: what a preset, a snapshot, the settings file or flags say. `None` says nothing.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Patch { $($(#[doc = $help])+ pub $field: Option<$type>,)+ }

        /// All settings of a look, in the order of the help. Nothing else can be in a preset.
        pub static SETTINGS: [Setting; [$($name),+].len()] = [$(Setting {
            name: $name,
            id: stringify!($field),
            value: $value,
            group: Group::$group,
            help: concat!($($help),+),
            choices: || <[Vec<Choice>]>::concat(&[$($choices)?]),
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

/// A value's name, and what it does.
pub type Choice = (&'static str, &'static str);

fn names_of<T: Named>() -> Vec<Choice> {
    T::VALUES.iter().map(|value| (value.name(), value.help())).collect()
}

fn auto_or<T: Named>() -> Vec<Choice> {
    [vec![("auto", "As the time allows")], names_of::<T>()].concat()
}

settings! {
    /// What the blur follows
    effect: Effect = "effect" "WHAT" Blur Effect::from_str, one of names_of::<Effect>();
    /// How dof is composited
    method: Method = "method" "HOW" Blur Method::from_str, one of names_of::<Method>();
    /// Distance of the focal plane: METRES, auto, or X,Y as fractions of width and height
    focus: FocusRule = "focus" "WHERE" Blur FocusRule::from_str;
    /// Distances that are sharp as a whole, in metres: half of it on either side of the focal plane
    focus_range_m: f32 = "focus-range" "METRES" Blur not_negative;
    /// Blur radius of a point at infinity: the strength of the blur, in pixels, or as a share of the height such as 3%
    /// [default: auto, which is height / 45]
    coc_at_infinity: Strength = "coc-at-infinity" "PX" Blur Strength::from_str, is computed;
    /// The strength by a lens instead: its f-number, with --focal-length and --sensor-width
    f_number: f32 = "f-number" "N" Blur above_zero, is computed;
    /// Focal length of that lens, in millimetres
    focal_length_mm: f32 = "focal-length" "MM" Blur above_zero, is computed;
    /// Width of the sensor behind that lens, in millimetres
    sensor_width_mm: f32 = "sensor-width" "MM" Blur above_zero, is computed;
    /// Largest blur radius, in pixels [default: auto, which is 0.06 x height]
    max_coc_px: OrAuto<f32> = "max-coc" "PX" Blur OrAuto::parser(within(0.0..=MOST_RADIUS_PX)), is computed;
    /// Whether depth is fitted to the picture: edges onto colour edges, less noise and flicker
    refine: Refine = "refine" "WHEN" Blur Refine::from_str, one of names_of::<Refine>();
    /// Sharp band of tilt-shift: CENTER_Y[:BAND[:ANGLE_DEG]], the first two as fractions of the height
    tilt: Tilt = "tilt" "BAND" Blur Tilt::from_str;
    /// disc, ring:INNER, polygon:N[:ROTATION_DEG[:CURVATURE]], heart, star:N or image:FILE
    aperture: ApertureName = "aperture" "SHAPE" Aperture ApertureName::from_str;
    /// Radial intensity: -1 soap bubbles, 0 flat, 1 bright in the middle
    intensity: f32 = "intensity" "I" Aperture within(INTENSITIES);
    /// Width of the soft rim, as a fraction of the radius
    rim: f32 = "rim" "W" Aperture within(RIMS);
    /// Separable terms, 1 to 16 or full [default: auto, which is the quality level's]
    rank: OrAuto<Rank> = "rank" "TERMS" Aperture OrAuto::from_str, is computed;
    /// Take clipped white as this many times as bright; 0 is off
    highlights: f32 = "highlights" "M" Aperture within(HIGHLIGHTS);
    /// Quality level: changes fidelity, never the amount of blur. auto follows the time there is (--budget-ms) where
    /// frames come in real time, up to balanced on the CPU and best on a GPU; elsewhere it is balanced
    quality: OrAuto<Quality> = "quality" "LEVEL" Computing OrAuto::from_str, one of auto_or::<Quality>();
}

/// The setting of this name, if it is one of a look.
pub fn setting(name: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| setting.name == name)
}

/// The settings of a lens, which together set aside the strength at infinity.
const OF_A_LENS: [&str; 3] = ["f-number", "focal-length", "sensor-width"];
/// The strength at infinity, which sets aside those of a lens.
const AT_INFINITY: &str = "coc-at-infinity";

impl Setting {
    /// The names of the settings that cannot go with this one.
    pub fn excludes(&self) -> &'static [&'static str] {
        match self.name {
            AT_INFINITY => &OF_A_LENS,
            name if OF_A_LENS.contains(&name) => &[AT_INFINITY],
            _ => &[],
        }
    }

    /// Whether this is one of those that say how strong the blur is, of which each sets aside others.
    pub fn is_strength(&self) -> bool {
        !self.excludes().is_empty()
    }

    /// Its value where nothing is said, unless that is [computed](Setting::computed).
    pub fn default(&self) -> Option<String> {
        (self.get)(&Patch::of(&Look::default())).filter(|_| !self.computed)
    }

    /// Puts a value into a patch.
    ///
    /// # Errors
    /// It has no such value: what is accepted.
    pub fn set(&self, patch: &mut Patch, text: &str) -> Result<(), String> {
        (self.set)(patch, text)
    }
}

/// Why settings make no look.
#[derive(Debug, thiserror::Error)]
pub enum LookError {
    /// A lens is not known by all of its numbers.
    #[error("a lens needs all of --f-number, --focal-length and --sensor-width")]
    Lens,
    /// The picture of the aperture cannot be read.
    #[error(transparent)]
    Aperture(#[from] RecordingError),
}

impl Patch {
    /// All settings of a look, so that the look depends on no other.
    pub fn of(look: &Look) -> Self {
        let (coc_at_infinity, lens) = match look.strength {
            Strength::Lens(lens) => (None, Some(lens)),
            strength => (Some(strength), None),
        };
        Self {
            effect: Some(look.effect),
            method: Some(look.method),
            focus: Some(look.focus),
            focus_range_m: Some(look.focus_range_m),
            coc_at_infinity,
            f_number: lens.map(|lens| lens.f_number),
            focal_length_mm: lens.map(|lens| lens.focal_length_mm),
            sensor_width_mm: lens.map(|lens| lens.sensor_width_mm),
            max_coc_px: Some(look.max_coc_px.into()),
            refine: Some(look.refine),
            tilt: Some(look.tilt),
            aperture: ApertureName::of(&look.aperture.shape),
            intensity: Some(look.aperture.intensity),
            rim: Some(look.rim),
            rank: Some(look.rank.into()),
            highlights: Some(look.highlights),
            quality: Some(look.quality.into()),
        }
    }

    /// Settings by their names.
    ///
    /// # Errors
    /// One is none of a look, or has no such value: its name, and what is wrong.
    pub fn parse<'a>(settings: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<Self, (String, String)> {
        let mut patch = Self::default();
        for (name, text) in settings {
            let found = setting(name).ok_or_else(|| "it is none of a look".to_string());
            found.and_then(|setting| setting.set(&mut patch, text)).map_err(|what| (name.to_string(), what))?;
        }
        Ok(patch)
    }

    /// What it says, by name, in the order of [`SETTINGS`]. Numbers are as short as they can be and give the same value
    /// back.
    pub fn values(&self) -> Vec<Value> {
        SETTINGS.iter().filter_map(|setting| Some((setting.name, (setting.get)(self)?))).collect()
    }

    /// What it says that `other` does not.
    pub fn beside(mut self, other: &Self) -> Self {
        let is_same = |setting: &&Setting| (setting.get)(&self) == (setting.get)(other);
        let same: Vec<&Setting> = SETTINGS.iter().filter(is_same).collect();
        same.into_iter().for_each(|setting| (setting.clear)(&mut self));
        self
    }

    /// Whether a look is as this says, as far as it says anything.
    pub fn holds_in(&self, look: &Look) -> bool {
        self.clone().beside(&Self::of(look)) == Self::default()
    }

    /// Reads the picture of the aperture, if it has one, so that [`Patch::on`] need not.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn load(&mut self) -> Result<(), RecordingError> {
        if let Some(name) = &mut self.aperture {
            *name = ApertureName::Drawn(name.load()?);
        }
        Ok(())
    }

    /// `base` with these settings; what it does not set is as before.
    ///
    /// # Errors
    /// A lens misses a number, or the picture of the aperture cannot be read.
    pub fn on(&self, base: &Look) -> Result<Look, LookError> {
        let mut look = base.clone();
        macro_rules! take {
            ($($field:ident),+) => { $(if let Some(value) = self.$field { look.$field = value; })+ };
        }
        take!(effect, method, focus, focus_range_m, refine, tilt, rim, highlights);
        look.strength = self.strength(base.strength)?;
        if let Some(max_coc_px) = self.max_coc_px {
            look.max_coc_px = max_coc_px.chosen();
        }
        // A picture that is there already is not read again.
        let before = ApertureName::of(&look.aperture.shape).map(|name| name.to_string());
        if let Some(name) = self.aperture.as_ref().filter(|name| before != Some(name.to_string())) {
            look.aperture.shape = name.load()?;
        }
        if let Some(intensity) = self.intensity {
            look.aperture.intensity = intensity;
        }
        if let Some(rank) = self.rank {
            look.rank = rank.chosen();
        }
        if let Some(quality) = self.quality {
            look.quality = quality.chosen();
        }
        Ok(look)
    }

    /// The strength at infinity or by a lens; a lens that is there keeps the numbers that are not set.
    fn strength(&self, before: Strength) -> Result<Strength, LookError> {
        let (f_number, focal_length_mm, sensor_width_mm) = (self.f_number, self.focal_length_mm, self.sensor_width_mm);
        if f_number.or(focal_length_mm).or(sensor_width_mm).is_none() {
            return Ok(self.coc_at_infinity.unwrap_or(before));
        }
        let before = match before {
            Strength::Lens(lens) => Some(lens),
            _ => None,
        };
        let lens = (|| {
            Some(Lens {
                f_number: f_number.or(before.map(|lens| lens.f_number))?,
                focal_length_mm: focal_length_mm.or(before.map(|lens| lens.focal_length_mm))?,
                sensor_width_mm: sensor_width_mm.or(before.map(|lens| lens.sensor_width_mm))?,
            })
        })();
        lens.map(Strength::Lens).ok_or(LookError::Lens)
    }
}

/// A setting's name and its value, as they follow the dashes.
pub type Value = (&'static str, String);

impl Serialize for Patch {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.values())
    }
}

impl<'de> Deserialize<'de> for Patch {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values = BTreeMap::<String, String>::deserialize(deserializer)?;
        let pairs = values.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        Self::parse(pairs).map_err(|(name, what)| de::Error::custom(format!("{name}: {what}")))
    }
}

impl Serialize for Look {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Patch::of(self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Look {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Patch::deserialize(deserializer)?.on(&Self::default()).map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_values_say_what_is_accepted() {
        for text in ["0", "-1", "inf", "0.5", "far", "0.5,1.1", "0.5,", "1,1,1"] {
            let accepted = text.parse::<FocusRule>();
            assert_eq!(accepted.is_ok(), text == "0.5", "{text}: {accepted:?}");
        }
        for text in ["0", "17", "all"] {
            assert!(text.parse::<Rank>().unwrap_err().contains("1 to 16"), "{text}");
        }
        assert!("0.5:0.1:0:0".parse::<Tilt>().is_err());
        assert_eq!("0.6".parse(), Ok(Tilt { center_y: 0.6, band: 0.15, angle_deg: 0.0 }));
        assert_eq!(Patch::parse([("rim", "2")]), Err(("rim".to_string(), "use a number from 0 to 1".to_string())));
        assert!(Patch::parse([("mirror", "true")]).is_err());
    }

    #[test]
    fn a_lens_is_known_by_three_numbers_or_changed_by_one() {
        let one = Patch::parse([("f-number", "2")]).unwrap();
        assert!(matches!(one.on(&Look::default()), Err(LookError::Lens)));
        let lens = Patch::parse([("f-number", "4"), ("focal-length", "50"), ("sensor-width", "36")]).unwrap();
        let by_lens = lens.on(&Look::default()).unwrap();
        let wider = one.on(&by_lens).unwrap();
        assert_eq!(
            wider.strength,
            Strength::Lens(Lens { f_number: 2.0, focal_length_mm: 50.0, sensor_width_mm: 36.0 })
        );
        let at_infinity = Patch::parse([("coc-at-infinity", "auto")]).unwrap();
        assert_eq!(at_infinity.on(&wider).unwrap(), Look::default());
    }
}
