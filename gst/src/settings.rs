//! The element's properties: the library's table of settings, and a few of its own.

use std::sync::LazyLock;

use bokehcam::computing::ComputeOptions;
use bokehcam::frame::DepthMap;
use bokehcam::look::settings::{SETTINGS, Setting};
use bokehcam::look::{Look, MAX_RADIUS_PX, Patch};
use gst::glib;
use gst::prelude::*;

use crate::enums;

/// A property of the element.
#[derive(Clone, Copy, Debug)]
pub enum Property {
    /// A setting of the table, by its index.
    Setting(usize),
    /// The numeric value of a setting that also has other forms: controllers animate numbers only.
    Number(usize),
    /// Units of a depth map per metre.
    DepthScale,
    /// Value of a depth map that means unknown.
    DepthInvalid,
    /// Number of threads for the blur.
    Threads,
    /// Whether to reduce quality and drop pictures when the pipeline is late.
    Qos,
    /// Statistics of pictures and maps.
    Stats,
}

/// Settings with numeric and other forms: name, property of the number, its unit, and its maximum.
const NUMBERS: [(&str, &str, &str, f32); 2] = [
    ("focus", "focus-m", "metres", DepthMap::MAX_M),
    ("coc-at-infinity", "coc-at-infinity-px", "pixels", MAX_RADIUS_PX),
];
/// Value of a number property while the setting is not a number.
const NO_NUMBER: f32 = -1.0;

/// All properties; GObject's id of a property is its index plus 1.
pub static PROPERTIES: LazyLock<Vec<Property>> = LazyLock::new(|| {
    let find = |name: &str| SETTINGS.iter().position(|setting| property_name(setting) == name);
    let numbers = NUMBERS.iter().filter_map(|(name, ..)| find(name));
    let own = [Property::DepthScale, Property::DepthInvalid, Property::Threads, Property::Qos, Property::Stats];
    (0..SETTINGS.len()).map(Property::Setting).chain(numbers.map(Property::Number)).chain(own).collect()
});

/// Their GObject specifications.
pub static PARAM_SPECS: LazyLock<Vec<glib::ParamSpec>> =
    LazyLock::new(|| PROPERTIES.iter().copied().map(param_spec).collect());

/// Returns the property name of a setting: its alias if it has one, which existing pipelines use.
fn property_name(setting: &Setting) -> &'static str {
    setting.alias().unwrap_or(setting.name)
}

