//! Conversion of options to a look.

use super::layers::GivenSettings;
use crate::error::CliError;
use crate::log;
use crate::options;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::settings::find_setting;
use bokehcam::look::{Change, Look, LookFacts, Patch};

/// The look that a command line asks for.
pub struct RequestedLook {
    /// The look, before it is limited to the source's abilities.
    pub look: Look,
    change: Change,
}

impl RequestedLook {
    /// Reads the look of the options; `given` says which settings come from a preset.
    ///
    /// # Errors
    /// See [`build_look`].
    pub fn new(
        blur: &options::Blur,
        quality: &options::LookSettings<true>,
        given: &GivenSettings,
    ) -> Result<Self, CliError> {
        let look = build_look(blur, quality)?;
        let patch = blur.look.0.clone();
        let mut asked = patch.clone();
        let of_preset = given.settings.iter().filter(|setting| setting.origin == "preset");
        of_preset.filter_map(|setting| find_setting(&setting.name)).for_each(|setting| setting.clear_in(&mut asked));
        Ok(Self { look, change: Change { patch, asked } })
    }

    /// Returns the look for which a source is opened: without the metres of a preset, as the source may lack them.
    pub fn for_opening(&self) -> Look {
        match self.change.asked.metric_settings(false).is_empty() {
            true => self.look.clone().without_metres((0, 0)),
            false => self.look.clone(),
        }
    }

    /// Returns the look as far as a run can have it, and logs notes on what is left out, and on a blur that is too small
    /// for privacy. The focus that was `found` in a photo replaces an automatic one.
    ///
    /// # Errors
    /// The run cannot have what is asked for.
    pub fn fit(&self, found: Option<FocusRule>, facts: &LookFacts) -> Result<Look, CliError> {
        let mut change = self.change.clone();
        if self.look.focus == FocusRule::Auto {
            change.patch.focus = found.or(change.patch.focus);
        }
        let (look, note) = self.look.change(&change, facts)?;
        let small_blur = look.small_blur(facts.size).map(|small| small.to_string());
        note.iter().chain(&small_blur).for_each(|line| log::note(line));
        Ok(look)
    }
}

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
