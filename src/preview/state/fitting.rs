//! A look as far as a source allows it.

use super::tweak;
use crate::depth::focus::FocusRule;
use crate::look::{Effect, Look, Strength};

/// What a source knows of depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Whether it has any.
    pub has_depth: bool,
    /// Whether that is relative: nothing of it is known in metres.
    pub is_relative: bool,
    /// Width and height of its pictures.
    pub size: (u32, u32),
}

/// Without depth a portrait is the picture as it is: nobody knows whom to keep sharp. With relative depth there are no metres:
/// the subject is in focus in place of a distance, and a lens blurs as much by amount.
pub fn fitted(look: &Look, known: Known) -> Look {
    let mut look = look.clone();
    if look.effect.follows_depth() && !known.has_depth {
        look.effect = Effect::None;
    }
    if known.has_depth && known.is_relative {
        if let Strength::Lens(lens) = look.strength {
            look.strength = tweak::strength_of(tweak::amount_of(lens, NEAREST_M, known.size));
        }
        if matches!(look.focus, FocusRule::Metres(_)) {
            look.focus = FocusRule::Auto;
        }
        look.focus_range_m = 0.0;
    }
    look
}

/// Where relative depth puts what is nearest.
const NEAREST_M: f32 = 1.0;
