//! What is said of an option that a command does not have, and of a command that there is not.

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;

use clap::error::{ContextKind, ErrorKind};
use clap::{Arg, Command, CommandFactory};

use crate::commands::Cli;

/// Options that people try, and what does that.
const MEANT: [(&str, &str); 4] =
    [("background", "behind"), ("output", "out"), ("input-size", "size"), ("strength", "blur")];

/// In more commands than this nobody looks.
const MOST_COMMANDS: usize = 4;

/// The message for an unknown option or command, where there is more to say than clap does.
pub fn said(error: &clap::Error, args: &[OsString]) -> Option<String> {
    let invalid = |kind| Some(error.get(kind)?.to_string());
    match error.kind() {
        ErrorKind::UnknownArgument => unknown_option(error, &invalid(ContextKind::InvalidArg)?, args),
        ErrorKind::InvalidSubcommand => {
            let word = invalid(ContextKind::InvalidSubcommand)?;
            let is_of_models = args.get(1).is_some_and(|arg| arg == "models");
            let is_removal = ["remove", "rm", "delete", "uninstall"].contains(&word.as_str());
            (is_of_models && is_removal)
                .then(|| format!("there is no `models {word}`: delete the file, which `bokehcam models` names"))
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
        let Some(below) = command.find_subcommand(word) else { break };
        path.push(below.get_name());
        command = below;
    }
    let here = path.join(" ");
    let Some(name) = invalid.strip_prefix("--") else {
        if here == "render" && !invalid.starts_with('-') {
            return Some(format!(
                "{invalid}: one picture is blurred at a time; its depth is given by --depth-map FILE"
            ));
        }
        let file = args.iter().find(|arg| arg.as_bytes().starts_with(invalid.as_bytes()) && arg.len() > 2)?;
        let file = file.to_string_lossy();
        return invalid
            .starts_with('-')
            .then(|| format!("there is no option {invalid} ({file}); a file whose name begins with - is ./{file}"));
    };
    if here == "ctl set" {
        return Some(format!("{invalid}: settings are written without dashes, such as `bokehcam ctl set blur=3%`"));
    }
    let of = if here.is_empty() { "here".to_owned() } else { format!("of `{here}`") };
    let none = format!("there is no option {invalid} {of}");
    let has = |command: &Command, name: &str| command.get_arguments().any(|arg| has_name(arg, name));
    let meant = MEANT.iter().find(|(tried, meant)| *tried == name && has(command, meant)).map(|(_, meant)| *meant);
    if let Some(meant) = meant {
        return Some(format!("{none}, did you mean --{meant}?"));
    }
    let mut others = Vec::new();
    with_option(&program, name, &mut Vec::new(), &mut others);
    match others.len() {
        1..=MOST_COMMANDS => Some(format!("{none}: it is for {}", others.join(", "))),
        0 => {
            let suggested = error.get(ContextKind::SuggestedArg);
            Some(suggested.map_or_else(|| none.clone(), |near| format!("{none}, did you mean {near}?")))
        }
        _ => Some(format!("{none}: it is for {} and others", others[..MOST_COMMANDS].join(", "))),
    }
}

fn has_name(arg: &Arg, name: &str) -> bool {
    arg.get_long() == Some(name) || arg.get_all_aliases().is_some_and(|all| all.contains(&name))
}

/// Collects the commands that have an option.
fn with_option<'a>(command: &'a Command, name: &str, path: &mut Vec<&'a str>, found: &mut Vec<String>) {
    if !path.is_empty() && command.get_arguments().any(|arg| has_name(arg, name)) {
        found.push(format!("`{}`", path.join(" ")));
    }
    // Of settings alone `config` has every one.
    for below in command.get_subcommands().filter(|below| !below.is_hide_set() && below.get_name() != "config") {
        path.push(below.get_name());
        with_option(below, name, path, found);
        path.pop();
    }
}
