//! Privacy: whether a filter can undo the blur of what is behind.

use std::fmt;

use super::Look;
use crate::bokeh::Method;
use crate::bokeh::plan::min_private_radius_px;
use crate::depth::backdrop::Background;
use crate::names::named;
use crate::optics::CocKind;

named! {
    /// Whether the blur of what is behind cannot be undone.
    pub enum Privacy default Auto {
        /// For calls: a virtual camera, or a live pipeline of GStreamer
        Auto = "auto",
        /// Always, and a smaller blur is raised to height / 90
        On = "on",
        /// Never
        Off = "off",
    }
}

/// A blur that is too small for privacy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallBlur {
    /// The CoC radius at infinity that was asked for, in pixels.
    pub asked_px: f32,
    /// The smallest one that gives privacy, in pixels.
    pub min_px: f32,
    /// Whether it is raised to that; otherwise it stays as it is.
    pub is_raised: bool,
}

impl fmt::Display for SmallBlur {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [asked_px, min_px] = [self.asked_px, self.min_px].map(|px| (px * 10.0).round() / 10.0);
        match self.is_raised {
            true => {
                write!(f, "--privacy on: the blur behind is raised from {asked_px} to {min_px} px: less hides nothing")
            }
            false => write!(
                f,
                "a call sees this: a blur of {asked_px} px behind can be undone; use --blur {min_px} or more, or \
                 --privacy on"
            ),
        }
    }
}

impl Look {
    /// Returns whether what is behind keeps no detail finer than half its blur, so that no filter can undo it. The
    /// method `gather` cannot do so.
    pub fn is_private(&self) -> bool {
        let can_be = match self.coc_kind() {
            None => false,
            Some(CocKind::Depth) => self.method == Method::Layered,
            Some(CocKind::Uniform | CocKind::Ramp) => true,
        };
        can_be
            && match self.privacy {
                Privacy::Auto => self.is_for_call,
                Privacy::On => true,
                Privacy::Off => false,
            }
    }

    /// Returns the setting that gives a file the same privacy.
    pub fn privacy_outside_call(&self) -> Privacy {
        if self.is_private() { Privacy::On } else { self.privacy }
    }

    /// Returns the blur of pictures of `size` pixels if it is too small for the privacy that the look has; `None` also if
    /// the radius depends on the focus, or the room does not show. A lens is held above the minimum at every focus, too.
    pub fn small_blur(&self, size: (u32, u32)) -> Option<SmallBlur> {
        let asked_px = self.asked_at_infinity_px(size).min(self.asked_max_px(size));
        let min_px = min_private_radius_px(size.1 as usize);
        let is_raised = self.privacy == Privacy::On;
        (self.blurs_room_privately() && asked_px < min_px).then_some(SmallBlur { asked_px, min_px, is_raised })
    }

    /// Whether the room shows, with privacy.
    fn blurs_room_privately(&self) -> bool {
        self.is_private() && self.background == Background::Blur
    }

    /// Returns the smallest CoC radius at infinity of pictures of `size` pixels, in pixels.
    pub(super) fn min_far_px(&self, size: (u32, u32)) -> f32 {
        if self.blurs_room_privately() && self.privacy == Privacy::On {
            min_private_radius_px(size.1 as usize)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::focus::FocusRule;
    use crate::look::{CocRule, Effect, LookFacts, Patch, Strength};
    use crate::optics::{CocField, Lens};

    const SIZE: (u32, u32) = (1280, 720);

    /// Returns the look of these settings, in a call or not.
    fn look(settings: &[(&str, &str)], is_for_call: bool) -> Look {
        let facts = LookFacts { has_depth: true, size: SIZE, is_for_call, ..LookFacts::default() };
        Patch::parse(settings.iter().copied()).unwrap().apply_to(&Look::default()).unwrap().for_source(&facts)
    }

    #[test]
    fn a_call_is_private_and_a_file_is_not_unless_chosen() {
        for (value, in_call, in_file) in [("auto", true, false), ("on", true, true), ("off", false, false)] {
            for (is_for_call, expected) in [(true, in_call), (false, in_file)] {
                for effect in ["dof", "tilt-shift", "blur"] {
                    let look = look(&[("privacy", value), ("effect", effect)], is_for_call);
                    let settings = look.blur_settings(SIZE, true).unwrap();
                    assert_eq!((look.is_private(), settings.privacy), (expected, expected), "{value}, {is_for_call}");
                }
            }
        }
        assert!(!look(&[("privacy", "on"), ("effect", "none")], true).is_private());
        let gather = |effect| look(&[("privacy", "on"), ("method", "gather"), ("effect", effect)], true);
        assert!(!gather("dof").is_private() && gather("blur").is_private(), "the method is for depth");
    }

    #[test]
    fn a_small_blur_is_raised_if_privacy_is_on_and_said_in_a_call() {
        let said = |settings: &[(&str, &str)], is_for_call| {
            look(settings, is_for_call).small_blur(SIZE).map(|small| small.to_string()).unwrap_or_default()
        };
        let raised = said(&[("privacy", "on"), ("blur", "5.25")], false);
        assert!(raised.contains("raised from 5.3 to 8 px"), "{raised}");
        let left = said(&[("blur", "5")], true);
        assert!(left.contains("5 px behind can be undone; use --blur 8 or more"), "{left}");
        for (settings, is_for_call) in [
            (&[("blur", "5")][..], false),
            (&[("blur", "5"), ("privacy", "off")], true),
            (&[("blur", "5"), ("behind", "green")], true),
            (&[("blur", "5"), ("effect", "none")], true),
            (&[("blur", "8")], true),
            (&[("privacy", "on")], true),
        ] {
            assert_eq!(said(settings, is_for_call), "", "{settings:?}");
        }
        for (limited, asked_px) in
            [([("blur", "5"), ("max-coc", "auto")], 5.0), ([("blur", "20"), ("max-coc", "4")], 4.0)]
        {
            for (privacy, expected) in [("on", 8.0), ("off", asked_px)] {
                let settings = [&limited[..], &[("privacy", privacy), ("effect", "blur")]].concat();
                let look = look(&settings, true);
                assert_eq!(look.blur_settings(SIZE, false).unwrap().far_max_px, expected);
                assert_eq!(look.coc_rule(SIZE), CocRule::Fixed(CocField::Uniform { radius_px: expected }));
            }
        }
    }

    #[test]
    fn a_lens_is_raised_at_every_focus() {
        let lens = Lens { f_number: 16.0, focal_length_mm: 24.0, sensor_width_mm: 36.0 };
        for focus in [FocusRule::Auto, FocusRule::Metres(2.0)] {
            let (privacy, strength) = (Privacy::On, Strength::Lens(lens));
            let look = Look { effect: Effect::Dof, focus, privacy, strength, ..Look::default() };
            let far_px = |look: &Look| match look.coc_rule(SIZE) {
                CocRule::Depth { lens, max_coc_px, .. } => match lens.coc_field(2.0, 0.0, SIZE.0, max_coc_px) {
                    CocField::Depth(coc) => coc.coc_at_infinity_px,
                    other => panic!("{other:?}"),
                },
                other => panic!("{other:?}"),
            };
            assert_eq!(far_px(&look), 8.0);
            assert!(far_px(&Look { privacy: Privacy::Off, ..look }) < 2.0);
        }
    }
}
