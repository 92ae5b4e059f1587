//! The element's properties: those of the library's table of settings, and a few of its own.

use std::sync::LazyLock;

use bokehcam::computing::Computing;
use bokehcam::frame::DepthMap;
use bokehcam::look::settings::{SETTINGS, Setting};
use bokehcam::look::{Look, MOST_RADIUS_PX, Patch};
use gst::glib;
use gst::prelude::*;

use crate::enums;

/// What a property is.
#[derive(Clone, Copy, Debug)]
pub enum Property {
    /// A setting of the table, by its place.
    Setting(usize),
    /// The number that is such a setting's value, where it is one: controllers have numbers only.
    Number(usize),
    /// Units of a depth map per metre.
    DepthScale,
    /// A number of depth maps that means unknown.
    DepthInvalid,
    /// Threads that blur.
    Threads,
    /// Whether to do less when the pipeline is late.
    Qos,
    /// What became of pictures and maps.
    Stats,
}

/// Settings that are numbers among other things, with the property that has their number, its unit, and its largest.
const NUMBERS: [(&str, &str, &str, f32); 2] = [
    ("focus", "focus-m", "metres", DepthMap::MOST_M),
    ("coc-at-infinity", "coc-at-infinity-px", "pixels", MOST_RADIUS_PX),
];
/// What such a property has where the setting is no number.
const NO_NUMBER: f32 = -1.0;

/// All properties in the order of their numbers.
pub static PROPERTIES: LazyLock<Vec<Property>> = LazyLock::new(|| {
    let numbers = NUMBERS.iter().filter_map(|(name, ..)| SETTINGS.iter().position(|setting| called(setting) == *name));
    let own = [Property::DepthScale, Property::DepthInvalid, Property::Threads, Property::Qos, Property::Stats];
    (0..SETTINGS.len()).map(Property::Setting).chain(numbers.map(Property::Number)).chain(own).collect()
});

/// How GObject knows them.
pub static PARAM_SPECS: LazyLock<Vec<glib::ParamSpec>> =
    LazyLock::new(|| PROPERTIES.iter().copied().map(param_spec).collect());

/// The property of a setting. It has the setting's other name where there is one: pipelines are written with that.
fn called(setting: &Setting) -> &'static str {
    setting.alias().unwrap_or(setting.name)
}

fn param_spec(property: Property) -> glib::ParamSpec {
    match property {
        Property::Setting(place) => of_setting(&SETTINGS[place]),
        Property::Number(place) => {
            let setting = &SETTINGS[place];
            let (_, name, unit, most) = NUMBERS.iter().find(|(name, ..)| *name == called(setting)).expect("it has a row");
            let blurb = format!(
                "The property {} as a number of {unit}, for controllers; {NO_NUMBER} where it is no such number",
                called(setting)
            );
            let nick = nick(name);
            let number = glib::ParamSpecFloat::builder(name).nick(&nick).blurb(&blurb);
            number.minimum(NO_NUMBER).maximum(*most).default_value(NO_NUMBER).controllable().mutable_playing().build()
        }
        Property::DepthScale => glib::ParamSpecFloat::builder("depth-scale")
            .nick("Depth scale")
            .blurb("Units of a 16-bit depth picture per metre (millimetres 1000, TUM 5000)")
            .minimum(f32::from_bits(1))
            .maximum(f32::MAX)
            .default_value(Values::default().depth_scale)
            .mutable_playing()
            .build(),
        Property::DepthInvalid => glib::ParamSpecUInt::builder("depth-invalid")
            .nick("Depth invalid")
            .blurb("Value of a 16-bit depth picture that means unknown, besides 0")
            .maximum(u16::MAX.into())
            .mutable_playing()
            .build(),
        Property::Threads => glib::ParamSpecUInt::builder("threads")
            .nick("Threads")
            .blurb("Threads that blur; 0 is one for each core")
            .maximum(1024)
            .mutable_ready()
            .build(),
        Property::Qos => glib::ParamSpecBoolean::builder("qos")
            .nick("Quality of service")
            .blurb("Where the pipeline is late, blur more coarsely (with quality=auto), and leave out pictures that come too late")
            .default_value(true)
            .mutable_playing()
            .build(),
        Property::Stats => glib::ParamSpecBoxed::builder::<gst::Structure>("stats")
            .nick("Statistics")
            .blurb("Pictures that came, depth maps that were used and used again, pictures left out, and the quality now")
            .read_only()
            .build(),
    }
}

