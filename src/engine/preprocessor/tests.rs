use std::path::Path;

use super::*;
use crate::depth::backdrop::Background;
use crate::depth::focus::FocusRule;
use crate::look::Strength;

const PERIOD_NS: u64 = 33_333_333;

fn portrait() -> (ColorImage, DepthMap) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/portrait");
    let open = |name: &str| image::open(folder.join(name)).unwrap();
    let (color, units) = (open("rgb/000000.png").into_rgb8(), open("depth/000000.png").into_luma16());
    let (width, height) = color.dimensions();
    let metres = units.pixels().map(|units| f32::from(units.0[0]) / 5000.0).collect();
    let color = ColorImage { width, height, rgb: color.into_raw() };
    (color, DepthMap { width, height, metres, ..DepthMap::default() })
}

/// Returns a map whose near objects are wider by 4 pixels on each side.
fn fattened(map: &DepthMap) -> DepthMap {
    let mut map = map.clone();
    for step in [1, map.width as usize] {
        let from = map.metres.clone();
        for (metres, around) in map.metres[4 * step..].iter_mut().zip(from.windows(8 * step + 1)) {
            *metres = around.iter().step_by(step).copied().fold(f32::INFINITY, f32::min);
        }
    }
    map
}

/// Returns a person, 1 m away, whose left side is in column `left`, before a patterned wall at 4 m.
fn person_at(left: usize) -> (ColorImage, DepthMap) {
    let (mut color, mut map) = (ColorImage::new(160, 96), DepthMap::new(160, 96));
    for (at, (pixel, metres)) in color.rgb.as_chunks_mut::<3>().0.iter_mut().zip(&mut map.metres).enumerate() {
        let (x, y) = (at % 160, at / 160);
        let is_person = y >= 20 && (left..left + 50).contains(&x);
        let wall = 60 + ((x / 4 * 7 + y / 4 * 13) % 11 * 8) as u8;
        (*pixel, *metres) = if is_person { ([200, 90, 60], 1.0) } else { ([wall, wall + 20, wall + 40], 4.0) };
    }
    (color, map)
}

/// The look of the tests with a person, which changes no depth.
fn look() -> Look {
    Look {
        refine: Refine::Off,
        background_memory: BackgroundMemory::Off,
        focus: FocusRule::Metres(1.0),
        strength: Strength::AtInfinity(10.0),
        ..Look::default()
    }
}

fn preprocessor(look: &Look, depth: Origin, size: (u32, u32), knows_background: bool) -> Preprocessor {
    let frames = (depth == Origin::Single).then_some(1);
    Preprocessor::new(look, Input { size, frames, depth, knows_background, playback: Playback::Still, threads: 1 })
}

/// Returns the map of the last of six equal frames, and the report's text on its refinement.
fn prepared(refine: Refine, (color, map): (&ColorImage, &DepthMap)) -> (DepthMap, Option<&'static str>) {
    let look = Look { refine, background_memory: BackgroundMemory::Off, ..Look::default() };
    let mut preprocessor = preprocessor(&look, Origin::Measured, color.size(), false);
    let mut last = map.clone();
    for frame in 0..6 {
        last.clone_from(map);
        preprocessor.compute_coc(&mut last, color, frame * PERIOD_NS);
    }
    (last, preprocessor.refinement_backend())
}

#[test]
fn exact_depth_of_a_stream_stays_as_it_is_with_all_that_is_thin() {
    let (color, map) = portrait();
    let (auto, said) = prepared(Refine::Auto, (&color, &map));
    assert!(auto.metres == map.metres && said == Some(EXACT_DEPTH_NOTE), "{said:?}");
    let (on, said) = prepared(Refine::On, (&color, &map));
    assert!(on.metres != map.metres && said == Some("cpu"), "where it is asked for it is refined: {said:?}");
    let (_, said) = prepared(Refine::Auto, (&color, &fattened(&map)));
    assert_eq!(said, Some("cpu"), "exact depth that does not fit the picture is refined");
}

