//! Presets: named looks.

use super::Patch;

/// A named look: the settings that it changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// Its name.
    pub name: String,
    /// Its settings.
    pub patch: Patch,
    /// Whether the user created it; otherwise it is built in.
    pub is_user_defined: bool,
}

/// The built-in presets, in display order. They leave some settings as they are: focus, quality and refinement.
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
    // Rounded blades, a crisp edge, glowing highlights.
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
    // Large discs that fade out.
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
    // A sharp range of 0.3 m, for an object and the hand that holds it.
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

/// Returns the built-in presets, in display order.
pub fn built_in_presets() -> impl Iterator<Item = Preset> {
    BUILT_IN.iter().map(|(name, settings)| Preset {
        name: (*name).to_string(),
        patch: Patch::parse(settings.iter().copied()).unwrap_or_default(),
        is_user_defined: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_settings_of_built_in_presets_are_read() {
        for ((_, settings), preset) in BUILT_IN.iter().zip(built_in_presets()) {
            let mut values = preset.patch.values();
            let mut written: Vec<_> = settings.iter().map(|(name, text)| (*name, (*text).to_string())).collect();
            values.sort_unstable();
            written.sort_unstable();
            assert_eq!(values, written);
        }
    }
}
