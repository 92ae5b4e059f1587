//! Rules for the circle of confusion (CoC) of a picture.

use crate::depth::focus::FocusRule;
use crate::optics::{CocField, DepthCoc, Lens};

/// How the CoC of a frame is determined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CocRule {
    /// The same field for every frame.
    Fixed(CocField),
    /// The thin lens over the frame's depth.
    Depth {
        /// The subject or distance in focus.
        focus: FocusRule,
        /// The CoC at infinity.
        lens: CocAtInfinity,
        /// Everything within half of this on either side of the focal plane is sharp, in metres, >= 0.
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
    /// The value of a real lens at each focus distance.
    Lens(Lens),
}

impl CocAtInfinity {
    /// Returns the CoC as a function of depth, for a picture `width_px` wide, focused at `focus_m` metres with a sharp
    /// range of `range_m` around it.
    pub fn coc_field(self, (focus_m, range_m): (f32, f32), width_px: u32, max_coc_px: f32) -> CocField {
        let coc_at_infinity_px = match self {
            Self::Px(radius_px) => radius_px,
            Self::Lens(lens) => lens.coc_at_infinity_px(focus_m, width_px),
        };
        CocField::Depth(DepthCoc { coc_at_infinity_px, focus_m, range_m, max_coc_px })
    }
}
