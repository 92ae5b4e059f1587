//! Presets: looks by name.

use super::Patch;

/// A look by name: it changes what it sets of another look.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// Its name.
    pub name: String,
    /// Its settings.
    pub patch: Patch,
    /// Whether the user made it; else it is built in.
    pub own: bool,
}

/// The built-in presets, in the order in which they are shown. What they do not set stays: where the focus is, how
/// finely it is blurred, what depth is fitted to.
const BUILT_IN: [(&str, &[(&str, &str)]); 5] = [
    (
        "portrait",
        &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "0"),
            ("blur", "auto"),
            ("focus-range", "0"),
        ],
    ),
    // Rounded blades, a crisp edge, lights that glow.
    (
        "cinematic",
        &[
            ("effect", "auto"),
            ("aperture", "polygon:6:15:0.4"),
            ("intensity", "0"),
            ("rim", "0.1"),
            ("highlights", "6"),
            ("blur", "3.2%"),
            ("focus-range", "0"),
        ],
    ),
    // Discs that fade out, much of them.
    (
        "dreamy",
        &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0.8"),
            ("rim", "0.5"),
            ("highlights", "3"),
            ("blur", "4.5%"),
            ("focus-range", "0"),
        ],
    ),
    // A sharp range of 0.3 m: a thing in the hand, and the hand.
    (
        "product",
        &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "0"),
            ("blur", "1.6%"),
            ("focus-range", "0.3"),
        ],
    ),
    (
        "miniature",
        &[
            ("effect", "tilt-shift"),
            ("tilt", "0.55:0.2:0"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "2"),
            ("blur", "3%"),
            ("focus-range", "0"),
        ],
    ),
];

/// The built-in presets, in the order in which they are shown.
pub fn built_in() -> impl Iterator<Item = Preset> {
    BUILT_IN.iter().map(|(name, settings)| Preset {
        name: (*name).to_string(),
        patch: Patch::parse(settings.iter().copied()).unwrap_or_default(),
        own: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_settings_of_built_in_presets_are_read() {
        for ((_, settings), preset) in BUILT_IN.iter().zip(built_in()) {
            let mut values = preset.patch.values();
            let mut written: Vec<_> = settings.iter().map(|(name, text)| (*name, (*text).to_string())).collect();
            values.sort_unstable();
            written.sort_unstable();
            assert_eq!(values, written);
        }
    }
}
