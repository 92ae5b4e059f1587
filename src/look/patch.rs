//! Changes of a look: a set of named settings that is applied to a look.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::settings::{SETTINGS, Setting, find_setting};
use super::{ApertureSetting, BackgroundSetting, Look, LookError, Patch, Strength};
use crate::bokeh::aperture::Shape;
use crate::depth::backdrop::Background;
use crate::names::find_similar;
use crate::optics::Lens;

/// Explains why a look has no setting of this name, and the remedy.
fn describe_unknown(name: &str, value: &str) -> String {
    if name == "preset" {
        return format!("a preset is taken by `bokehcam ctl preset {value}`");
    }
    let remedy = match find_similar(name, SETTINGS.iter().map(|setting| setting.name)) {
        Some(near) => format!(", did you mean {near}?"),
        None => ": nothing else can be changed while it runs".to_owned(),
    };
    format!("there is no setting '{name}' of the look{remedy}")
}

impl Patch {
    /// Returns all settings of a look, so that the patch makes it from any other.
    pub fn from_look(look: &Look) -> Self {
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
            background_memory: Some(look.background_memory),
            behind: BackgroundSetting::from_background(&look.background),
            follow: Some(look.follow),
            tilt: Some(look.tilt),
            aperture: ApertureSetting::from_shape(&look.aperture.shape),
            intensity: Some(look.aperture.intensity),
            rim: Some(look.rim),
            rank: Some(look.rank.into()),
            highlights: Some(look.highlights),
            quality: Some(look.quality.into()),
            reuse: Some(look.reuse),
            privacy: Some(look.privacy),
        }
    }

    /// Parses settings by name.
    ///
    /// # Errors
    /// Returns the name of a setting that does not exist or has an invalid value, and what is wrong.
    pub fn parse<'a>(settings: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<Self, (String, String)> {
        let mut patch = Self::default();
        for (name, text) in settings {
            let found = find_setting(name).ok_or_else(|| "it is not a setting of the look".to_string());
            found.and_then(|setting| setting.parse_into(&mut patch, text)).map_err(|what| (name.to_string(), what))?;
        }
        Ok(patch)
    }

    /// Parses settings, each written `NAME=VALUE`, as strictly as the command line.
    ///
    /// # Errors
    /// Returns a line on a name that is no setting of a look, an invalid value, or settings that are repeated or exclude
    /// each other.
    pub fn parse_assignments(settings: &[String]) -> Result<Self, String> {
        let (mut patch, mut given) = (Self::default(), Vec::<&Setting>::new());
        for text in settings {
            let (name, value) = text
                .split_once('=')
                .filter(|(name, _)| !name.is_empty())
                .ok_or_else(|| format!("'{text}': write NAME=VALUE, such as blur=3% or focus=auto"))?;
            let name = name.trim_start_matches('-');
            let setting = find_setting(name).ok_or_else(|| describe_unknown(name, value))?;
            let flag = |setting: &Setting| format!("'--{} <{}>'", setting.name, setting.value);
            if given.iter().any(|other| other.name == setting.name) {
                return Err(format!("the argument {} cannot be used multiple times", flag(setting)));
            }
            if let Some(other) = given.iter().find(|other| other.excluded_settings().contains(&setting.name)) {
                return Err(format!("the argument {} cannot be used with {}", flag(setting), flag(other)));
            }
            let parsed = setting.parse_into(&mut patch, value);
            parsed.map_err(|what| format!("invalid value '{value}' for {}: {what}", flag(setting)))?;
            given.push(setting);
        }
        Ok(patch)
    }

    /// Returns names and values of the settings it sets, in the order of [`SETTINGS`]. Numbers are as short as possible
    /// and parse to the same value.
    pub fn values(&self) -> Vec<Value> {
        SETTINGS.iter().filter_map(|setting| Some((setting.name, (setting.get)(self)?))).collect()
    }

    /// Removes the settings that have the same value in `other`.
    pub fn without_equal_values(mut self, other: &Self) -> Self {
        let is_same = |setting: &&Setting| (setting.get)(&self) == (setting.get)(other);
        let same: Vec<&Setting> = SETTINGS.iter().filter(is_same).collect();
        same.into_iter().for_each(|setting| (setting.clear)(&mut self));
        self
    }

    /// Returns the files of pictures and videos that are not read yet.
    pub fn unread_files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let aperture = match &mut self.aperture {
            Some(ApertureSetting::Image(file)) => Some(file),
            _ => None,
        };
        let behind = match &mut self.behind {
            Some(BackgroundSetting::Image(file) | BackgroundSetting::Video(file)) => Some(file),
            _ => None,
        };
        aperture.into_iter().chain(behind)
    }

    /// Returns all settings of a look under all their names, for the status of a run.
    pub fn describe(look: &Look) -> BTreeMap<String, String> {
        let named = |(name, value): Value| {
            let alias = find_setting(name).and_then(Setting::alias);
            [Some(name), alias].into_iter().flatten().map(move |name| (name.to_owned(), value.clone()))
        };
        Self::from_look(look).values().into_iter().flat_map(named).collect()
    }

    /// Reads the pictures it names, so that [`Patch::apply_to`] need not.
    ///
    /// # Errors
    /// A picture or video cannot be read.
    pub fn load_pictures(&mut self) -> Result<(), LookError> {
        if let Some(name) = &mut self.aperture {
            *name = ApertureSetting::Loaded(name.load()?);
        }
        if let Some(name) = &mut self.behind {
            *name = BackgroundSetting::Loaded(name.load()?);
        }
        Ok(())
    }

    /// Returns `base` with these settings changed.
    ///
    /// # Errors
    /// A lens lacks a number, or a picture cannot be read.
    pub fn apply_to(&self, base: &Look) -> Result<Look, LookError> {
        let mut look = base.clone();
        macro_rules! set {
            ($($field:ident),+) => { $(if let Some(value) = self.$field { look.$field = value; })+ };
        }
        set!(effect, method, focus, focus_range_m, refine, background_memory, privacy, follow, tilt, rim);
        set!(highlights, reuse);
        look.strength = self.merge_strength(base.strength)?;
        if let Some(max_coc_px) = self.max_coc_px {
            look.max_coc_px = max_coc_px.value();
        }
        match (&self.aperture, &look.aperture.shape) {
            (None, _) => {}
            // The base has this picture already: do not read it again.
            (Some(ApertureSetting::Image(file)), Shape::Picture(picture)) if picture.file.as_ref() == Some(file) => {}
            (Some(name), _) => look.aperture.shape = name.load()?,
        }
        match (&self.behind, &look.background) {
            (None, _) => {}
            (Some(BackgroundSetting::Image(file)), Background::Picture(picture))
                if picture.file.as_ref() == Some(file) => {}
            (Some(BackgroundSetting::Video(file)), Background::Video(video)) if video.file() == *file => {}
            (Some(name), _) => look.background = name.load()?,
        }
        if let Some(intensity) = self.intensity {
            look.aperture.intensity = intensity;
        }
        if let Some(rank) = self.rank {
            look.rank = rank.value();
        }
        if let Some(quality) = self.quality {
            look.quality = quality.value();
        }
        Ok(look)
    }

    /// Returns the strength after this patch: a lens if it sets any number of one (missing ones come from `before`),
    /// otherwise the CoC at infinity.
    fn merge_strength(&self, before: Strength) -> Result<Strength, LookError> {
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

/// A setting's name and its value, as on the command line.
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
        Patch::from_look(self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Look {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Patch::deserialize(deserializer)?.apply_to(&Self::default()).map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::Rank;
    use crate::depth::focus::FocusRule;
    use crate::look::Tilt;

    #[test]
    fn wrong_values_say_what_is_accepted() {
        for text in ["0", "-1", "inf", "0.5", "far", "0.5,1.1", "0.5,", "1,1,1", "track:", "track:0.5", "track:2,0"] {
            let accepted = text.parse::<FocusRule>();
            assert_eq!(accepted.is_ok(), ["0", "0.5"].contains(&text), "{text}: {accepted:?}");
        }
        let track = FocusRule::Track { x: 0.25, y: 1.0 };
        assert_eq!((track.to_string().parse(), track.to_string().as_str()), (Ok(track), "track:0.25,1"));
        for text in ["0", "17", "all"] {
            assert!(text.parse::<Rank>().unwrap_err().contains("1 to 16"), "{text}");
        }
        assert!("0.5:0.1:0:0".parse::<Tilt>().is_err());
        assert_eq!("0.6".parse(), Ok(Tilt { center_y: 0.6, band: 0.15, angle_deg: 0.0 }));
        assert_eq!(Patch::parse([("rim", "2")]), Err(("rim".to_string(), "use a number from 0 to 1".to_string())));
        assert!(Patch::parse([("mirror", "true")]).is_err());
    }

    #[test]
    fn assignments_are_those_of_the_command_line() {
        let parse = |settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
            Patch::parse_assignments(&settings).map(|patch| patch.values())
        };
        let text = |value: &str| value.to_string();
        let values = parse(&["blur=3%", "focus=auto", "quality=fast"]).unwrap();
        assert_eq!(values, [("focus", text("auto")), ("blur", text("3%")), ("quality", text("draft"))]);
        for (bad, said) in [
            (&["rim"][..], "write NAME=VALUE"),
            (&["=3"], "write NAME=VALUE"),
            (&["rim=2"], "invalid value '2' for '--rim <W>': use a number from 0 to 1"),
            (&["rimm=1"], "there is no setting 'rimm' of the look, did you mean rim?"),
            (&["blurr=3%"], "there is no setting 'blurr' of the look, did you mean blur?"),
            (&["zzz=3"], "there is no setting 'zzz' of the look: nothing else can be changed while it runs"),
            (&["preset=dreamy"], "`bokehcam ctl preset dreamy`"),
            (&["depth=matte"], "nothing else can be changed while it runs"),
            (&["coc-at-infinity=3", "blur=3"], "cannot be used multiple times"),
            (&["mirror=true"], "nothing else can be changed while it runs"),
            (&["effect=big"], "invalid value 'big' for '--effect <WHAT>': use auto, dof"),
            (&["blur=3%", "f-number=2"], "'--f-number <N>' cannot be used with '--blur <PX>'"),
            (&["rim=0.1", "rim=0.2"], "cannot be used multiple times"),
        ] {
            let refused = parse(bad).unwrap_err();
            assert!(refused.contains(said) && !refused.contains('\n'), "{bad:?}: {refused}");
        }
    }

    #[test]
    fn a_lens_is_known_by_three_numbers_or_changed_by_one() {
        let one = Patch::parse([("f-number", "2")]).unwrap();
        assert!(matches!(one.apply_to(&Look::default()), Err(LookError::Lens)));
        let lens = Patch::parse([("f-number", "4"), ("focal-length", "50"), ("sensor-width", "36")]).unwrap();
        let by_lens = lens.apply_to(&Look::default()).unwrap();
        let wider = one.apply_to(&by_lens).unwrap();
        assert_eq!(
            wider.strength,
            Strength::Lens(Lens { f_number: 2.0, focal_length_mm: 50.0, sensor_width_mm: 36.0 })
        );
        let at_infinity = Patch::parse([("coc-at-infinity", "auto")]).unwrap();
        assert_eq!(at_infinity.apply_to(&wider).unwrap(), Look::default());
    }
}
