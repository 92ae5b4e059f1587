//! Values of controls: their text form, and which ones a control accepts.

use std::fmt;
use std::io;

use serde::Serialize;

use super::{Control, Item, Kind};

/// A control's value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; 0 and 1 for off and on; the index of a menu item.
    Number(i64),
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => text.fmt(f),
        }
    }
}

/// Why a control cannot be set or read.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The device has no control with this name.
    #[error("control {name}: {}", format_suggestion(similar, *count))]
    Unknown {
        name: String,
        /// Names of similar controls, the most similar first; may be empty.
        similar: Vec<String>,
        /// How many controls there are.
        count: usize,
    },
    /// The control does not accept this value.
    #[error("control {name}={value}: {accepted}")]
    Value { name: String, value: String, accepted: String },
    /// The control cannot be set, or not now.
    #[error("control {name} {why}")]
    NotSettable { name: String, why: &'static str },
    /// The control has no value that can be written as text.
    #[error("control {0} has no value to read")]
    NoValue(String),
    #[error("control {name}: {source}")]
    Device { name: String, source: io::Error },
}

fn format_suggestion(similar: &[String], count: usize) -> String {
    match (similar, count) {
        (_, 0) => "the device has no controls".to_owned(),
        ([], _) => "the device has no control of this name; `bokehcam devices --controls` lists them".to_owned(),
        (similar, _) => format!("the device has no control of this name; did you mean {}?", similar.join(" or ")),
    }
}

impl ControlError {
    /// Creates the error for an unknown `name`, with up to three similar names to suggest.
    pub(super) fn unknown(name: &str, controls: &[Control]) -> Self {
        /// Minimum similarity, from 0 to 1, for a name to be suggested.
        const MIN_SIMILARITY: f64 = 0.75;
        const MAX_SUGGESTIONS: usize = 3;
        let similarity = |control: &Control| {
            let contains = !name.is_empty() && control.name.contains(name);
            if contains { 1.0 } else { strsim::normalized_damerau_levenshtein(&control.name, name) }
        };
        let mut similar: Vec<(f64, &str)> =
            controls.iter().map(|control| (similarity(control), &*control.name)).collect();
        similar.retain(|(similarity, _)| *similarity >= MIN_SIMILARITY);
        similar.sort_by(|a, b| b.0.total_cmp(&a.0));
        let similar = similar.iter().take(MAX_SUGGESTIONS).map(|(_, name)| (*name).to_owned()).collect();
        Self::Unknown { name: name.to_owned(), similar, count: controls.len() }
    }
}

impl Control {
    /// Parses a value of this control as a user writes it, and checks that the control can be set to it now.
    ///
    /// # Errors
    /// The control does not accept this value, or cannot be set now.
    pub fn parse(&self, text: &str) -> Result<Value, ControlError> {
        let why = match () {
            () if self.kind == Kind::Compound => "is a table, which a single value cannot set",
            () if self.read_only => "is read-only",
            () if self.grabbed => "cannot be set while the device is streaming",
            () if self.inactive => "has no effect now: another control overrides it, such as an automatic mode",
            () => return self.parse_value(text).ok_or_else(|| self.value_error(text)),
        };
        Err(ControlError::NotSettable { name: self.name.clone(), why })
    }