fn of_setting(setting: &Setting) -> glib::ParamSpec {
    let (nick, blurb) = (nick(called(setting)), as_properties(setting.help.trim()));
    let choices = (setting.choices)();
    if !choices.is_empty() {
        let default = setting.default().and_then(|name| choices.iter().position(|choice| choice.0 == name));
        let type_ = enums::register(&format!("GstBokeh{}", nick.split(' ').map(capital).collect::<String>()), &choices);
        let flags = glib::ParamFlags::READWRITE | gst::PARAM_FLAG_CONTROLLABLE | gst::PARAM_FLAG_MUTABLE_PLAYING;
        return enums::param_spec(called(setting), (&nick, &blurb), type_, default.unwrap_or(0), flags);
    }
    let default = setting.default();
    match (setting.range)() {
        Some(range) => {
            let number = default.and_then(|text| text.parse().ok());
            // A number without a default is 0 as long as it is not set.
            let (low, blurb) = match number {
                Some(_) => (*range.start(), blurb),
                None => (0.0, format!("{blurb}; 0 is not set")),
            };
            let number = glib::ParamSpecFloat::builder(called(setting)).default_value(number.unwrap_or(0.0));
            let number = number.nick(&nick).blurb(&blurb).minimum(low).maximum(*range.end());
            number.controllable().mutable_playing().build()
        }
        None => {
            let default = default.unwrap_or_else(|| AUTO.to_owned());
            let text = glib::ParamSpecString::builder(called(setting)).nick(&nick).blurb(&blurb);
            text.default_value(Some(default.as_str())).mutable_playing().build()
        }
    }
}

/// The value of settings without a default that take text.
const AUTO: &str = "auto";

