//! Help pages: the first one has the common options, and `--help-all` shows all.

use clap::{Arg, Command, Id};

use super::settings::table::{WINDOW_START, WINDOW_STATE, all_settings_command};

/// Option that shows all pages.
pub const ALL: &str = "--help-all";

/// Settings on the first page of each command that has them; those of a window only for `preview`.
const FIRST_PAGE: [&str; 20] = [
    "size",
    "fps",
    "loop",
    "frames",
    "preset",
    "depth",
    "effect",
    "focus",
    "blur",
    "behind",
    "follow",
    "aperture",
    "highlights",
    "side-by-side",
    "calib",
    "quality",
    "on-demand",
    "mirror",
    "force",
    "full-screen",
];
/// Further settings on the first page of single commands.
const FIRST_PAGE_EXTRA: [(&str, &[&str]); 5] = [
    ("preview", &["split", "fresh"]),
    ("render", &["depth-unit", "depth-scale", "tilt"]),
    ("record", &["start", "end", "depth-scale"]),
    ("dump", &["backend", "threads"]),
    ("save", &["backend", "threads"]),
];
/// Options of single commands that are not on their first page: not settings, or of little use there.
const LATER_PAGES: [(&str, &[&str]); 6] = [
    ("stream", &["name", "tray"]),
    ("preview", &["name", "loop", "frames", "on-demand"]),
    ("render", &["mask-grow", "mask-feather", "out-format"]),
    ("bench", &["preset", "depth", "effect", "focus", "blur", "behind", "follow", "aperture", "highlights"]),
    ("plate", &["loop", "frames"]),
    ("bokehcam", &["log-format", "config"]),
];
/// Settings without use for a single picture.
const STREAM_ONLY: [&str; 3] = ["follow", "background-memory", "depth-calibration"];

/// Help of `--depth` for a single picture.
const PICTURE_DEPTH: &str = "\
Where depth comes from:
  auto          NAME-depth.png or .pfm beside the picture NAME, else an installed network
  recorded      only the file beside it
  none          no depth, for effects that need none
  matte[:FILE]  a network that finds the person: FILE.onnx, or the best that is installed
  mono[:FILE]   a network that estimates distances; matte,mono is both together
  plate:FILE    a picture of the background without the person
  defocus       the slight defocus of the picture itself, which is magnified";

/// Sets the help texts of `render`; all options stay visible.
pub fn full_help(command: Command) -> Command {
    command.mut_subcommand("render", |render| {
        render.mut_args(|arg| match arg.get_long() {
            Some(name) if STREAM_ONLY.contains(&name) => arg.hide(true),
            Some("depth") => arg
                .help("Where depth comes from: auto, matte, mono, plate:FILE, defocus or none")
                .long_help(PICTURE_DEPTH),
            _ => arg,
        })
    })
}

/// Hides the options that are not on the first pages.
pub fn short_help(command: Command) -> Command {
    let settings = all_settings_command();
    let ids: Vec<&Id> = settings.get_arguments().map(Arg::get_id).collect();
    hide_options(command, &ids)
}

fn hide_options(command: Command, settings: &[&Id]) -> Command {
    let name = command.get_name().to_owned();
    let is_in = |table: &[(&str, &[&str])], option: &str| {
        table.iter().any(|(command, options)| *command == name && options.contains(&option))
    };
    let is_windows = |option: &str| WINDOW_STATE.contains(&option) || WINDOW_START.contains(&option);
    let is_first = |option: &str| FIRST_PAGE.contains(&option) && (name == "preview" || !is_windows(option));
    let is_more = |arg: &Arg| {
        let option = arg.get_long().unwrap_or_default();
        let is_listed = !settings.contains(&arg.get_id()) || is_first(option) || is_in(&FIRST_PAGE_EXTRA, option);
        !arg.is_hide_set() && (!is_listed || is_in(&LATER_PAGES, option))
    };
    let more = command.get_arguments().filter(|arg| is_more(arg)).count();
    let command = command.mut_args(|arg| if is_more(&arg) { arg.hide(true) } else { arg });
    let rest = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let command = if more == 0 { command } else { command.after_help(format!("{more} more options: {ALL}\n\n{rest}")) };
    command.mut_subcommands(|subcommand| hide_options(subcommand, settings))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::Cli;
    use clap::CommandFactory;

    fn visible_options(command: &Command) -> Vec<String> {
        let shown = command.get_arguments().filter(|arg| !arg.is_hide_set());
        shown.filter_map(|arg| arg.get_long().map(str::to_owned)).collect()
    }

    /// Builds the command `path` with its first page only, and with all options.
    fn pages(path: &[&str]) -> [Command; 2] {
        [short_help(full_help(Cli::command())), full_help(Cli::command())].map(|mut command| {
            command.build();
            path.iter().fold(command, |command, name| command.find_subcommand(name).unwrap().clone())
        })
    }

    fn is_left_out(path: &[&str]) -> bool {
        path == ["preview"] && !cfg!(feature = "window")
    }

    #[test]
    fn first_pages_are_short_and_nothing_is_missing_on_the_last() {
        for path in [
            &["stream"][..],
            &["preview"],
            &["render"],
            &["bench"],
            &["record"],
            &["plate"],
            &["depth"],
            &["config", "dump"],
            &["config", "save"],
            &["ctl", "on"],
        ] {
            if is_left_out(path) {
                continue;
            }
            let [few, all] = pages(path);
            let (few, all) = (visible_options(&few), visible_options(&all));
            assert!(few.len() <= 25, "{path:?}: {} of {}: {few:?}", few.len(), all.len());
            assert!(few.iter().all(|option| all.contains(option)), "{path:?}");
            let command = pages(path)[1].clone();
            let useless = |option: &str| path == ["render"] && STREAM_ONLY.contains(&option);
            for option in command.get_arguments().filter_map(Arg::get_long) {
                assert!(all.iter().any(|shown| shown == option) || useless(option), "{path:?}: {option}");
            }
        }
        assert!(visible_options(&pages(&["ctl", "on"])[0]).len() <= 5);
    }

    #[test]
    fn every_option_of_the_tables_is_there() {
        for (name, options) in FIRST_PAGE_EXTRA.iter().chain(&LATER_PAGES) {
            let path: &[&str] = match *name {
                "bokehcam" => &[],
                "dump" | "save" => &["config", name],
                _ => &[name],
            };
            if is_left_out(path) {
                continue;
            }
            let [_, whole] = pages(path);
            for option in *options {
                assert!(whole.get_arguments().any(|arg| arg.get_long() == Some(option)), "{name}: {option}");
            }
        }
    }
}
