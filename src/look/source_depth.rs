//! Adapts a look to what its source provides.

use super::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use crate::depth::focus::FocusRule;
use crate::frame::DepthMap;

/// What the numbers of a source's depth mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Metres {
    /// Not known yet: the source is not open.
    #[default]
    Unknown,
    /// Distances in metres.
    Known,
    /// Distances of two cameras whose geometry is only assumed.
    Assumed,
    /// Only the order of distances: depth is relative.
    Missing,
}

/// What a source, and the outputs of its run, allow a look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LookFacts {
    /// Whether frames have depth that is used.
    pub has_depth: bool,
    /// Whether the source has depth that `--depth none` declines.
    pub is_declined: bool,
    /// What the numbers of its depth mean.
    pub metres: Metres,
    /// Width and height of its pictures; 0 while they are not known.
    pub size: (u32, u32),
    /// Whether all outputs have an alpha channel.
    pub keeps_alpha: bool,
    /// Whether an output leaves for a call: a virtual camera, or a live pipeline of another program.
    pub is_for_call: bool,
}

impl Look {
    /// Adapts the look to a source. Without depth there is no subject to keep sharp, and everything is blurred equally.
    /// With relative depth there are no metres: a focus from 0 to 1 is a place, any other distance becomes focus on the
    /// subject, and a lens becomes the equivalent amount of blur.
    pub fn for_source(&self, facts: &LookFacts) -> Self {
        let mut look = self.clone();
        if look.effect.follows_depth() && !facts.has_depth {
            look.effect = Effect::Blur;
        }
        look.is_for_call = facts.is_for_call;
        look.is_depth_relative = facts.has_depth && facts.metres == Metres::Missing;
        if facts.metres != Metres::Unknown {
            look.focus = look.focus.for_depth(look.is_depth_relative).unwrap_or(FocusRule::Auto);
        }
        if look.is_depth_relative { look.without_metres(facts.size) } else { look }
    }

    /// Returns the look without settings in metres, for pictures of `size`: a focus at a distance becomes focus on the
    /// subject, and a lens becomes the equivalent amount of blur.
    pub fn without_metres(self, (width, height): (u32, u32)) -> Self {
        let strength = match self.strength {
            Strength::Lens(lens) => {
                Strength::from_fraction(lens.coc_at_infinity_px(DepthMap::SUBJECT_M, width) / height.max(1) as f32)
            }
            strength => strength,
        };
        let focus = if matches!(self.focus, FocusRule::Metres(_)) { FocusRule::Auto } else { self.focus };
        Self { focus, focus_range_m: 0.0, strength, ..self }
    }

    /// Returns whether it has a setting in metres.
    pub fn needs_metres(&self) -> bool {
        matches!(self.focus, FocusRule::Metres(_))
            || self.focus_range_m > 0.0
            || matches!(self.strength, Strength::Lens(_))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::{CocAtInfinity, CocRule};

    #[test]
    fn a_number_is_a_place_only_where_there_are_no_metres() {
        let focus = |text: &str, is_relative| {
            let look = Look { focus: text.parse().unwrap(), ..Look::default() };
            let metres = if is_relative { Metres::Missing } else { Metres::Known };
            let facts = LookFacts { has_depth: true, metres, size: (640, 480), ..LookFacts::default() };
            let look = look.for_source(&facts);
            assert_eq!(look.for_source(&facts), look);
            let CocRule::Depth { lens, .. } = look.coc_rule((640, 480)) else { unreachable!("by depth") };
            assert_eq!(matches!(lens, CocAtInfinity::Relative(_)), is_relative);
            (look.focus, look.focus.to_string())
        };
        for (text, place) in [("0", 0.0), ("0.25", 0.25), ("1", 1.0)] {
            assert_eq!(focus(text, true), (FocusRule::Relative(place), text.to_owned()));
        }
        assert_eq!(focus("0.25", false), (FocusRule::Metres(0.25), "0.25".to_owned()));
        assert_eq!((focus("1.5", true).0, focus("1.5", false).0), (FocusRule::Auto, FocusRule::Metres(1.5)));
        // From one source to the other, the number stays.
        let metric = LookFacts { has_depth: true, metres: Metres::Known, ..LookFacts::default() };
        let look = Look { focus: FocusRule::Relative(0.25), ..Look::default() };
        assert_eq!(look.for_source(&metric).focus, FocusRule::Metres(0.25));
        assert_eq!(FocusRule::Relative(0.0).for_depth(false), None);
    }
}
