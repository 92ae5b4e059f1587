//! Results that are kept from frame to frame: what may be kept, and how far it may be from a fresh result.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::{CocField, CocKind};
use common::{COC_KINDS, DOF, coc, codes_apart, color, depth, grain, settings};

const SIZE: (u32, u32) = (512, 256);

/// Two executors over the same frames: one keeps what hardly changes, one makes every frame anew.
struct Both {
    keeping: CpuBokeh,
    fresh: CpuBokeh,
    field: CocField,
}

/// One frame: the result of the executor that keeps, the fresh one, and the fraction kept.
struct Pair {
    kept: ColorImage,
    fresh: ColorImage,
    fraction: f32,
}

impl Both {
    fn new(kind: CocKind, threads: usize) -> Self {
        Self::with_size(kind, threads, SIZE)
    }

    fn with_size(kind: CocKind, threads: usize, (width, height): (u32, u32)) -> Self {
        let executor =
            |reuse| CpuBokeh::new(Plan::new(&Settings { reuse, ..settings(kind) }, width, height), Some(threads));
        Self { keeping: executor(true), fresh: executor(false), field: coc(kind, height) }
    }

    fn blur(&mut self, color: &ColorImage, map: &DepthMap) -> Pair {
        let [mut kept, mut fresh] = [const { ColorImage { width: 0, height: 0, rgb: Vec::new() } }; 2];
        self.keeping.blur(color, Some(map), &self.field, &mut kept).expect("a fitting frame");
        self.fresh.blur(color, Some(map), &self.field, &mut fresh).expect("a fitting frame");
        assert_eq!(self.fresh.kept_fraction(), 0.0);
        Pair { kept, fresh, fraction: self.keeping.kept_fraction() }
    }
}

/// A room of soft shapes and sharp edges behind a subject whose left side is at column `subject_x`, 100 wide.
fn scene(subject_x: u32, light: f32, noise: impl Fn(u32, u32) -> f32) -> (ColorImage, DepthMap) {
    let is_subject = |x: u32, y: u32| (subject_x..subject_x + 100).contains(&x) && y > 90;
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let room = if (x / 40 + y / 30) % 2 == 0 { 70.0 } else { 150.0 + 0.1 * x as f32 };
        let value = if is_subject(x, y) { 110.0 + 60.0 * f32::from((x / 3 + y / 3) % 2 == 0) } else { room };
        let code = |offset: f32| (value + light + offset + noise(x, y)).round().clamp(0.0, 255.0) as u8;
        [code(0.0), code(8.0), code(-15.0)]
    });
    (picture, depth(SIZE.0, SIZE.1, |x, y| if is_subject(x, y) { 1.0 } else { 3.5 }))
}

/// Independent noise of `amplitude` codes around 0, different in each frame.
fn sensor(frame: u32, amplitude: f32) -> impl Fn(u32, u32) -> f32 {
    move |x, y| {
        let mut hash = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ frame.wrapping_mul(0xC2B2_AE3D))
            .wrapping_mul(0x27D4_EB2F);
        hash ^= hash >> 15;
        hash = hash.wrapping_mul(0x2C1B_3C6D);
        amplitude * ((hash >> 8) as f32 / 8_388_608.0 - 1.0)
    }
}

fn mean_apart(a: &ColorImage, b: &ColorImage) -> f64 {
    let total: u64 = a.rgb.iter().zip(&b.rgb).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    total as f64 / a.rgb.len() as f64
}

#[test]
fn a_still_scene_is_kept_and_stays_the_same_to_the_bit() {
    for kind in COC_KINDS {
        let mut both = Both::new(kind, 2);
        let (picture, map) = scene(200, 0.0, |_, _| 0.0);
        let first = both.blur(&picture, &map);
        assert!(first.fraction == 0.0 && first.kept == first.fresh, "{kind:?}");
        let mut renewed = 0;
        for frame in 1..200 {
            let next = both.blur(&picture, &map);
            assert!(next.fraction > 0.7, "{kind:?} {frame}: {}", next.fraction);
            assert!(next.kept == first.fresh, "{kind:?} {frame}");
            renewed += u32::from(next.fraction < 1.0);
        }
        assert!(renewed > 0, "{kind:?}: everything is made anew at times");
    }
}

