//! Changes of a running instance's look: parsed and validated like the command line.

use std::ffi::OsString;
use std::path::Path;

use clap::{Args, Command};

use super::file::SettingsFile;
use super::table;
use crate::error::CliError;
use crate::log;
use crate::options::LookSettings;
use bokehcam::look::{Patch, presets, settings};

/// Parses settings, each written `NAME=VALUE`, as a patch of a look.
///
/// # Errors
/// Fails if a name is no setting of a look, a value is invalid, settings are repeated or exclude each other, or an
/// aperture's picture cannot be read.
pub fn parse_patch(settings: &[String]) -> Result<Patch, CliError> {
    let pairs = settings.iter().map(|setting| {
        let pair = setting.split_once('=').filter(|(name, _)| !name.is_empty());
        let (name, value) = pair
            .ok_or_else(|| CliError::Usage(format!("'{setting}': write NAME=VALUE, such as blur=3% or focus=auto")))?;
        let name = name.trim_start_matches('-');
        if settings::find_setting(name).is_none() {
            Err(CliError::Usage(unknown_setting(name, value)))
        } else {
            Ok((name, value))
        }
    });
    let pairs = pairs.collect::<Result<Vec<_>, CliError>>()?;
    let command = look_command();
    let flags = pairs.iter().map(|(name, value)| OsString::from(format!("--{name}={value}")));
    command.try_get_matches_from(flags).map_err(|error| CliError::Usage(log::one_line(&error)))?;
    load_patch(Patch::parse(pairs))
}

fn look_command() -> Command {
    let command = Command::new("settings").disable_help_flag(true).no_binary_name(true);
    LookSettings::<true>::augment_args(LookSettings::<false>::augment_args(command))
}

/// Explains why a look has no setting of this name, and the remedy.
fn unknown_setting(name: &str, value: &str) -> String {
    if name == "preset" {
        return format!("a preset is taken by `bokehcam ctl preset {value}`");
    }
    if table::is_setting(name) {
        return format!("'{name}' cannot be changed while it runs: only the look can");
    }
    let near = table::suggest_option(look_command(), name);
    let hint = near.map_or(String::new(), |near| format!(", did you mean {near}?"));
    format!("there is no setting '{name}' of the look{hint}")
}

/// Returns the patch of a preset, built in or from the current settings file, which is read only for one of its own.
///
/// # Errors
/// Fails if the preset does not exist, or the settings file or an aperture's picture cannot be read.
pub fn load_preset(chosen: Option<&Path>, name: &str) -> Result<Patch, CliError> {
    let is_built_in = presets::built_in_presets().any(|preset| preset.name == name);
    let file = if is_built_in { SettingsFile::default() } else { SettingsFile::load(chosen)? };
    let values = file.preset(name).ok_or_else(|| CliError::Usage(file.unknown_preset(name)))?;
    load_patch(Patch::parse(values.iter().map(|(name, value)| (name.as_str(), value.as_str()))))
}

fn load_patch(patch: Result<Patch, (String, String)>) -> Result<Patch, CliError> {
    let mut patch = patch.map_err(|(name, what)| CliError::Usage(format!("{name}: {what}")))?;
    patch.load_pictures()?;
    Ok(patch)
}

#[cfg(test)]
mod tests {

    fn parse_patch(settings: &[&str]) -> Result<Vec<(&'static str, String)>, String> {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        super::parse_patch(&settings).map(|patch| patch.values()).map_err(|error| error.to_string())
    }

    #[test]
    fn settings_are_those_of_the_command_line() {
        let values = parse_patch(&["blur=3%", "focus=auto", "quality=fast"]).unwrap();
        let text = |value: &str| value.to_string();
        assert_eq!(values, [("focus", text("auto")), ("blur", text("3%")), ("quality", text("fast"))]);
        for (bad, said) in [
            (&["rim"][..], "write NAME=VALUE"),
            (&["=3"], "write NAME=VALUE"),
            (&["rim=2"], "invalid value '2' for '--rim <W>': use a number from 0 to 1"),
            (&["rimm=1"], "there is no setting 'rimm' of the look, did you mean rim?"),
            (&["blurr=3%"], "there is no setting 'blurr' of the look, did you mean blur?"),
            (&["zzz=3"], "there is no setting 'zzz' of the look"),
            (&["preset=dreamy"], "`bokehcam ctl preset dreamy`"),
            (&["depth=matte"], "'depth' cannot be changed while it runs"),
            (&["coc-at-infinity=3", "blur=3"], "cannot be used multiple times"),
            (&["mirror=true"], "'mirror' cannot be changed while it runs"),
            (&["effect=big"], "possible values"),
            (&["blur=3%", "f-number=2"], "cannot be used with"),
            (&["rim=0.1", "rim=0.2"], "cannot be used multiple times"),
            (&["aperture=image:/nowhere.png"], "/nowhere.png"),
        ] {
            let refused = parse_patch(bad).unwrap_err();
            assert!(refused.contains(said) && !refused.contains('\n'), "{bad:?}: {refused}");
        }
    }
}
