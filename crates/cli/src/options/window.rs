//! Options for the initial state of a window.

use std::path::PathBuf;

use clap::Args;
use clap::builder::BoolishValueParser;

use crate::options::named;
use bokehcam::look::number::within;
use bokehcam_window::state::{Shown, TEXT_SCALES};
use bokehcam_window::window::ThemeChoice;

/// What a window shows first; all of it can be changed there.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Window")]
pub struct Window {
    /// What of each frame is shown
    #[arg(long, value_parser = named::<Shown>(), value_name = "WHAT", default_value = "picture")]
    pub show: Shown,
    /// Show the picture as it was before the blur, left of this fraction of its width
    #[arg(long, value_name = "FRACTION", value_parser = within(0.0..=1.0))]
    pub split: Option<f32>,
    /// Fill the screen
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub full_screen: bool,
    /// Show frame times, latency and drops
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub instruments: bool,
    /// Show the controls; --panel=false begins without
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = true,
          default_missing_value = "true", value_parser = BoolishValueParser::new(),
          action = clap::ArgAction::Set, hide_possible_values = true)]
    pub panel: bool,
    /// Size of text and controls, 1 as usual [default: as it was last]
    #[arg(long, value_name = "TIMES", value_parser = within(TEXT_SCALES))]
    pub text_scale: Option<f32>,
    /// Let keys without Ctrl do something; --single-keys=false for who speaks to the computer [default: as it was last]
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_missing_value = "true",
          value_parser = BoolishValueParser::new(), hide_possible_values = true)]
    pub single_keys: Option<bool>,
    /// Language of the window's texts, such as de, or a file with a translation [default: the environment's]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub language: Option<String>,
    /// Begin with nothing remembered (look, source, sizes), and leave that as it is
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_value_t = false,
          default_missing_value = "true", value_parser = BoolishValueParser::new(), hide_default_value = true,
          hide_possible_values = true)]
    pub fresh: bool,
    /// Light or dark colours
    #[arg(long, value_parser = named::<ThemeChoice>(), value_name = "WHICH", default_value = "auto")]
    pub theme: ThemeChoice,
    /// Where snapshots and recordings go [default: the user's folders of pictures and of videos]
    #[arg(long, value_name = "DIR")]
    pub save_to: Option<PathBuf>,
}