    /// Parses `text` as a value; `None` if the control does not accept it. Ignores whether the control can be set now.
    fn parse_value(&self, text: &str) -> Option<Value> {
        let number = parse_number(text);
        let value = match self.kind {
            Kind::Button => Some(1),
            Kind::Boolean => match text.to_ascii_lowercase().as_str() {
                "1" | "on" | "yes" | "true" => Some(1),
                "0" | "off" | "no" | "false" => Some(0),
                _ => None,
            },
            Kind::Integer | Kind::Integer64 => number.filter(|number| {
                // The wrapping difference is the right `u64` even where the range is wider than an `i64`.
                let above_minimum = number.wrapping_sub(self.minimum).cast_unsigned();
                (self.minimum..=self.maximum).contains(number) && above_minimum.is_multiple_of(self.step)
            }),
            Kind::Bitmask => number
                .filter(|number| (0..=self.settable_bits()).contains(number) && number & !self.settable_bits() == 0),
            Kind::Menu | Kind::IntegerMenu => self.find_item(text).map(|item| item.index),
            Kind::String => {
                let length = text.len() as i64;
                let above_minimum = length.wrapping_sub(self.minimum).cast_unsigned();
                let fits = (self.minimum..=self.maximum).contains(&length) && above_minimum.is_multiple_of(self.step);
                return (fits && !text.contains('\0')).then(|| Value::Text(text.to_owned()));
            }
            Kind::Compound => None,
        };
        value.map(Value::Number)
    }

    /// Returns the mask of the 32 bits that may be set.
    fn settable_bits(&self) -> i64 {
        self.maximum & i64::from(u32::MAX)
    }

    /// Finds the menu item that `text` names: by its index, its name, or its name as [`super::v4l2_ctl_name`] writes
    /// it.
    fn find_item(&self, text: &str) -> Option<&Item> {
        let find_by = |matches_text: &dyn Fn(&Item) -> bool| self.items.iter().find(|item| matches_text(item));
        let number = parse_number(text);
        find_by(&|item| Some(item.index) == number)
            .or_else(|| find_by(&|item| item.name.eq_ignore_ascii_case(text)))
            .or_else(|| {
                find_by(&|item| !item.name.is_empty() && super::v4l2_ctl_name(&item.name) == super::v4l2_ctl_name(text))
            })
    }

    fn value_error(&self, text: &str) -> ControlError {
        ControlError::Value { name: self.name.clone(), value: text.to_owned(), accepted: self.describe_accepted() }
    }

    /// Describes the accepted values, as the hint of an error message.
    fn describe_accepted(&self) -> String {
        let steps = if self.step > 1 { format!(" in steps of {}", self.step) } else { String::new() };
        match self.kind {
            Kind::Integer | Kind::Integer64 => format!("use {} to {}{steps}", self.minimum, self.maximum),
            Kind::Boolean => "use on or off".to_owned(),
            Kind::Bitmask => format!("use bits of {:#x}", self.settable_bits()),
            Kind::Button => "any value will do".to_owned(),
            Kind::String => format!("use {} to {} bytes of text{steps}", self.minimum, self.maximum),
            Kind::Compound => "it has no single value to set".to_owned(),
            Kind::Menu | Kind::IntegerMenu => {
                let items: Vec<_> = self.items.iter().map(|item| format!("{} ({})", item.index, item.name)).collect();
                format!("use {}", items.join(", "))
            }
        }
    }
}

