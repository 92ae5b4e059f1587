//! `config dump`: the settings as a settings file.

use std::fmt::Write;

use super::settings::Setting;

/// The settings in TOML, each under what it does and where its value comes from. Settings without a value of their
/// own are comments.
pub fn as_toml(settings: &[Setting]) -> String {
    let mut text = String::from("# bokehcam settings. Flags and the environment go before this file.\n");
    for setting in settings {
        let Setting { name, value, origin, help } = setting;
        // Writing to a String cannot fail.
        let _ = match value {
            Some(value) => write!(text, "\n# {help}\n{name} = {} # {origin}\n", toml_value(value)),
            None => write!(text, "\n# {help}\n# {name} = # {origin}\n"),
        };
    }
    text
}

/// Numbers and booleans bare, all else in quotes.
fn toml_value(text: &str) -> String {
    let bare: Option<toml::Value> =
        text.parse::<i64>().map(toml::Value::from).ok().or_else(|| text.parse::<bool>().map(toml::Value::from).ok());
    let bare = bare.or_else(|| text.parse::<f64>().ok().filter(|x| x.is_finite()).map(toml::Value::from));
    bare.unwrap_or_else(|| toml::Value::from(text)).to_string()
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
