use super::apply::{NO_DEPTH, NO_DEPTH_OF_PHOTO, NO_PLATE};
use super::sample::{blurred, look, running, state};
use super::*;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{Effect, Look, Strength};

fn set(state: &mut State, radius_px: f32, stroke: Option<&'static str>) -> Vec<Request> {
    state.apply(Action::Look { look: Box::new(blurred(radius_px)), stroke })
}

fn radius_px(state: &State) -> f32 {
    match state.look.strength {
        Strength::AtInfinity(radius_px) => radius_px,
        Strength::Percent(percent) => percent,
        Strength::Default | Strength::Lens(_) => 0.0,
    }
}

#[test]
fn a_look_takes_effect_and_can_be_undone_and_redone() {
    let mut state = state();
    assert_eq!(state.history.can_undo_redo(), (false, false));
    for radius_px in [1.0, 2.0, 3.0] {
        let effects = set(&mut state, radius_px, None);
        assert_eq!(effects, [Request::Look(Box::new(blurred(radius_px)))]);
    }
    assert_eq!(set(&mut state, 3.0, None), [], "nothing changed");
    assert_eq!(state.apply(Action::Undo), [Request::Look(Box::new(blurred(2.0)))]);
    state.apply(Action::Undo);
    assert_eq!((radius_px(&state), state.history.can_undo_redo()), (1.0, (true, true)));
    state.apply(Action::Redo);
    assert_eq!(radius_px(&state), 2.0);
    // A new look clears the redo history.
    set(&mut state, 9.0, None);
    assert_eq!((state.apply(Action::Redo), radius_px(&state)), (vec![], 9.0));
    for _ in 0..9 {
        state.apply(Action::Undo);
    }
    assert_eq!((&state.look, state.history.can_undo_redo()), (&look(), (false, true)));
}

#[test]
fn the_changes_of_a_stroke_are_one() {
    let mut state = state();
    for radius_px in 1..=20 {
        set(&mut state, radius_px as f32, Some("slider"));
    }
    state.apply(Action::EndStroke);
    for radius_px in 30..=40 {
        set(&mut state, radius_px as f32, Some("slider"));
    }
    set(&mut state, 50.0, Some("wheel"));
    state.apply(Action::Undo);
    assert_eq!(radius_px(&state), 40.0, "another control");
    state.apply(Action::Undo);
    assert_eq!(radius_px(&state), 20.0, "the same one, taken up again");
    state.apply(Action::Undo);
    assert_eq!(state.look, look());
}

#[test]
fn history_is_bounded() {
    let mut state = state();
    for radius_px in 0..1000 {
        set(&mut state, radius_px as f32, None);
    }
    let undone = std::iter::repeat_with(|| state.apply(Action::Undo)).take_while(|effects| !effects.is_empty()).count();
    assert_eq!(undone, 100);
    assert_eq!(radius_px(&state), 899.0);
}

#[test]
fn reset_goes_to_the_first_look_and_can_be_undone() {
    let mut state = state();
    assert_eq!(state.apply(Action::Reset), []);
    set(&mut state, 7.0, None);
    assert_eq!(state.apply(Action::Reset), [Request::Look(Box::new(look()))]);
    state.apply(Action::Undo);
    assert_eq!(radius_px(&state), 7.0);
}

#[test]
fn presets_are_looks_by_name() {
    let mut state = state();
    let effects = state.apply(Action::Preset("cinematic".into()));
    assert_eq!((effects.len(), radius_px(&state)), (1, 30.0));
    assert_eq!(state.preset_in_use(), Some(1));
    // A preset does not include the focus.
    state.look.focus = FocusRule::Metres(3.0);
    assert_eq!(state.preset_in_use(), Some(1));
    assert_eq!(state.apply(Action::Preset("nothing".into())), []);
    assert!(state.notes.last().unwrap().text.contains("nothing"));
    assert_eq!(state.apply(Action::SavePreset("  mine ".into())).len(), 1);
    assert_eq!(state.apply(Action::SavePreset("  ".into())), []);
}