#[test]
fn noise_is_kept_out_of_the_background_and_the_subject_is_fresh() {
    let mut both = Both::new(CocKind::Depth, 2);
    let (mut fractions, mut moved) = (Vec::new(), [0.0; 2]);
    let mut before: Option<Pair> = None;
    for frame in 0..60 {
        let (picture, map) = scene(200, 0.0, sensor(frame, 6.0));
        let pair = both.blur(&picture, &map);
        assert!(codes_apart(&pair.kept, &pair.fresh) <= 3, "{frame}: {}", codes_apart(&pair.kept, &pair.fresh));
        assert!(mean_apart(&pair.kept, &pair.fresh) <= 0.5, "{frame}");
        let subject = |image: &ColorImage| -> Vec<u8> {
            (150..250).flat_map(|y| image.rgb[(y * 512 + 230) * 3..(y * 512 + 270) * 3].to_vec()).collect()
        };
        assert!(subject(&pair.kept) == subject(&picture), "{frame}: what is in focus is the camera's");
        if let Some(before) = &before
            && frame > 40
        {
            fractions.push(pair.fraction);
            moved[0] += mean_apart(&before.kept, &pair.kept);
            moved[1] += mean_apart(&before.fresh, &pair.fresh);
        }
        before = Some(pair);
    }
    assert!(fractions.iter().sum::<f32>() / fractions.len() as f32 > 0.5, "{fractions:?}");
    assert!(moved[0] < 0.8 * moved[1], "the background flickers less: {moved:?}");
}

#[test]
fn a_moving_subject_leaves_no_trail() {
    let mut both = Both::new(CocKind::Depth, 2);
    for frame in 0..80u32 {
        // To the right, then it rests.
        let (picture, map) = scene(40 + 6 * frame.min(50), 0.0, |_, _| 0.0);
        let pair = both.blur(&picture, &map);
        let (worst, mean) = (codes_apart(&pair.kept, &pair.fresh), mean_apart(&pair.kept, &pair.fresh));
        assert!(worst <= 2 && mean <= 0.1, "{frame}: {worst} {mean}");
    }
}

#[test]
fn slow_drifts_and_steps_of_the_light_are_followed() {
    for kind in COC_KINDS {
        let mut both = Both::new(kind, 2);
        for frame in 0..120u32 {
            let drift = 0.12 * frame as f32 + if frame > 80 { 20.0 } else { 0.0 };
            // Dithered, as a sensor's noise does.
            let (picture, map) = scene(200, drift, sensor(7, 0.5));
            let pair = both.blur(&picture, &map);
            let (worst, mean) = (codes_apart(&pair.kept, &pair.fresh), mean_apart(&pair.kept, &pair.fresh));
            assert!(worst <= 2 && mean <= 0.75, "{kind:?} {frame}: {worst} {mean}");
        }
    }
}

#[test]
fn another_scene_focus_or_nearer_object_is_made_anew() {
    let mut both = Both::new(CocKind::Depth, 2);
    let (picture, map) = scene(200, 0.0, |_, _| 0.0);
    let (other, other_map) = scene(60, 40.0, |x, _| (x % 7) as f32);
    let near =
        depth(SIZE.0, SIZE.1, |x, y| if x < 100 && y > 120 { 0.4 } else { map.metres[(y * SIZE.0 + x) as usize] });
    for (name, picture, map) in
        [("cut", &other, &other_map), ("back", &picture, &map), ("near", &picture, &near), ("gone", &picture, &map)]
    {
        let pair = both.blur(picture, map);
        if name == "gone" {
            // The rest of the room may stay.
            assert!(codes_apart(&pair.kept, &pair.fresh) <= 1, "{name}");
            continue;
        }
        assert!(pair.fraction == 0.0 && pair.kept == pair.fresh, "{name}: {}", pair.fraction);
        for _ in 0..6 {
            let pair = both.blur(picture, map);
            assert!(codes_apart(&pair.kept, &pair.fresh) <= u8::from(name == "near"), "{name}");
        }
    }
    let CocField::Depth(lens) = DOF else { unreachable!() };
    for frame in 0..30 {
        both.field = CocField::Depth(bokehcam::optics::DepthCoc { focus_m: 1.0 + 0.01 * frame as f32, ..lens });
        let pair = both.blur(&picture, &map);
        assert!(codes_apart(&pair.kept, &pair.fresh) <= 3 && mean_apart(&pair.kept, &pair.fresh) <= 0.5, "{frame}");
    }
}

#[test]
fn a_scene_from_before_an_unsurveyed_frame_is_made_anew() {
    let mut both = Both::new(CocKind::Depth, 2);
    let scenes = [scene(200, 0.0, |_, _| 0.0), scene(60, 40.0, |x, _| (x % 7) as f32)];
    // After two frames in which everything changes, the next one is not surveyed.
    for (frame, (picture, map)) in scenes.iter().cycle().take(5).enumerate() {
        let pair = both.blur(picture, map);
        assert!(pair.fraction == 0.0 && pair.kept == pair.fresh, "{frame}: {}", pair.fraction);
    }
    let [(picture, map), _] = &scenes;
    assert!(both.blur(picture, map).fraction > 0.7, "then it is kept");
}