fn param_spec(property: Property) -> glib::ParamSpec {
    match property {
        Property::Setting(place) => setting_spec(&SETTINGS[place]),
        Property::Number(place) => {
            let setting = &SETTINGS[place];
            let row = NUMBERS.iter().find(|(name, ..)| *name == property_name(setting));
            let (_, name, unit, max) = row.expect("it has a row");
            let blurb = format!(
                "The property {} as a number of {unit}, for controllers; {NO_NUMBER} if it is not such a number",
                property_name(setting)
            );
            let nick = format_nick(name);
            let number = glib::ParamSpecFloat::builder(name).nick(&nick).blurb(&blurb);
            number.minimum(NO_NUMBER).maximum(*max).default_value(NO_NUMBER).controllable().mutable_playing().build()
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
            .blurb("Threads for the blur; 0 is one per core")
            .maximum(1024)
            .mutable_ready()
            .build(),
        Property::Qos => glib::ParamSpecBoolean::builder("qos")
            .nick("Quality of service")
            .blurb("If the pipeline is late, blur more coarsely (with quality=auto), and drop late pictures")
            .default_value(true)
            .mutable_playing()
            .build(),
        Property::Stats => glib::ParamSpecBoxed::builder::<gst::Structure>("stats")
            .nick("Statistics")
            .blurb(
                "Counts of received pictures, used and reused depth maps and dropped pictures, and the present quality",
            )
            .read_only()
            .build(),
    }
}

/// Returns the specification of a setting: an enumeration if it has choices, a number if it has a range, else a text.
fn setting_spec(setting: &Setting) -> glib::ParamSpec {
    let (name, default) = (property_name(setting), setting.default());
    let (nick, help) = (format_nick(name), as_properties(setting.help.trim()));
    let choices = (setting.choices)();
    if !choices.is_empty() {
        let place = default.and_then(|default| choices.iter().position(|choice| choice.name == default));
        let type_name = format!("GstBokeh{}", nick.split(' ').map(capitalise).collect::<String>());
        let type_ = enums::register(&type_name, &choices);
        let flags = glib::ParamFlags::READWRITE | gst::PARAM_FLAG_CONTROLLABLE | gst::PARAM_FLAG_MUTABLE_PLAYING;
        return enums::param_spec(name, (&nick, &help), type_, place.unwrap_or(0), flags);
    }
    match (setting.range)() {
        Some(range) => {
            let number = default.and_then(|text| text.parse().ok());
            // A number without a default is 0 while unset.
            let (min, blurb) = match number {
                Some(_) => (*range.start(), help),
                None => (0.0, format!("{help}; 0 is not set")),
            };
            let spec = glib::ParamSpecFloat::builder(name).nick(&nick).blurb(&blurb).minimum(min);
            let spec = spec.maximum(*range.end()).default_value(number.unwrap_or(0.0));
            spec.controllable().mutable_playing().build()
        }
        None => {
            let default = default.unwrap_or_else(|| AUTO.to_owned());
            let spec = glib::ParamSpecString::builder(name).nick(&nick).blurb(&help);
            spec.default_value(Some(default.as_str())).mutable_playing().build()
        }
    }
}

/// Value of unset text settings without a default.
const AUTO: &str = "auto";

/// Returns a property's name for people: a capitalised phrase.
fn format_nick(name: &str) -> String {
    capitalise(&name.replace('-', " "))
}

fn capitalise(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Converts a text about flags to one about properties, without flags in parentheses.
pub fn as_properties(text: &str) -> String {
    text.replace(" (--budget-ms)", "").replace("--", "")
}

/// Values of all properties.
#[derive(Clone, Debug)]
pub struct Values {
    /// Valid value of each setting, if set.
    texts: [Option<String>; SETTINGS.len()],
    /// Error message of each setting with an invalid value.
    faults: [Option<String>; SETTINGS.len()],
    pub depth_scale: f32,
    pub depth_invalid: u16,
    pub threads: u32,
    pub qos: bool,
    /// Number of changes of the settings.
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
    /// Returns the accepted values if `value` is invalid.
    pub fn parse_into(&mut self, property: Property, value: &glib::Value) -> Result<(), String> {
        const TYPE: &str = "GObject checks types";
        match property {
            Property::Setting(place) => {
                let setting = &SETTINGS[place];
                let text = if let Some((_, choice)) = glib::EnumValue::from_value(value) {
                    Some(choice.nick().to_owned())
                } else if let Ok(number) = value.get::<f32>() {
                    // 0 means unset if it is not a valid value.
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
            // GObject rejects writes to it.
            Property::Stats => Ok(()),
        }
    }

    /// Sets or resets a setting.
    fn set_text(&mut self, place: usize, text: Option<String>) -> Result<(), String> {
        let setting = &SETTINGS[place];
        if self.texts[place] == text && self.faults[place].is_none() {
            return Ok(());
        }
        if let Some(text) = &text
            && let Err(accepted) = setting.parse_into(&mut Patch::default(), text)
        {
            let fault = format!("{}={text}: {}", property_name(setting), as_properties(&accepted));
            self.faults[place] = Some(fault.clone());
            return Err(fault);
        }
        if text.is_some() {
            for (other, text) in SETTINGS.iter().zip(&mut self.texts) {
                if setting.excluded_settings().contains(&other.name) {
                    *text = None;
                }
            }
        }
        (self.texts[place], self.faults[place]) = (text, None);
        self.version += 1;
        Ok(())
    }

    /// Returns the value of a property with the specification `spec` in [`PARAM_SPECS`]; `None` for the statistics.
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

    /// Returns the first error message of an invalid value.
    pub fn fault(&self) -> Option<&str> {
        self.faults.iter().flatten().next().map(String::as_str)
    }

    /// Returns the look of the values; pictures in `before` are not loaded again.
    ///
    /// # Errors
    /// Fails if a lens lacks a number, or a picture cannot be read.
    pub fn look(&self, before: &Look) -> Result<Look, String> {
        let by_lens = SETTINGS
            .iter()
            .zip(&self.texts)
            .any(|(setting, text)| setting.sets_strength() && (setting.range)().is_some() && text.is_some());
        let default = |setting: &Setting| match setting.default() {
            None if (setting.range)().is_some() || by_lens && setting.sets_strength() => None,
            default => Some(default.unwrap_or_else(|| AUTO.to_owned())),
        };
        let values: Vec<(&str, String)> = SETTINGS
            .iter()
            .zip(&self.texts)
            .filter_map(|(setting, text)| Some((setting.name, text.clone().or_else(|| default(setting))?)))
            .collect();
        let patch = Patch::parse(values.iter().map(|(name, text)| (*name, text.as_str())));
        let patch = patch.map_err(|(name, accepted)| format!("{name}: {}", as_properties(&accepted)))?;
        patch.apply_to(before).map_err(|error| as_properties(&error.to_string()))
    }

    /// Returns the executor options.
    pub fn computing(&self) -> ComputeOptions {
        ComputeOptions {
            threads: Some(self.threads as usize).filter(|&threads| threads > 0),
            ..ComputeOptions::default()
        }
    }
}

#[cfg(test)]
mod tests;
