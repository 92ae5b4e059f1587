//! From options to a look.

use crate::error::CliError;
use crate::options;
use bokehcam::look::{Look, Patch};

/// The look that options ask for, whatever the source.
///
/// # Errors
/// A lens is not known by all of its numbers, or the aperture's picture cannot be read.
pub fn look(blur: &options::Blur, quality: &options::LookSettings<true>) -> Result<Look, CliError> {
    let patch = Patch { quality: quality.0.quality, ..blur.look.0.clone() };
    Ok(patch.on(&Look::default())?)
}

#[cfg(test)]
mod tests;
