//! Holes in depth maps, and the focus distance.

use bokehcam::depth::fill::HoleFiller;
use bokehcam::depth::focus::{Focus, FocusRule};
use bokehcam::depth::refine::Refiner;
use bokehcam::frame::{ColorImage, DepthMap};

const WALL_M: f32 = 3.0;
const PERSON_M: f32 = 1.2;
const MS: u64 = 1_000_000;

/// Creates a map from a function of column and row.
fn map(width: u32, height: u32, depth_m: impl Fn(u32, u32) -> f32) -> DepthMap {
    let mut map = DepthMap::new(width, height);
    for y in 0..height {
        for x in 0..width {
            map.metres[(y * width + x) as usize] = depth_m(x, y);
        }
    }
    map
}

/// Returns a person of 40 x 60 pixels before a wall, in a picture of 120 x 90, at `person_m`.
fn portrait(person_m: f32) -> DepthMap {
    map(120, 90, |x, y| if (40..80).contains(&x) && y >= 30 { person_m } else { WALL_M })
}

fn at(map: &DepthMap, x: u32, y: u32) -> f32 {
    map.metres[(y * map.width + x) as usize]
}

#[test]
fn a_depth_shadow_becomes_wall_and_a_hole_in_the_person_stays_person() {
    let whole = portrait(PERSON_M);
    let mut holed = whole.clone();
    for y in 0..90 {
        for x in 0..120 {
            let shadow = (80..95).contains(&x) && y >= 30;
            let button = (55..60).contains(&x) && (50..55).contains(&y);
            // Unknown depth has several encodings.
            if shadow || button {
                holed.metres[(y * 120 + x) as usize] = [0.0, f32::NAN, -1.0, f32::INFINITY][(x % 4) as usize];
            }
        }
    }
    HoleFiller::new().fill(&mut holed);
    assert_eq!(holed, whole);
}

#[test]
fn an_empty_frame_around_the_picture_is_continued_into_its_corners() {
    let inside = |x: u32, y: u32| (10..110).contains(&x) && (10..80).contains(&y);
    let whole = portrait(PERSON_M);
    let mut framed = map(120, 90, |x, y| if inside(x, y) { at(&whole, x, y) } else { 0.0 });
    HoleFiller::new().fill(&mut framed);
    assert!(framed.metres.iter().all(|&z_m| z_m == WALL_M || z_m == PERSON_M));
    assert_eq!((at(&framed, 0, 0), at(&framed, 119, 89)), (WALL_M, WALL_M));
    assert_eq!((at(&framed, 60, 89), at(&framed, 60, 0)), (PERSON_M, WALL_M), "the person goes on below the picture");
    assert!((10..80).all(|y| (10..110).all(|x| at(&framed, x, y) == at(&whole, x, y))), "known depths are kept");
}

#[test]
fn one_known_pixel_fills_the_whole_map() {
    for (width, height) in [(1, 1), (17, 13), (64, 1), (1, 64)] {
        let mut single = DepthMap::new(width, height);
        single.metres[(width * height / 2) as usize] = 2.5;
        HoleFiller::new().fill(&mut single);
        assert!(single.metres.iter().all(|&z_m| z_m == 2.5), "{width} x {height}");
    }
}

#[test]
fn a_frame_without_depth_stays_unknown_whatever_came_before() {
    let mut fill = HoleFiller::new();
    fill.fill(&mut portrait(PERSON_M));
    for mut empty in [map(120, 90, |_, _| f32::NAN), map(8, 6, |_, _| -1.0), DepthMap::new(0, 0)] {
        fill.fill(&mut empty);
        assert!(empty.metres.iter().all(|&z_m| z_m == 0.0), "in its plain spelling");
    }
}

#[test]
fn auto_focus_finds_the_nearest_large_subject() {
    let focus = |map: &DepthMap| Focus::new(FocusRule::Auto).focus_m(map, 0);
    assert!((focus(&portrait(PERSON_M)) / PERSON_M - 1.0).abs() < 0.02);
    assert!((focus(&map(120, 90, |_, _| WALL_M)) / WALL_M - 1.0).abs() < 0.02, "with nobody there, the wall");

    // A twig at the border, near but small, is not the subject.
    let twig = map(120, 90, |x, y| if x < 8 && y > 40 { 0.5 } else { at(&portrait(PERSON_M), x, y) });
    assert!((focus(&twig) / PERSON_M - 1.0).abs() < 0.02);

    // Half of the person unknown, and a rounded, noisy front.
    let rough = map(120, 90, |x, y| match at(&portrait(PERSON_M), x, y) {
        WALL_M => WALL_M,
        _ if (x + y) % 2 == 0 => 0.0,
        person_m => person_m + 0.002 * (x as f32 - 60.0).abs() + 0.01 * ((x * 7 + y * 13) % 5) as f32,
    });
    assert!((focus(&rough) - 1.24).abs() < 0.05, "{}", focus(&rough));
}

