//! The networks of a build without the feature `networks`: there are none.

use super::networks::Opened;
use super::{OpenRequest, SingleCameraDepth, SourceError};

pub(super) fn open_networks(_: &SingleCameraDepth, _: &OpenRequest) -> Result<Opened, SourceError> {
    SourceError::usage_error("--depth matte and mono: this build leaves networks out (feature `networks`)")
}

/// Returns none.
pub fn find_each_best() -> SingleCameraDepth {
    SingleCameraDepth::default()
}
