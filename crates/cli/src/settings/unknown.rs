//! Messages for unknown options and commands.

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;

use clap::error::{ContextKind, ErrorKind};
use clap::{Arg, Command, CommandFactory};

use crate::commands::Cli;

/// Plausible wrong names of options, and the right ones.
const SYNONYMS: [(&str, &str); 5] =
    [("background", "behind"), ("output", "out"), ("o", "out"), ("input-size", "size"), ("strength", "blur")];

/// Maximum number of commands that a message lists.
const MAX_COMMANDS: usize = 4;

/// Returns the message for an unknown option or command, if it can say more than clap's.
pub fn explain_unknown(error: &clap::Error, args: &[OsString]) -> Option<String> {
    let invalid = |kind| Some(error.get(kind)?.to_string());
    match error.kind() {
        ErrorKind::UnknownArgument => unknown_option(error, &invalid(ContextKind::InvalidArg)?, args),
        ErrorKind::InvalidSubcommand => {
            let word = invalid(ContextKind::InvalidSubcommand)?;
            let is_of_models = args.get(1).is_some_and(|arg| arg == "models");
            let is_removal = ["remove", "rm", "delete", "uninstall"].contains(&word.as_str());
            (is_of_models && is_removal)
                .then(|| format!("there is no `models {word}`: delete the file that `bokehcam models` shows"))
        }
        _ => None,
    }
}

fn unknown_option(error: &clap::Error, invalid: &str, args: &[OsString]) -> Option<String> {
    let program = Cli::command();
    let words: Vec<&str> = args.iter().skip(1).filter_map(|arg| arg.to_str()).collect();
    let mut path = Vec::new();
    let mut command = &program;
    for word in words.iter().filter(|word| !word.starts_with('-')) {
        let Some(subcommand) = command.find_subcommand(word) else { break };
        path.push(subcommand.get_name());
        command = subcommand;
    }
    // The command path, such as `config dump`, selects the hint.
    let here = path.join(" ");
    let is_long = invalid.starts_with("--");
    if !is_long && !invalid.starts_with('-') {
        let what = format!("{invalid}: `render` blurs one picture; its depth is given by --depth-map FILE");
        return (here == "render").then_some(what);
    }
    let is_bundle = |arg: &&OsString| !is_long && arg.as_bytes().starts_with(invalid.as_bytes()) && arg.len() > 2;
    if let Some(file) = args.iter().find(is_bundle).map(|file| file.to_string_lossy()) {
        return Some(format!("there is no option {invalid} ({file}); a file whose name begins with - is ./{file}"));
    }
    if is_long && here == "ctl set" {
        return Some(format!("{invalid}: settings are written without dashes, such as `bokehcam ctl set blur=3%`"));
    }
    let name = invalid.trim_start_matches('-');
    let of = if here.is_empty() { "here".to_owned() } else { format!("of `{here}`") };
    let none = format!("there is no option {invalid} {of}");
    let has = |command: &Command, name: &str| command.get_arguments().any(|arg| has_name(arg, name));
    let meant = SYNONYMS.iter().find(|(tried, meant)| *tried == name && has(command, meant)).map(|(_, meant)| *meant);
    if let Some(meant) = meant {
        return Some(format!("{none}, did you mean --{meant}?"));
    }
    let mut others = Vec::new();
    collect_with_option(&program, name, &mut Vec::new(), &mut others);
    match others.len() {
        1..=MAX_COMMANDS => Some(format!("{none}: it is for {}", others.join(", "))),
        0 if is_long => {
            let suggested = error.get(ContextKind::SuggestedArg);
            Some(suggested.map_or_else(|| none.clone(), |near| format!("{none}, did you mean {near}?")))
        }
        0 => Some(none),
        _ => Some(format!("{none}: it is for {} and others", others[..MAX_COMMANDS].join(", "))),
    }
}

fn has_name(arg: &Arg, name: &str) -> bool {
    arg.get_long() == Some(name) || arg.get_all_aliases().is_some_and(|all| all.contains(&name))
}

/// Collects the commands with the option `name`.
fn collect_with_option<'a>(command: &'a Command, name: &str, path: &mut Vec<&'a str>, found: &mut Vec<String>) {
    if !path.is_empty() && command.get_arguments().any(|arg| has_name(arg, name)) {
        found.push(format!("`{}`", path.join(" ")));
    }
    // `config` has every setting.
    let is_listed = |subcommand: &&Command| !subcommand.is_hide_set() && subcommand.get_name() != "config";
    for subcommand in command.get_subcommands().filter(is_listed) {
        path.push(subcommand.get_name());
        collect_with_option(subcommand, name, path, found);
        path.pop();
    }
}
