//! Window settings that persist between runs, besides the look and the source.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

/// Valid text scales; 1 is the default.
pub const TEXT_SCALE_RANGE: RangeInclusive<f32> = 0.75..=3.0;

/// Persistent preferences of the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct Preferences {
    /// Scale of text and controls, within [`TEXT_SCALE_RANGE`].
    pub text_scale: f32,
    /// Whether bindings of single letters, digits and signs (without Ctrl) are enabled.
    pub single_keys: bool,
    /// Whether closing asks for confirmation while an output is active.
    pub ask_before_closing: bool,
    /// Whether snapshots include the input images and settings that reproduce them.
    pub keep_sources: bool,
    /// Sections of the panel that the user unfolded (true) or folded (false), by name.
    pub sections: BTreeMap<String, bool>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            text_scale: 1.0,
            single_keys: true,
            ask_before_closing: true,
            keep_sources: false,
            sections: BTreeMap::new(),
        }
    }
}

impl Preferences {
    /// Sets the text scale, clamped to [`TEXT_SCALE_RANGE`].
    pub fn set_text_scale(&mut self, scale: f32) {
        if scale.is_finite() {
            self.text_scale = scale.clamp(*TEXT_SCALE_RANGE.start(), *TEXT_SCALE_RANGE.end());
        }
    }

    /// Returns the settings with every value in range: a file may contain anything.
    pub fn into_valid(mut self) -> Self {
        let scale = std::mem::replace(&mut self.text_scale, 1.0);
        self.set_text_scale(scale);
        self
    }
}
