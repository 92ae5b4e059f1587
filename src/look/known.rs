//! What a source allows of a look.

use super::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use crate::depth::focus::FocusRule;

/// What a source knows of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Whether it has any.
    pub has_depth: bool,
    /// Whether that is relative: nothing of it is known in metres.
    pub is_relative: bool,
    /// Width and height of its pictures; needed where depth is relative.
    pub size: (u32, u32),
}

/// Where relative depth puts what is nearest.
const NEAREST_M: f32 = 1.0;

impl Look {
    /// The look as far as a source allows it. Without depth, nobody knows what to keep sharp, and all is blurred alike. With
    /// relative depth there are no metres: the subject is in focus in place of a distance, and a lens blurs as much by amount.
    pub fn for_source(&self, known: Known) -> Self {
        let mut look = self.clone();
        if look.effect.follows_depth() && !known.has_depth {
            look.effect = Effect::Blur;
        }
        if known.has_depth && known.is_relative {
            if let Strength::Lens(lens) = look.strength {
                let (width, height) = known.size;
                look.strength = Strength::of_share(lens.coc_at_infinity_px(NEAREST_M, width) / height.max(1) as f32);
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
    /// The strength without a lens that blurs by this share of the height: the default where it is as good as that.
    pub fn of_share(share: f32) -> Self {
        // In percent, to a hundredth: finer nobody sees.
        let percent = |share: f32| (share * 1e4).round() / 1e2;
        match percent(share) {
            usual if (usual - percent(COC_AT_INFINITY_PER_HEIGHT)).abs() < 0.011 => Self::Default,
            other => Self::Percent(other.min(MAX_COC_PER_HEIGHT * 100.0)),
        }
    }
}
