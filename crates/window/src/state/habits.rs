//! What of the window goes on from run to run, besides the look and the source.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

/// The text scales that can be chosen; 1 is the usual size.
pub const TEXT_SCALES: RangeInclusive<f32> = 0.75..=3.0;

/// How a person has the window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct Habits {
    /// How large text and controls are, in [`TEXT_SCALES`]; 1 is usual.
    pub text_scale: f32,
    /// Whether keys without Ctrl do something: letters, digits and signs.
    pub single_keys: bool,
    /// Whether closing asks first while something is recorded, or calls may have the picture.
    pub ask_before_closing: bool,
    /// Whether snapshots are saved with what is needed to make them again.
    pub keep_sources: bool,
    /// Sections of the panel that were opened or folded, by name.
    pub sections: BTreeMap<String, bool>,
}

impl Default for Habits {
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

impl Habits {
    /// Sets the text scale, as far as it can be.
    pub fn set_text_scale(&mut self, scale: f32) {
        if scale.is_finite() {
            self.text_scale = scale.clamp(*TEXT_SCALES.start(), *TEXT_SCALES.end());
        }
    }

    /// The same with every value in its range, as a file may hold anything.
    pub fn checked(mut self) -> Self {
        let scale = std::mem::replace(&mut self.text_scale, 1.0);
        self.set_text_scale(scale);
        self
    }
}