#[test]
fn of_presets_that_look_the_same_the_one_that_was_chosen_is_in_use() {
    let mut state = state();
    let same = Preset { name: "mine".into(), is_user_defined: true, ..state.presets[1].clone() };
    state.presets.push(same);
    let mine = state.presets.len() - 1;
    for (name, index) in [("cinematic", 1), ("mine", mine), ("cinematic", 1)] {
        state.apply(Action::Preset(name.into()));
        assert_eq!(state.preset_in_use(), Some(index), "{name}");
    }
    state.apply(Action::SavePreset("mine".into()));
    assert_eq!(state.preset_in_use(), Some(mine), "just saved");
    set(&mut state, 3.0, None);
    assert_eq!(state.preset_in_use(), None);
}

#[test]
fn a_photo_is_told_what_gives_it_depth() {
    let mut state = state();
    let Source::Running(camera) = running(false) else { unreachable!() };
    let photo = Source::Running(Running { kind: Kind::Photo, ..camera.clone() });
    for (source, hint) in [(Source::Running(camera), NO_DEPTH), (photo, NO_DEPTH_OF_PHOTO)] {
        state.apply_update(Update::Source(source));
        state.apply(Action::Show(ViewMode::Depth));
        assert_eq!(state.notes.last().unwrap().text, hint);
    }
    assert!(!state.can_pause_pipeline(), "not before its picture is there");
    state.shows_final_photo = true;
    assert!(state.can_pause_pipeline() && state.is_picture_static() && !state.frozen);
    state.apply(Action::Open("another".into()));
    assert!(!state.can_pause_pipeline() && !state.is_picture_static());
}

#[test]
fn what_needs_depth_says_so_where_there_is_none() {
    let mut state = state();
    // An effect that follows depth becomes a uniform blur, and the session is notified.
    let even = Look { effect: Effect::Blur, ..look() };
    assert_eq!(state.apply_update(Update::Source(running(false))), Some(Request::Look(Box::new(even.clone()))));
    for action in [Action::Preset("cinematic".into()), Action::Show(ViewMode::Depth)] {
        let before = state.notes.last().map(|note| note.number);
        assert_eq!(state.apply(action), []);
        let said = state.notes.last().unwrap();
        assert!(Some(said.number) > before && said.text == NO_DEPTH, "{said:?}");
    }
    assert_eq!((state.shown, &state.look), (ViewMode::Picture, &even));
    assert_eq!(state.apply(Action::Reset), [], "nor does the first look follow any");
    assert_eq!(state.apply(Action::Preset("miniature".into())).len(), 1);
    assert_eq!(state.look.effect, Effect::TiltShift);
    state.apply_update(Update::Source(running(true)));
    assert_eq!(state.look.effect, Effect::TiltShift, "that was chosen");
    // With depth, it follows depth again; the depth view returns to the picture when the next source has none.
    state.apply(Action::Portrait(true));
    state.apply_update(Update::Source(running(false)));
    assert_eq!(state.look.effect, Effect::Blur);
    state.apply_update(Update::Source(running(true)));
    assert_eq!(state.look.effect, Effect::Auto);
    state.apply(Action::Show(ViewMode::Depth));
    state.apply_update(Update::Source(running(false)));
    assert_eq!(state.shown, ViewMode::Picture);
}

#[test]
fn what_is_set_beyond_its_range_is_at_its_end() {
    let mut state = state();
    for (asked, got) in [(0.3, Some(0.3)), (-1.0, Some(0.0)), (7.0, Some(1.0)), (f32::NAN, None)] {
        state.apply(Action::Split(Some(asked)));
        assert_eq!(state.split, got);
    }
    for (asked, got) in [(1.5, 1.5), (9.0, 3.0), (0.0, 0.75), (f32::NAN, 0.75)] {
        state.apply(Action::TextScale(asked));
        assert_eq!(state.preferences.text_scale, got);
    }
}

