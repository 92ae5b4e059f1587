//! By how much a picture is blurred: the circle of confusion (CoC) of its points.

use crate::depth::focus::FocusRule;
use crate::optics::{CocField, DepthCoc, Lens};

/// Where the CoC of a frame comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CocRule {
    /// The same field for every frame.
    Fixed(CocField),
    /// The thin lens over the frame's depth.
    Depth {
        /// What the lens is focused on.
        focus: FocusRule,
        /// How large the CoC grows.
        lens: CocAtInfinity,
        /// All within half of this to either side of the focal plane is sharp, in metres, >= 0.
        range_m: f32,
        /// Largest CoC radius, in pixels.
        max_coc_px: f32,
    },
}

/// The CoC radius of a point at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CocAtInfinity {
    /// The same at every focus distance, in pixels.
    Px(f32),
    /// What a real lens gives at each focus distance.
    Lens(Lens),
}

impl CocAtInfinity {
    /// The CoC over depth of a picture `width_px` wide, focused at `focus_m` metres, with a sharp range of `range_m`
    /// around.
    pub fn field(self, (focus_m, range_m): (f32, f32), width_px: u32, max_coc_px: f32) -> CocField {
        let coc_at_infinity_px = match self {
            Self::Px(radius_px) => radius_px,
            Self::Lens(lens) => lens.coc_at_infinity_px(focus_m, width_px),
        };
        CocField::Depth(DepthCoc { coc_at_infinity_px, focus_m, range_m, max_coc_px })
    }
}
