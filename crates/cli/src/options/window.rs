//! Options for the initial state of a window.

use std::path::PathBuf;

use clap::Args;

use crate::options::named_value_parser;
use bokehcam::look::number::{in_range_parser, parse_switch};
use bokehcam_window::state::{TEXT_SCALE_RANGE, ViewMode};
use bokehcam_window::window::ThemeChoice;

/// What a window shows first; all of it can be changed there.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Window")]
pub struct Window {
    /// View of each frame
    #[arg(long, value_parser = named_value_parser::<ViewMode>(), value_name = "WHAT", default_value = "picture")]
    pub show: ViewMode,
    /// Show the picture before the blur, left of this fraction of its width
    #[arg(long, value_name = "FRACTION", value_parser = in_range_parser(0.0..=1.0))]
    pub split: Option<f32>,
    /// Fill the screen
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub full_screen: bool,
    /// Show the controls; --panel=false starts without them
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = true,
          default_missing_value = "true", value_parser = parse_switch, action = clap::ArgAction::Set)]
    pub panel: bool,
    /// Size of text and controls; 1 is normal [default: that of the last session]
    #[arg(long, value_name = "TIMES", value_parser = in_range_parser(TEXT_SCALE_RANGE))]
    pub text_scale: Option<f32>,
    /// Enable shortcuts without Ctrl; --single-keys=false is for speech input [default: that of the last session]
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_missing_value = "true",
          value_parser = parse_switch)]
    pub single_keys: Option<bool>,
    /// Language of the window's texts, such as de, or a file with a translation [default: the environment's]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub language: Option<String>,
    /// Ignore the last session (look, source, sizes), and keep its record unchanged
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = parse_switch, hide_default_value = true)]
    pub fresh: bool,
    /// Light or dark colours
    #[arg(long, value_parser = named_value_parser::<ThemeChoice>(), value_name = "WHICH", default_value = "auto")]
    pub theme: ThemeChoice,
    /// Folder for snapshots and recordings [default: the user's folders for pictures and videos]
    #[arg(long, value_name = "DIR")]
    pub save_to: Option<PathBuf>,
}
