//! Adapts the look to the source.

use super::{Source, State};
use bokehcam::look::{Effect, Look, SourceDepth};

impl State {
    /// Returns the properties of the source's depth.
    pub fn source_depth(&self) -> SourceDepth {
        let size = match &self.source {
            Source::Running(running) => running.size,
            _ => (1280, 720),
        };
        let is_relative = self.camera.is_relative && matches!(self.source, Source::Running(_));
        SourceDepth { has_depth: self.may_have_depth(), is_relative, size }
    }

    /// Returns the look to be saved: as the user chose it, before it was adapted to the source.
    pub fn chosen_look(&self) -> Look {
        let is_fitted = self.effect_replaced && self.look.effect == Effect::Blur;
        Look { effect: if is_fitted { Effect::Auto } else { self.look.effect }, ..self.look.clone() }
    }

    /// Returns the look as far as the source supports it, and records if its effect was replaced.
    pub(super) fn adapt_look(&mut self, look: Look) -> Look {
        let adapted = look.for_source(self.source_depth());
        self.effect_replaced |= adapted.effect != look.effect;
        adapted
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::{look, running, state};
    use super::super::{Action, Camera, Request, Update, tweak};
    use super::*;
    use bokehcam::depth::focus::FocusRule;
    use bokehcam::look::{Patch, Strength};

    #[test]
    fn where_depth_is_relative_no_look_has_metres() {
        let mut state = state();
        let lens = Strength::Lens(tweak::DEFAULT_LENS);
        state.look = Look { focus: FocusRule::Metres(2.5), strength: lens, focus_range_m: 0.4, ..look() };
        state.apply_update(Update::Camera(Camera { is_relative: true, ..Camera::default() }));
        let told = state.apply_update(Update::Source(running(true)));
        assert!(matches!(told, Some(Request::Look(look)) if look.metric_setting().is_none()), "{:?}", state.look);
        assert_eq!(state.look.metric_setting(), None);
        assert!(state.notes.iter().any(|note| note.text.contains("in metres")), "and it is said");
        // Nothing restores them, and keys for metric settings change the amount instead.
        let before = tweak::coc_fraction(&state.look, 720).unwrap();
        let mut more = state.look.clone();
        tweak::scale_f_number(&mut more, 0.5, 1.0, (1280, 720));
        state.apply(Action::Look { look: Box::new(more), stroke: None });
        assert!(state.look.metric_setting().is_none() && tweak::coc_fraction(&state.look, 720).unwrap() > 1.5 * before);
        assert!(state.patch_look(&Patch { focus: Some(FocusRule::Metres(2.0)), ..Patch::default() }).is_err());
    }

    #[test]
    fn an_amount_is_the_same_after_a_way_by_the_lens() {
        let size = (1280, 720);
        let mut look = Look::default();
        for focus_m in [0.7, 1.24, 3.0] {
            look.strength = Strength::Lens(tweak::lens_for_look(&look, focus_m, size));
            let Strength::Lens(lens) = look.strength else { unreachable!() };
            look.strength = Strength::from_fraction(tweak::lens_coc_fraction(lens, focus_m, size));
            assert_eq!(look, Look::default(), "focused at {focus_m} m");
        }
    }
}
