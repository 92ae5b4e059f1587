//! Command-line options for the settings of a look, generated from their table.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

use bokehcam::look::settings::{Choice, Group, Setting};
use bokehcam::look::{Patch, SETTINGS};
use bokehcam::names::Named;

/// Settings of a look: the quality settings if `QUALITY`, else all others.
#[derive(Clone, Debug, Default)]
pub struct LookSettings<const QUALITY: bool>(pub Patch);

impl<const QUALITY: bool> LookSettings<QUALITY> {
    fn list_settings() -> impl Iterator<Item = &'static Setting> {
        SETTINGS.iter().filter(|setting| (setting.group == Group::Computing) == QUALITY)
    }
}

impl<const QUALITY: bool> Args for LookSettings<QUALITY> {
    fn augment_args(command: Command) -> Command {
        command.args(Self::list_settings().map(create_option))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<const QUALITY: bool> FromArgMatches for LookSettings<QUALITY> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut found = Self::default();
        found.update_from_arg_matches(matches)?;
        Ok(found)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for setting in Self::list_settings() {
            if let Some(text) = matches.get_one::<String>(setting.id) {
                setting
                    .parse_into(&mut self.0, text)
                    .map_err(|what| clap::Error::raw(clap::error::ErrorKind::InvalidValue, what))?;
            }
        }
        Ok(())
    }
}

/// Returns the command-line option of a setting; the value stays text, and is only checked here.
fn create_option(setting: &'static Setting) -> Arg {
    let heading = match setting.group {
        Group::Blur => "Blur",
        Group::Aperture => "Aperture",
        Group::Computing => "Computing",
    };
    let excluded =
        SETTINGS.iter().filter(|other| setting.excluded_settings().contains(&other.name)).map(|other| other.id);
    let choices = (setting.choices)();
    let arg = Arg::new(setting.id)
        .long(setting.name)
        .value_name(setting.value)
        .help(setting.help.trim_start())
        .help_heading(heading)
        .conflicts_with_all(excluded);
    let arg = match setting.alias() {
        Some(alias) => arg.alias(alias),
        None => arg,
    };
    let arg = match setting.default() {
        Some(default) => arg.default_value(default),
        None => arg,
    };
    match choices.is_empty() {
        true => arg
            .value_parser(move |text: &str| setting.parse_into(&mut Patch::default(), text).map(|()| text.to_string())),
        false => {
            let value = |choice: Choice| PossibleValue::new(choice.name).help(choice.help).aliases(choice.former_names);
            arg.value_parser(PossibleValuesParser::new(choices.into_iter().map(value)))
        }
    }
}

/// Returns a parser for the names of `T`'s values.
pub fn named_value_parser<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let possible = |value: &T| PossibleValue::new(value.name()).help(value.help()).aliases(value.former_names());
    PossibleValuesParser::new(T::VALUES.iter().map(possible)).try_map(|name| bokehcam::names::parse_name::<T>(&name))
}