#[test]
fn a_sensors_depth_is_refined_as_it_is_where_that_is_asked_for() {
    let (color, mut map) = portrait();
    // Holes, as a sensor has them beside near objects.
    map.metres.iter_mut().step_by(40).for_each(|metres| *metres = 0.0);
    let [(auto, said), (on, _)] = [Refine::Auto, Refine::On].map(|refine| prepared(refine, (&color, &map)));
    assert!(auto.metres == on.metres && said == Some("cpu"), "{said:?}");
}

#[test]
fn exact_depth_is_exact_across_a_cut_if_history_is_cleared_there() {
    let (color, map) = portrait();
    let mut elsewhere = map.clone();
    elsewhere.metres.iter_mut().for_each(|metres| *metres *= 1.5);
    for (clears, said) in [(true, EXACT_DEPTH_NOTE), (false, "cpu")] {
        let mut preprocessor = preprocessor(&Look::default(), Origin::Measured, color.size(), false);
        for frame in 0..6 {
            if frame == 1 && clears {
                preprocessor.clear_history();
            }
            let mut map = if frame == 0 { map.clone() } else { elsewhere.clone() };
            preprocessor.compute_coc(&mut map, &color, frame * PERIOD_NS);
        }
        assert_eq!(preprocessor.refinement_backend(), Some(said), "cleared: {clears}");
    }
}

#[test]
fn depth_of_a_single_picture_is_refined_if_it_does_not_fit_and_never_against_the_look() {
    let (color, map) = portrait();
    for (refine, map, said) in [
        (Refine::Auto, fattened(&map), Some("cpu")),
        (Refine::Auto, map.clone(), None),
        (Refine::Off, fattened(&map), None),
    ] {
        let look = Look { refine, ..Look::default() };
        let mut preprocessor = preprocessor(&look, Origin::Single, color.size(), true);
        preprocessor.compute_coc(&mut map.clone(), &color, 0);
        assert_eq!(preprocessor.refinement_backend(), said, "{refine:?}");
        assert_eq!(preprocessor.take_warning(), None, "{refine:?}");
    }
}

#[test]
fn depth_that_fits_nowhere_is_told_unless_it_was_made_from_the_picture_itself() {
    let (color, mut map) = portrait();
    map.metres.reverse();
    for subject_m in [None, Some(1.0)] {
        let mut preprocessor = preprocessor(&Look::default(), Origin::Synthesized, color.size(), false);
        for frame in 0..20 {
            preprocessor.compute_coc(&mut DepthMap { subject_m, ..map.clone() }, &color, frame * PERIOD_NS);
        }
        assert_eq!(preprocessor.take_warning().is_some(), subject_m.is_none());
    }
}

#[test]
fn a_source_that_knows_the_background_gets_none_from_memory() {
    // The person takes a step to the right after 40 frames.
    let last_map = |background_memory, knows_background| {
        let look = Look { background_memory, ..look() };
        let mut preprocessor = preprocessor(&look, Origin::Synthesized, (160, 96), knows_background);
        let mut last = DepthMap::default();
        for frame in 0..41 {
            let (color, map) = person_at(if frame < 40 { 40 } else { 60 });
            last = map;
            preprocessor.compute_coc(&mut last, &color, frame * PERIOD_NS);
        }
        last
    };
    let without = last_map(BackgroundMemory::Off, false);
    assert!(last_map(BackgroundMemory::On, false) != without, "what the person covers is remembered");
    assert!(last_map(BackgroundMemory::On, true) == without);
}

#[test]
fn frames_after_a_change_of_the_look_are_those_of_the_new_look() {
    let other = Look { background: Background::Color([0, 0, 255]), ..look() };
    let next = |preprocessor: &mut Preprocessor, time_ns| {
        let (mut color, mut map) = person_at(60);
        let (field, _) = preprocessor.preprocess(&mut color, Some(&mut map), time_ns).unwrap();
        (color, map, field)
    };
    let create = |look: &Look| preprocessor(look, Origin::Synthesized, (160, 96), false);
    let mut changed = create(&look());
    assert!(next(&mut changed, 0).0 == person_at(60).0, "the room stays as it is");
    changed.set_look(&other);
    let changed = next(&mut changed, PERIOD_NS);
    assert!(changed == next(&mut create(&other), 0));
    assert_eq!(changed.0.rgb[..3], [0, 0, 255]);
}