fn nick(name: &str) -> String {
    capital(&name.replace('-', " "))
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Text that speaks of flags, as one of properties. Flags in parentheses are none.
pub fn as_properties(text: &str) -> String {
    text.replace(" (--budget-ms)", "").replace("--", "")
}

/// The values of all properties.
#[derive(Clone, Debug)]
pub struct Values {
    /// Of each setting, what was set and is possible.
    texts: [Option<String>; SETTINGS.len()],
    /// Of each setting, what was set and is not possible.
    faults: [Option<String>; SETTINGS.len()],
    pub depth_scale: f32,
    pub depth_invalid: u16,
    pub threads: u32,
    pub qos: bool,
    /// Counts changes of the settings.
    pub version: u64,
}

impl Default for Values {
    fn default() -> Self {
        let (texts, faults) = ([const { None }; SETTINGS.len()], [const { None }; SETTINGS.len()]);
        Self { texts, faults, depth_scale: 1000.0, depth_invalid: 0, threads: 0, qos: true, version: 1 }
    }
}

impl Values {
    /// Sets a property.
    ///
    /// # Errors
    /// It has no such value: what is accepted.
    pub fn set(&mut self, property: Property, value: &glib::Value) -> Result<(), String> {
        const TYPE: &str = "GObject checks types";
        match property {
            Property::Setting(place) => {
                let setting = &SETTINGS[place];
                let text = if let Some((_, choice)) = glib::EnumValue::from_value(value) {
                    Some(choice.nick().to_owned())
                } else if let Ok(number) = value.get::<f32>() {
                    // Not set is 0 where that is no value.
                    Some(number.to_string()).filter(|_| number != 0.0 || setting.default().is_some())
                } else {
                    value.get::<Option<String>>().expect(TYPE)
                };
                self.set_text(place, text)
            }
            Property::Number(place) => {
                let number: f32 = value.get().expect(TYPE);
                if number == NO_NUMBER && self.number(place) == NO_NUMBER {
                    return Ok(());
                }
                self.set_text(place, Some(number.to_string()).filter(|_| number != NO_NUMBER))
            }
            Property::DepthScale => {
                self.depth_scale = value.get().expect(TYPE);
                Ok(())
            }
            Property::DepthInvalid => {
                self.depth_invalid = value.get::<u32>().expect(TYPE) as u16;
                Ok(())
            }
            Property::Threads => {
                self.threads = value.get().expect(TYPE);
                Ok(())
            }
            Property::Qos => {
                self.qos = value.get().expect(TYPE);
                Ok(())
            }
            // GObject lets nobody write it.
            Property::Stats => Ok(()),
        }
    }

    /// Sets a setting, or takes it back.
    fn set_text(&mut self, place: usize, text: Option<String>) -> Result<(), String> {
        let setting = &SETTINGS[place];
        if self.texts[place] == text && self.faults[place].is_none() {
            return Ok(());
        }
        if let Some(text) = &text
            && let Err(accepted) = setting.set(&mut Patch::default(), text)
        {
            let fault = format!("{}={text}: {}", called(setting), as_properties(&accepted));
            self.faults[place] = Some(fault.clone());
            return Err(fault);
        }
        if text.is_some() {
            for (other, text) in SETTINGS.iter().zip(&mut self.texts) {
                if setting.excludes().contains(&other.name) {
                    *text = None;
                }
            }
        }
        (self.texts[place], self.faults[place]) = (text, None);
        self.version += 1;
        Ok(())
    }

    /// The value of a property that [`PARAM_SPECS`] describes by `spec`; none of one that is not kept here.
    pub fn get(&self, property: Property, spec: &glib::ParamSpec) -> Option<glib::Value> {
        Some(match property {
            Property::Setting(place) => {
                let text = self.texts[place].clone();
                if let Some(class) = glib::EnumClass::with_type(spec.value_type()) {
                    text.and_then(|nick| class.to_value_by_nick(&nick)).unwrap_or_else(|| spec.default_value().clone())
                } else if spec.value_type() == glib::Type::F32 {
                    let number = text.and_then(|text| text.parse::<f32>().ok());
                    number.map_or_else(|| spec.default_value().clone(), |number| number.to_value())
                } else {
                    text.map_or_else(|| spec.default_value().clone(), |text| text.to_value())
                }
            }
            Property::Number(place) => self.number(place).to_value(),
            Property::DepthScale => self.depth_scale.to_value(),
            Property::DepthInvalid => u32::from(self.depth_invalid).to_value(),
            Property::Threads => self.threads.to_value(),
            Property::Qos => self.qos.to_value(),
            Property::Stats => return None,
        })
    }

    fn number(&self, place: usize) -> f32 {
        self.texts[place].as_ref().and_then(|text| text.parse().ok()).unwrap_or(NO_NUMBER)
    }

    /// What was set and is not possible.
    pub fn fault(&self) -> Option<&str> {
        self.faults.iter().flatten().next().map(String::as_str)
    }

    /// The look that they make; pictures that `before` has are not read again.
    ///
    /// # Errors
    /// A lens misses a number, or a picture cannot be read.
    pub fn look(&self, before: &Look) -> Result<Look, String> {
        let by_lens = SETTINGS
            .iter()
            .zip(&self.texts)
            .any(|(setting, text)| setting.is_strength() && (setting.range)().is_some() && text.is_some());
        let default = |setting: &Setting| match setting.default() {
            None if (setting.range)().is_some() || by_lens && setting.is_strength() => None,
            default => Some(default.unwrap_or_else(|| AUTO.to_owned())),
        };
        let values: Vec<(&str, String)> = SETTINGS
            .iter()
            .zip(&self.texts)
            .filter_map(|(setting, text)| Some((setting.name, text.clone().or_else(|| default(setting))?)))
            .collect();
        let patch = Patch::parse(values.iter().map(|(name, text)| (*name, text.as_str())));
        let patch = patch.map_err(|(name, accepted)| format!("{name}: {}", as_properties(&accepted)))?;
        patch.on(before).map_err(|error| as_properties(&error.to_string()))
    }

    /// What blurs.
    pub fn computing(&self) -> Computing {
        Computing { threads: Some(self.threads as usize).filter(|&threads| threads > 0), ..Computing::default() }
    }
}

#[cfg(test)]
mod tests;
