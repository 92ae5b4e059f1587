//! `config dump`: the settings as a settings file.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::file::PRESETS;
use super::layers::Setting;
use super::table::Values;

/// Formats the settings as TOML, each with its help above and its origin behind it, then the presets of the file.
/// Settings without a value are commented out, and so is `preset`, whose values are all in the list already.
pub fn to_toml(settings: &[Setting], presets: &BTreeMap<String, Values>) -> String {
    let mut text = String::from("# bokehcam settings. Flags and the environment go before this file.\n");
    for setting in settings {
        let Setting { name, value, origin, help } = setting;
        // Writing to a String cannot fail.
        let _ = match value {
            Some(value) if name == "preset" => {
                write!(text, "\n# {help}\n# {name} = {} # {origin}\n", toml_value(value))
            }
            Some(value) => write!(text, "\n# {help}\n{name} = {} # {origin}\n", toml_value(value)),
            None => write!(text, "\n# {help}\n# {name} = # {origin}\n"),
        };
    }
    for (name, values) in presets {
        let _ = writeln!(text, "\n[{PRESETS}.{}]", toml_edit::Key::new(name).display_repr());
        for (name, value) in values {
            let _ = writeln!(text, "{name} = {}", toml_value(value));
        }
    }
    text
}

/// Formats a value as TOML: numbers and booleans bare, others in quotes.
fn toml_value(text: &str) -> String {
    toml_number(text).unwrap_or_else(|| toml_edit::Value::from(text)).to_string()
}

/// Parses `text` as a TOML number or boolean, if it is one.
pub fn toml_number(text: &str) -> Option<toml_edit::Value> {
    let whole = text.parse::<i64>().map(toml_edit::Value::from).ok();
    let whole = whole.or_else(|| text.parse::<bool>().map(toml_edit::Value::from).ok());
    whole.or_else(|| text.parse::<f64>().ok().filter(|x| x.is_finite()).map(toml_edit::Value::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_kind() {
        for (text, toml) in [("3", "3"), ("0.2", "0.2"), ("true", "true"), ("disc", "\"disc\""), ("inf", "\"inf\"")] {
            assert_eq!(toml_value(text), toml);
        }
        assert_eq!(toml_value("a\"b\\"), r#"'a"b\'"#);
    }
}
