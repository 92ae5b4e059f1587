//! Adapts the look to the source.

use super::{Source, State};
use bokehcam::look::{Effect, Look, LookFacts, Metres, SmallBlur};

impl State {
    /// Returns what the source allows a look. The outputs of a window have no alpha channel.
    pub fn look_facts(&self) -> LookFacts {
        let (metres, size) = match &self.source {
            Source::Running(running) => (self.camera.metres, running.size),
            _ => (Metres::Unknown, (0, 0)),
        };
        let (has_depth, is_declined) = (self.may_have_depth(), self.has_declined_depth());
        let is_for_call = self.virtual_camera().is_some();
        LookFacts { has_depth, is_declined, metres, size, keeps_alpha: false, is_for_call }
    }

    /// Returns the look as the outputs get it now: a call may have begun since it was chosen.
    pub fn effective_look(&self) -> Look {
        self.look.for_source(&self.look_facts())
    }

    /// Returns the blur if it is too small for the privacy that it has now.
    pub fn small_blur(&self) -> Option<SmallBlur> {
        self.effective_look().small_blur(self.look_facts().size)
    }

    /// Returns whether the look is another than at the start.
    pub fn is_look_changed(&self) -> bool {
        self.effective_look() != self.first_look.for_source(&self.look_facts())
    }

    /// Returns the look to be saved: as the user chose it, before it was adapted to the source.
    pub fn chosen_look(&self) -> Look {
        let is_fitted = self.effect_replaced && self.look.effect == Effect::Blur;
        Look { effect: if is_fitted { Effect::Auto } else { self.look.effect }, ..self.look.clone() }
    }

    /// Returns the look as far as the source supports it, and records if its effect was replaced.
    pub(super) fn adapt_look(&mut self, look: Look) -> Look {
        let adapted = look.for_source(&self.look_facts());
        self.effect_replaced |= adapted.effect != look.effect;
        adapted
    }
}

#[cfg(test)]
mod tests {
    use super::super::apply::NO_METRES;
    use super::super::sample::{look, running, state};
    use super::super::{Action, Camera, Output, Request, Update, tweak};
    use super::*;
    use bokehcam::depth::focus::FocusRule;
    use bokehcam::look::presets::Preset;
    use bokehcam::look::{Change, Patch, Privacy, Strength};

    #[test]
    fn where_depth_is_relative_no_look_has_metres() {
        let mut state = state();
        let lens = Strength::Lens(tweak::DEFAULT_LENS);
        state.look = Look { focus: FocusRule::Metres(2.5), strength: lens, focus_range_m: 0.4, ..look() };
        state.apply_update(Update::Camera(Camera { metres: Metres::Missing, ..Camera::default() }));
        let told = state.apply_update(Update::Source(running(true)));
        assert!(matches!(told, Some(Request::Look(look)) if !look.needs_metres()), "{:?}", state.look);
        assert!(!state.look.needs_metres());
        assert!(state.notes.iter().any(|note| note.text.contains("in metres")), "and it is said");
        // Nothing restores them, and keys for metric settings change the amount instead.
        let before = tweak::coc_fraction(&state.look, 720).unwrap();
        let mut more = state.look.clone();
        tweak::scale_f_number(&mut more, 0.5, 1.0, (1280, 720));
        state.apply(Action::Look { look: Box::new(more), stroke: None });
        assert!(!state.look.needs_metres() && tweak::coc_fraction(&state.look, 720).unwrap() > 1.5 * before);
        let asked = Change::to_settings(Patch { focus: Some(FocusRule::Metres(2.0)), ..Patch::default() });
        assert!(state.look.change(&asked, &state.look_facts()).is_err());
        // A preset is taken without them, whether it has an effect or not.
        for effect in [None, Some(Effect::Auto)] {
            let patch = Patch { effect, focus_range_m: Some(0.3), rim: Some(0.7), ..Patch::default() };
            state.presets = vec![Preset { name: "near".into(), patch, is_user_defined: true }];
            (state.look.rim, state.notes) = (0.2, Vec::new());
            state.apply(Action::Preset("near".into()));
            assert!(state.look.rim == 0.7 && !state.look.needs_metres(), "{:?}", state.look);
            assert_eq!(state.notes.last().unwrap().text, NO_METRES);
        }
    }

    #[test]
    fn a_call_that_begins_makes_the_look_private_and_changes_nothing_else() {
        let mut state = state();
        state.look = Look { strength: Strength::Percent(1.0), ..look() };
        state.first_look = state.look.clone();
        assert_eq!((state.effective_look().is_private(), state.small_blur()), (false, None));
        state.outputs = vec![Output { name: "/dev/video9".into(), is_camera: true }];
        assert!(state.effective_look().is_private() && !state.is_look_changed());
        assert!(state.small_blur().is_some_and(|small| !small.is_raised));
        state.look.privacy = Privacy::On;
        assert!(state.small_blur().is_some_and(|small| small.is_raised) && state.is_look_changed());
        state.outputs[0].is_camera = false;
        assert!(state.effective_look().is_private(), "a recording, too, if it is on");
    }

    #[test]
    fn a_window_takes_no_transparency_whoever_asks() {
        let mut state = state();
        let patch = Patch::parse([("behind", "transparent")]).unwrap();
        state.presets = vec![Preset { name: "cut".into(), patch: patch.clone(), is_user_defined: true }];
        for source in [Source::Opening, running(true)] {
            state.source = source;
            assert_eq!(state.apply(Action::Preset("cut".into())), []);
            assert!(state.notes.last().unwrap().text.starts_with("preset cut: --behind transparent"));
            let change = Change::to_settings(patch.clone());
            assert!(state.look.change(&change, &state.look_facts()).is_err());
        }
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