/// Parses a decimal number, or a hexadecimal one after 0x.
fn parse_number(text: &str) -> Option<i64> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::find_control;
    use super::*;

    fn control(name: &str, kind: Kind, (minimum, maximum, step): (i64, i64, u64)) -> Control {
        Control {
            name: name.to_owned(),
            label: name.to_owned(),
            id: 1,
            kind,
            minimum,
            maximum,
            step,
            default: minimum,
            items: Vec::new(),
            value: None,
            read_only: false,
            inactive: false,
            grabbed: false,
        }
    }

    fn menu(kind: Kind, items: &[(i64, &str)]) -> Control {
        let items = items.iter().map(|(index, name)| Item { index: *index, name: (*name).to_owned() }).collect();
        Control { items, ..control("mode", kind, (0, 9, 1)) }
    }

    #[test]
    fn each_kind_takes_its_own_values() {
        let integer = control("exposure", Kind::Integer, (-10, 10, 5));
        let wide = control("big", Kind::Integer64, (i64::MIN, i64::MAX, 1));
        let bits = control("flags", Kind::Bitmask, (0, 0x8000_0005_u32.into(), 1));
        let text = control("title", Kind::String, (2, 4, 1));
        let holes = menu(Kind::Menu, &[(1, "Manual Mode"), (3, "Aperture Priority Mode"), (4, "50 Hz")]);
        let numbers = menu(Kind::IntegerMenu, &[(0, "100"), (2, "400")]);
        let accepted = [
            (&integer, "-5", -5),
            (&integer, "0xa", 10),
            (&wide, "-9223372036854775808", i64::MIN),
            (&wide, "9223372036854775807", i64::MAX),
            (&bits, "0x80000004", 0x8000_0004),
            (&holes, "3", 3),
            (&holes, "manual mode", 1),
            (&holes, "aperture_priority_mode", 3),
            (&holes, "50 hz", 4),
            (&numbers, "2", 2),
            (&numbers, "400", 2),
        ];
        for (control, text, number) in accepted {
            assert_eq!(control.parse(text).unwrap(), Value::Number(number), "{} {text}", control.name);
        }
        assert_eq!(text.parse("abc").unwrap(), Value::Text("abc".into()));
        let refused = [
            (&integer, "3", "control exposure=3: use -10 to 10 in steps of 5"),
            (&integer, "15", "use -10 to 10"),
            (&integer, "much", "use -10 to 10"),
            (&bits, "2", "use bits of 0x80000005"),
            (&bits, "-1", "use bits"),
            (&text, "a", "2 to 4 bytes"),
            (&text, "abcde", "2 to 4 bytes"),
            (&holes, "2", "use 1 (Manual Mode), 3 (Aperture Priority Mode), 4 (50 Hz)"),
            (&holes, "", "use 1 (Manual Mode)"),
            (&numbers, "1", "use 0 (100), 2 (400)"),
        ];
        for (control, text, message) in refused {
            let error = control.parse(text).unwrap_err().to_string();
            assert!(error.contains(message) && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn yes_and_no_have_several_words() {
        let control = control("flip", Kind::Boolean, (0, 1, 1));
        for (text, number) in [("1", 1), ("on", 1), ("True", 1), ("0", 0), ("OFF", 0), ("no", 0)] {
            assert_eq!(control.parse(text).unwrap(), Value::Number(number));
        }
        assert!(control.parse("2").unwrap_err().to_string().ends_with("use on or off"));
    }

    #[test]
    fn what_cannot_be_set_says_why() {
        let plain = control("gain", Kind::Integer, (0, 9, 1));
        let cases = [
            (Control { read_only: true, ..plain.clone() }, "read-only"),
            (Control { inactive: true, ..plain.clone() }, "automatic mode"),
            (Control { grabbed: true, ..plain.clone() }, "streaming"),
            (Control { kind: Kind::Compound, ..plain }, "table"),
        ];
        for (control, why) in cases {
            let error = control.parse("1").unwrap_err().to_string();
            assert!(error.starts_with("control gain ") && error.contains(why), "{error}");
        }
    }

    #[test]
    fn former_names_lead_to_the_same_control() {
        let new = [control("exposure_dynamic_framerate", Kind::Boolean, (0, 1, 1))];
        let old = [control("exposure_auto_priority", Kind::Boolean, (0, 1, 1))];
        for controls in [&new, &old] {
            assert!(find_control(controls, "exposure_auto_priority").is_some());
            assert!(find_control(controls, "exposure_dynamic_framerate").is_some());
            assert!(find_control(controls, "exposure_auto").is_none());
        }
    }

    #[test]
    fn near_misses_are_suggested() {
        let controls = ["brightness", "contrast", "exposure_time_absolute", "auto_exposure"]
            .map(|name| control(name, Kind::Integer, (0, 9, 1)));
        let message = |name| ControlError::unknown(name, &controls).to_string();
        assert!(message("brightnes").ends_with("did you mean brightness?"), "{}", message("brightnes"));
        assert!(message("exposure").ends_with("did you mean exposure_time_absolute or auto_exposure?"));
        assert!(message("zoom").contains("devices --controls"));
    }
}