#[test]
fn outputs_begin_once_and_end_once() {
    let mut state = state();
    let recording = Output { name: String::new(), is_camera: false };
    assert_eq!(state.apply(Action::Record(true)), [Request::StartOutput(recording.clone())]);
    assert_eq!(state.apply(Action::Record(true)), [], "twice at once");
    let named = Output { name: "clip.mp4".into(), is_camera: false };
    state.apply_update(Update::Outputs(vec![named.clone()]));
    assert_eq!(state.recording(), Some(&named));
    assert_eq!(state.apply(Action::Record(false)), [Request::StopOutput(named)]);
    assert_eq!(state.apply(Action::Record(false)), []);

    let camera = |name: &str| Output { name: name.into(), is_camera: true };
    let choose = |name: &str| Action::VirtualCamera(Some(name.to_owned()));
    assert_eq!(state.apply(choose("a")), [Request::StartOutput(camera("a"))]);
    assert_eq!(state.apply(choose("a")), []);
    assert_eq!(state.apply(choose("b")), [Request::StopOutput(camera("a")), Request::StartOutput(camera("b"))]);
    assert_eq!(state.apply(Action::VirtualCamera(None)), [Request::StopOutput(camera("b"))]);
    assert_eq!(state.apply(Action::VirtualCamera(None)), []);
    assert_eq!(state.notes.last().unwrap().text, NO_VIRTUAL_CAMERA);
}

#[test]
fn a_source_is_opened_lost_and_opened_again() {
    let mut state = state();
    state.frozen = true;
    assert_eq!(state.apply(Action::Open("/dev/video0".into())), [Request::Open("/dev/video0".into())]);
    assert_eq!((&state.source, state.frozen, state.controls.len()), (&Source::Opening, false, 0));
    for end in [Source::Lost("unplugged".into()), Source::Ended] {
        state.apply_update(Update::Source(end.clone()));
        assert_eq!(state.source, end);
        assert_eq!(state.apply(Action::Retry), [Request::Open("/dev/video0".into())]);
        assert_eq!(state.source, Source::Opening);
    }
}

#[test]
fn controls_of_the_camera_stay_in_their_range() {
    let mut state = state();
    let set = |state: &mut State, value: i64| state.apply(Action::Control("brightness".into(), value));
    assert_eq!(set(&mut state, 500), [Request::Control("brightness".into(), 64)]);
    assert_eq!(set(&mut state, 64), [], "it is that already");
    assert_eq!(state.apply(Action::Control("exposure_time_absolute".into(), 3)), [], "it cannot be changed now");
    assert_eq!(state.apply(Action::Control("nothing".into(), 3)), []);
}

#[test]
fn what_went_wrong_stays_until_it_is_known() {
    let mut state = state();
    state.apply_update(Update::OutputFailure("the disk is full".into()));
    for k in 0..20 {
        state.apply_update(Update::Note(format!("note {k}")));
    }
    assert_eq!(state.output_failure.as_deref(), Some("the disk is full"));
    assert_eq!(state.apply(Action::DismissFailure), []);
    assert_eq!(state.output_failure, None);
}

#[test]
fn the_wheel_gets_away_from_no_blur_and_back() {
    let mut look = look();
    for _ in 0..200 {
        tweak::scale_blur(&mut look, 0.8, 720);
    }
    assert_eq!(look.strength, Strength::Percent(0.0));
    for _ in 0..200 {
        tweak::scale_blur(&mut look, 1.25, 720);
    }
    assert_eq!(look.strength, Strength::Percent(bokehcam::look::MAX_COC_PER_HEIGHT * 100.0));
    look.strength = Strength::Lens(tweak::DEFAULT_LENS);
    for (factor, f_number) in [(1.0, 1.8), (1e3, 0.7), (1e-6, 22.0)] {
        tweak::scale_blur(&mut look, factor, 720);
        let Strength::Lens(lens) = look.strength else { panic!("{:?}", look.strength) };
        assert!((lens.f_number - f_number).abs() < 1e-5, "{factor}: {lens:?}");
    }
}

#[test]
fn amount_and_lens_are_converted_and_the_f_number_goes_the_way_it_says() {
    for (size, percent, focus_m) in [((1280, 720), 2.2, 1.2), ((640, 480), 1.0, 2.5), ((1080, 1920), 3.0, 4.0)] {
        let look = Look { strength: Strength::Percent(percent), ..look() };
        let lens = tweak::lens_for_look(&look, focus_m, size);
        let back = 100.0 * tweak::lens_coc_fraction(lens, focus_m, size);
        assert!((back - percent).abs() < 1e-3 * percent, "{size:?}: {percent} % is {lens:?}, which is {back} %");
        for factor in [1.122, 1.0 / 1.122] {
            let mut look = look.clone();
            tweak::scale_f_number(&mut look, factor, focus_m, size);
            let Strength::Lens(turned) = look.strength else { panic!("{:?}", look.strength) };
            let turned = tweak::lens_coc_fraction(turned, focus_m, size);
            // At the limit of f-numbers, it stays.
            assert!(if factor > 1.0 { turned < percent / 100.0 } else { turned >= 0.999 * percent / 100.0 });
        }
    }
}

