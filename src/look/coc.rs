//! Rules for the circle of confusion (CoC) of a picture.

use crate::depth::focus::FocusRule;
use crate::frame::DepthMap;
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
    /// The value of a real lens at each focus distance, at least `min_px`.
    Lens {
        /// The lens.
        lens: Lens,
        /// Smallest radius, in pixels.
        min_px: f32,
    },
    /// For relative depth: this much with the focus on the nearest point, in pixels, and less in proportion to the inverse
    /// depth of the focus, as with a lens far from its subject. The CoC is then this much times the difference of
    /// inverse depth to the focus, whatever that is.
    Relative(f32),
}

impl CocAtInfinity {
    /// Returns the CoC as a function of depth, for a picture `width_px` wide, focused at `focus_m` metres with a sharp
    /// range of `range_m` around it.
    pub fn coc_field(self, focus_m: f32, range_m: f32, width_px: u32, max_coc_px: f32) -> CocField {
        let coc_at_infinity_px = match self {
            Self::Px(radius_px) => radius_px,
            Self::Lens { lens, min_px } => lens.coc_at_infinity_px(focus_m, width_px).max(min_px),
            Self::Relative(radius_px) => radius_px * (DepthMap::SUBJECT_M / focus_m).min(1.0),
        };
        CocField::Depth(DepthCoc { coc_at_infinity_px, focus_m, range_m, max_coc_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refocusing_in_relative_depth_keeps_the_lens() {
        let nearness = [1.0, 0.8, 0.5, 0.3, 0.125, 0.05];
        for focus in nearness {
            let focus_m = DepthMap::relative_to_metres(focus);
            let CocField::Depth(coc) = CocAtInfinity::Relative(16.0).coc_field(focus_m, 0.0, 640, 100.0) else {
                unreachable!("the rule is by depth")
            };
            for at in nearness {
                let radius_px = coc.coc_px(DepthMap::relative_to_metres(at));
                assert!((radius_px - 16.0 * (focus - at)).abs() < 1e-4, "{radius_px} px at {at}, focused at {focus}");
            }
        }
    }
}
