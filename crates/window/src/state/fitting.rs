//! A look as far as a source allows it.

use super::tweak;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{Look, Strength};

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

/// The look as far as a source allows it. With relative depth there are no metres:
/// the subject is in focus in place of a distance, and a lens blurs as much by amount.
pub fn fitted(look: &Look, known: Known) -> Look {
    let mut look = look.for_source(known.has_depth);
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

#[cfg(test)]
mod tests {
    use super::super::sample::{look, running, state};
    use super::super::{Action, Camera, Request, Update};
    use super::*;
    use bokehcam::look::Patch;

    #[test]
    fn where_depth_is_relative_no_look_has_metres() {
        let mut state = state();
        let lens = Strength::Lens(tweak::LENS);
        state.look = Look { focus: FocusRule::Metres(2.5), strength: lens, focus_range_m: 0.4, ..look() };
        state.hear(Update::Camera(Camera { is_relative: true, ..Camera::default() }));
        let told = state.hear(Update::Source(running(true)));
        assert!(matches!(told, Some(Request::Look(look)) if look.needs_metres().is_none()), "{:?}", state.look);
        assert_eq!(state.look.needs_metres(), None);
        assert!(state.notes.iter().any(|note| note.text.contains("in metres")), "and it is said");
        // Nothing brings them back, and keys that mean metres blur by amount.
        let before = tweak::amount(&state.look, 720).unwrap();
        let mut more = state.look.clone();
        tweak::f_number_by(&mut more, 0.5, 1.0, (1280, 720));
        state.apply(Action::Look { look: Box::new(more), stroke: None });
        assert!(state.look.needs_metres().is_none() && tweak::amount(&state.look, 720).unwrap() > 1.5 * before);
        assert!(state.patched(&Patch { focus: Some(FocusRule::Metres(2.0)), ..Patch::default() }).is_err());
    }

    #[test]
    fn an_amount_is_the_same_after_a_way_by_the_lens() {
        let size = (1280, 720);
        let mut look = Look::default();
        for focus_m in [0.7, 1.24, 3.0] {
            look.strength = Strength::Lens(tweak::lens_of(&look, focus_m, size));
            let Strength::Lens(lens) = look.strength else { unreachable!() };
            look.strength = tweak::strength_of(tweak::amount_of(lens, focus_m, size));
            assert_eq!(look, Look::default(), "focused at {focus_m} m");
        }
    }
}