#[test]
fn a_band_of_focus_that_moves_is_made_anew() {
    let mut both = Both::new(CocKind::Ramp, 2);
    let (picture, map) = scene(200, 0.0, |_, _| 0.0);
    let CocField::Ramp(band) = both.field else { unreachable!() };
    for (offset_px, is_other) in [(128.0, true), (60.0, true), (60.0, false), (128.0, true), (129.0, true)] {
        both.field = CocField::Ramp(bokehcam::optics::Ramp { offset_px, ..band });
        let pair = both.blur(&picture, &map);
        assert!(pair.kept == pair.fresh && (pair.fraction == 0.0) == is_other, "{offset_px}: {}", pair.fraction);
    }
}

#[test]
fn a_near_object_is_fresh_in_every_frame() {
    let mut both = Both::new(CocKind::Depth, 2);
    for frame in 0..12 {
        let (picture, mut map) = scene(300, 0.0, sensor(frame, 6.0));
        let near = |x: usize, y: usize| x < 140 && y > 110;
        (0..map.metres.len()).filter(|at| near(at % 512, at / 512)).for_each(|at| map.metres[at] = 0.4);
        let pair = both.blur(&picture, &map);
        assert!(frame == 0 || pair.fraction > 0.2, "{frame}: {}", pair.fraction);
        for y in 160..256 {
            let inside = y * 512 * 3..(y * 512 + 90) * 3;
            assert!(pair.kept.rgb[inside.clone()] == pair.fresh.rgb[inside], "{frame}, row {y}");
        }
    }
}

/// A change within tiles leaves their means as they are, so that only age renews it.
#[test]
fn what_the_means_of_tiles_do_not_show_is_shown_in_the_end() {
    const SIDE: u32 = 128;
    let mut both = Both::with_size(CocKind::Uniform, 2, (SIDE, SIDE));
    let map = depth(SIDE, SIDE, |_, _| 3.5);
    let [before, after] = [0, 7].map(|flip| color(SIDE, SIDE, |x, y| [40 + grain(x ^ flip, y) / 2; 3]));
    both.blur(&before, &map);
    let next = both.blur(&after, &map);
    assert!(next.fraction == 1.0 && next.kept != next.fresh, "nothing seems to change: {}", next.fraction);
    // Twice the greatest age: what is renewed reads content beside it whose turn comes later.
    let mut shown = ColorImage::default();
    for _ in 0..2 * 128 {
        both.keeping.blur(&after, Some(&map), &both.field, &mut shown).expect("a fitting frame");
    }
    assert!(shown == next.fresh);
}

#[test]
fn the_same_frames_give_the_same_pictures_on_any_number_of_threads() {
    let mut executors = [1, 2, 3].map(|threads| Both::new(CocKind::Depth, threads));
    for frame in 0..40u32 {
        let (picture, map) = scene(60 + 3 * (frame / 10), 0.0, sensor(frame, 4.0));
        let [one, two, three] = executors.each_mut().map(|both| both.blur(&picture, &map));
        assert!(one.kept == two.kept && one.fraction == two.fraction, "{frame}");
        assert!(one.kept == three.kept && one.fraction == three.fraction, "{frame}");
    }
}

#[test]
fn pictures_of_any_size_keep_what_is_still() {
    for (width, height) in [(1, 1), (5, 7), (65, 33), (333, 201), (1300, 90), (64, 700)] {
        for kind in COC_KINDS {
            let mut both = Both::with_size(kind, 2, (width, height));
            for frame in 0..12u32 {
                // Not at the borders, whose pixels stand for all beyond.
                let left = width / 8 + (4 * frame).min(width / 4);
                let is_subject =
                    |x: u32, y: u32| (left..left + width / 4).contains(&x) && (height / 3..2 * height / 3).contains(&y);
                let picture = color(width, height, |x, y| {
                    let code = if is_subject(x, y) { 90 } else { 60 + (40 * (x / 20 % 2) + 30 * (y / 16 % 3)) as u8 };
                    [code, code + 9, code + 40]
                });
                let map = depth(width, height, |x, y| if is_subject(x, y) { 1.0 } else { 3.5 });
                let pair = both.blur(&picture, &map);
                let worst = codes_apart(&pair.kept, &pair.fresh);
                assert!(worst <= 5, "{width}x{height} {kind:?} {frame}: {worst}");
            }
        }
    }
}
