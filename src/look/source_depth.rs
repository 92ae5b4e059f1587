//! Adapts a look to what its source provides.

use super::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use crate::depth::focus::FocusRule;

/// What is known about a source's depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SourceDepth {
    /// Whether it has depth.
    pub has_depth: bool,
    /// Whether depth is relative, without metres.
    pub is_relative: bool,
    /// Width and height of its pictures; needed if depth is relative.
    pub size: (u32, u32),
}

/// Distance at which relative depth places the nearest points.
const RELATIVE_NEAREST_M: f32 = 1.0;

impl Look {
    /// Adapts the look to a source. Without depth there is no subject to keep sharp, and everything is blurred equally.
    /// With relative depth there are no metres: a focus distance becomes focus on the subject, and a lens becomes the
    /// equivalent amount of blur.
    pub fn for_source(&self, known: SourceDepth) -> Self {
        let mut look = self.clone();
        if look.effect.follows_depth() && !known.has_depth {
            look.effect = Effect::Blur;
        }
        if known.has_depth && known.is_relative {
            if let Strength::Lens(lens) = look.strength {
                let (width, height) = known.size;
                look.strength =
                    Strength::from_fraction(lens.coc_at_infinity_px(RELATIVE_NEAREST_M, width) / height.max(1) as f32);
            }
            if matches!(look.focus, FocusRule::Metres(_)) {
                look.focus = FocusRule::Auto;
            }
            look.focus_range_m = 0.0;
        }
        look
    }
}

impl Strength {
    /// Returns the strength for a CoC at infinity as a fraction of the picture's height; the default if it is close to
    /// that.
    pub fn from_fraction(fraction: f32) -> Self {
        // In percent with two decimals: finer differences are invisible.
        let percent = |fraction: f32| (fraction * 1e4).round() / 1e2;
        match percent(fraction) {
            usual if (usual - percent(COC_AT_INFINITY_PER_HEIGHT)).abs() < 0.011 => Self::Default,
            other => Self::Percent(other.min(MAX_COC_PER_HEIGHT * 100.0)),
        }
    }
}
