//! Conversion of options to a look.

use crate::error::CliError;
use crate::options;
use bokehcam::look::{Look, Patch};

/// Returns the look of the options, before it is limited to the source's abilities.
///
/// # Errors
/// Fails if a lens lacks some of its numbers, or the aperture's picture cannot be read.
pub fn build_look(blur: &options::Blur, quality: &options::LookSettings<true>) -> Result<Look, CliError> {
    let patch = Patch { quality: quality.0.quality, reuse: quality.0.reuse, ..blur.look.0.clone() };
    Ok(patch.apply_to(&Look::default())?)
}

#[cfg(test)]
mod tests;