#[test]
fn point_focus_is_robust_and_looks_around_in_holes() {
    let focus = |x, y, map: &DepthMap| Focus::new(FocusRule::Point { x, y }).focus_m(map, 0);
    let mut noisy = portrait(PERSON_M);
    for index in (0..noisy.metres.len()).step_by(5) {
        noisy.metres[index] = 0.3;
    }
    assert_eq!(focus(0.5, 0.6, &noisy), PERSON_M);
    assert_eq!(focus(0.1, 0.1, &noisy), WALL_M);
    let hole = map(120, 90, |x, y| if x.abs_diff(60) < 10 && y.abs_diff(60) < 10 { 0.0 } else { at(&noisy, x, y) });
    assert_eq!(focus(0.5, 60.0 / 90.0, &hole), PERSON_M);
    // The very corners, and positions outside.
    for (x, y) in [(0.0, 0.0), (1.0, 1.0), (-3.0, 9.0), (f32::NAN, f32::INFINITY)] {
        assert_eq!(focus(x, y, &portrait(PERSON_M)), WALL_M);
    }
}

#[test]
fn a_fixed_distance_stays() {
    let mut focus = Focus::new(FocusRule::Metres(2.25));
    assert_eq!(focus.focus_m(&portrait(1.0), 0), 2.25);
    assert_eq!(focus.focus_m(&DepthMap::new(0, 0), 33 * MS), 2.25);
}

#[test]
fn the_focus_moves_like_a_lens() {
    let mut focus = Focus::new(FocusRule::Auto);
    let first_m = focus.focus_m(&portrait(1.0), 0);
    assert!((first_m - 1.0).abs() < 0.02, "the first frame sets it at once");
    assert_eq!(focus.focus_m(&portrait(1.0), 25 * MS), first_m);
    assert_eq!(focus.focus_m(&portrait(1.0), 50 * MS), first_m);

    // The person steps back, and more than one map says so: focus moves smoothly and monotonically, 63 % of the way (in
    // dioptres) within a quarter of a second.
    let far = |frame: u64| (portrait(2.0), (2 + frame) * 25 * MS);
    let sets_out = (1..).find(|&frame| focus.focus_m(&far(frame).0, far(frame).1) > first_m).unwrap();
    assert!((3..=17).contains(&sets_out), "{sets_out} frames");
    // By then the focus has passed the first frame of its way.
    let mut way_m = vec![first_m];
    way_m.extend((sets_out..sets_out + 60).map(|frame| focus.focus_m(&far(frame).0, far(frame).1)));
    assert!(way_m.is_sorted(), "no overshoot");
    let covered = |at_m: f32| (1.0 / first_m - 1.0 / at_m) / (1.0 / first_m - 0.5);
    assert!((covered(way_m[10]) - 0.632).abs() < 0.03, "after 250 ms: {}", covered(way_m[10]));
    assert!((way_m[60] - 2.0).abs() < 0.04);

    // Movements as small as breathing do not move the focus at all.
    let rest_m = way_m[60];
    for (frame, person_m) in [(61, 1.98), (62, 2.02), (63, 1.99)] {
        assert_eq!(focus.focus_m(&portrait(person_m), (20 + frame) * 25 * MS), rest_m);
    }
    // Nor does a frame without depth.
    assert_eq!(focus.focus_m(&DepthMap::new(120, 90), 84 * 25 * MS), rest_m);
    // Many small time steps give the same movement as few large ones.
    let settle = |step_ms: u64| {
        let mut focus = Focus::new(FocusRule::Metres(1.0));
        focus.focus_m(&portrait(1.0), 0);
        focus.set_rule(FocusRule::Metres(2.0));
        (1..=240 / step_ms).map(|step| focus.focus_m(&portrait(2.0), step * step_ms * MS)).last().unwrap()
    };
    assert!((settle(10) - settle(40)).abs() < 1e-3);
}

#[test]
fn nothing_to_focus_on_gives_a_usable_distance() {
    let focus_m = Focus::new(FocusRule::Auto).focus_m(&DepthMap::new(12, 9), 0);
    assert!(focus_m > 0.0 && focus_m.is_finite());
}

/// Values that are not valid distances, among valid ones, never produce an invalid result.
#[test]
fn depths_of_no_scene_are_unknown() {
    let odd = [1e-38, 1e-45, f32::MIN_POSITIVE, 9e-7, 3e38, f32::MAX, 2e12, f32::NAN, f32::INFINITY, -0.0];
    let (size, color) = ((60, 45), ColorImage::new(120, 90));
    for rare in [1, 2, 7] {
        for value in odd {
            assert!(!DepthMap::is_known(value));
            let strange = map(size.0, size.1, |x, y| if (x + y * size.0) % rare == 0 { value } else { 1.0 + x as f32 });
            for rule in [FocusRule::Auto, FocusRule::Point { x: 0.5, y: 0.5 }] {
                let focus_m = Focus::new(rule).focus_m(&strange, 0);
                assert!((0.5..100.0).contains(&focus_m), "{value} in every {rare}th: focus {focus_m}");
                let (mut filled, mut refined) = (strange.clone(), strange.clone());
                HoleFiller::new().fill_guided(&mut filled, &color);
                let mut refiner = Refiner::new();
                refiner.set_focus(focus_m);
                refiner.refine(&mut refined, &color, 0);
                for made in [filled, refined] {
                    let is_sound = |&metres: &f32| metres == 0.0 || (0.9..100.0).contains(&metres);
                    assert!(made.metres.iter().all(|z_m| rare == 1 || is_sound(z_m)), "{value} in every {rare}th");
                }
            }
        }
    }
    assert!(DepthMap::is_known(DepthMap::MIN_M) && DepthMap::is_known(DepthMap::MAX_M));
    for text in ["1e-38", "3e38"] {
        assert!(text.parse::<FocusRule>().is_err());
    }
}