#[test]
fn numbers_are_as_one_would_write_them() {
    let mut look = look();
    for factor in [1.122, 1.0023, 0.97, 1.3333] {
        tweak::scale_blur(&mut look, factor, 720);
        tweak::move_focus(&mut look, 0.017, 0.003);
    }
    for (name, value) in bokehcam::look::Patch::from_look(&look).values() {
        let digits = value.split([',', ' ', ':']).map(|number| number.chars().filter(char::is_ascii_digit).count());
        assert!(digits.max().unwrap_or(0) <= 5, "{name} = {value}");
    }
    // However small the steps, they accumulate.
    let before = tweak::coc_fraction(&look, 720);
    (0..40).for_each(|_| tweak::scale_blur(&mut look, 1.0023, 720));
    assert!(tweak::coc_fraction(&look, 720) > before.map(|fraction| 1.05 * fraction));
}

#[test]
fn arrows_move_what_is_sharp() {
    let mut look = look();
    tweak::move_focus(&mut look, 0.02, 0.0);
    assert_eq!(look.focus, FocusRule::Point { x: 0.52, y: 0.5 });
    for _ in 0..100 {
        tweak::move_focus(&mut look, 0.02, -0.02);
    }
    assert_eq!(look.focus, FocusRule::Point { x: 1.0, y: 0.0 });
    look.focus = FocusRule::Metres(2.0);
    tweak::move_focus(&mut look, 0.0, -0.02);
    assert!(matches!(look.focus, FocusRule::Metres(metres) if metres > 2.0));
    look.effect = Effect::TiltShift;
    tweak::move_focus(&mut look, 0.02, 0.1);
    assert!((look.tilt.center_y - 0.6).abs() < 1e-6 && (look.tilt.angle_deg - 2.0).abs() < 1e-6);
    for (angle, by, is) in [(89.0, 2.0, -89.0), (-89.0, -2.0, 89.0), (0.0, 360.0, 0.0)] {
        assert!((tweak::rotate_band(angle, by) - is).abs() < 1e-4, "{angle} by {by}");
    }
}

#[test]
fn a_plate_is_offered_where_a_camera_has_no_depth_and_its_end_is_told_once() {
    let mut state = state();
    assert!(!state.can_capture_plate() && !state.offers_depth_methods());
    assert_eq!((state.apply(Action::CapturePlate), &state.notes.last().unwrap().text[..]), (vec![], NO_PLATE));
    state.apply_update(Update::Source(running(false)));
    assert!(state.can_capture_plate() && state.offers_depth_methods());
    state.apply(Action::DeclineDepthOffer);
    assert!(state.depth_offer_declined);
    assert_eq!(state.apply(Action::CapturePlate), [Request::CapturePlate]);
    assert!(!state.depth_offer_declined);
    let notes = state.notes.len();
    for (step, is_new) in
        [(Step::StepOut(3), true), (Step::StepOut(3), false), (Step::Capturing(50), true), (Step::Ready, true)]
    {
        assert_eq!(state.set_plate_step(Some(step)), is_new, "{step:?}");
    }
    assert_eq!(state.notes.len(), notes + 1);
    assert!(!state.set_plate_step(Some(Step::Ready)) && state.set_plate_step(None));
    // A plate that was ready from the start is not announced.
    assert!(state.set_plate_step(Some(Step::Ready)));
    assert_eq!(state.notes.len(), notes + 1);
}

#[test]
fn a_source_without_depth_changes_no_look_for_the_next_time() {
    let mut state = state();
    let chosen = state.look.clone();
    state.apply_update(Update::Source(running(false)));
    assert_eq!((chosen.effect, state.look.effect, state.chosen_look()), (Effect::Auto, Effect::Blur, chosen));
    state.apply(Action::Preset("miniature".into()));
    assert_eq!(state.chosen_look().effect, Effect::TiltShift, "that was chosen");
}
