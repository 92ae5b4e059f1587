//! Options that turn, flip and cut a source's pictures.

use clap::Args;

use bokehcam::frame::transform::{Area, Flip, Rotation, Transform};
use bokehcam::names;

/// How a source's pictures are turned, flipped and cut, before anything else is done with them.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "Source")]
pub struct Orientation {
    /// Turn the source's pictures clockwise by 0, 90, 180 or 270 degrees, for a camera on its side or upside down
    #[arg(long, value_name = "DEGREES", value_parser = names::parse_name::<Rotation>,
          default_value = "0", hide_default_value = true)]
    pub rotate: Rotation,
    /// Flip the source's pictures after --rotate: horizontal swaps left and right, vertical top and bottom, or none
    #[arg(long, value_name = "HOW", value_parser = names::parse_name::<Flip>,
          default_value = "none", hide_default_value = true)]
    pub flip: Flip,
    /// Keep only this part of the source's pictures, in pixels after --rotate and --flip: size, then column and row of
    /// its top left corner
    #[arg(long, value_name = "WxH+X+Y")]
    pub crop: Option<Area>,
}

impl Orientation {
    /// Returns the transform of the pictures.
    pub fn transform(&self) -> Transform {
        let Self { rotate: rotation, flip, crop: area } = *self;
        Transform { rotation, flip, area }
    }
}
