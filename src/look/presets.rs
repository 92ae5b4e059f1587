//! The looks that are built in: each nothing but settings.

/// A built-in preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltIn {
    /// Its name.
    pub name: &'static str,
    /// Its settings, by their flags without the dashes. What it does not set stays: where the focus is, how finely it
    /// is blurred, what depth is fitted to.
    pub settings: &'static [(&'static str, &'static str)],
}

/// The built-in presets, in the order in which they are shown.
pub const BUILT_IN: [BuiltIn; 5] = [
    BuiltIn {
        name: "portrait",
        settings: &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "0"),
            ("coc-at-infinity", "auto"),
            ("focus-range", "0"),
        ],
    },
    // Rounded blades, a crisp edge, lights that glow.
    BuiltIn {
        name: "cinematic",
        settings: &[
            ("effect", "auto"),
            ("aperture", "polygon:6:15:0.4"),
            ("intensity", "0"),
            ("rim", "0.1"),
            ("highlights", "6"),
            ("coc-at-infinity", "3.2%"),
            ("focus-range", "0"),
        ],
    },
    // Discs that fade out, much of them.
    BuiltIn {
        name: "dreamy",
        settings: &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0.8"),
            ("rim", "0.5"),
            ("highlights", "3"),
            ("coc-at-infinity", "4.5%"),
            ("focus-range", "0"),
        ],
    },
    // The whole of a thing in the hand, and of the hand.
    BuiltIn {
        name: "product",
        settings: &[
            ("effect", "auto"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "0"),
            ("coc-at-infinity", "1.6%"),
            ("focus-range", "0.3"),
        ],
    },
    BuiltIn {
        name: "miniature",
        settings: &[
            ("effect", "tilt-shift"),
            ("tilt", "0.55:0.2:0"),
            ("aperture", "disc"),
            ("intensity", "0"),
            ("rim", "0.2"),
            ("highlights", "2"),
            ("coc-at-infinity", "3%"),
            ("focus-range", "0"),
        ],
    },
];

/// The built-in preset of this name.
pub fn built_in(name: &str) -> Option<&'static BuiltIn> {
    BUILT_IN.iter().find(|preset| preset.name == name)
}
