//! One executor for all quality levels gives, at each level, the result of an executor made for that level alone.
#![allow(missing_docs)]

use crate::{common, portrait};

use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Method, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::depth::focus::{Focus, FocusRule};
use bokehcam::depth::refine::Refiner;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc};
use bokehcam_lab::synthetic::Synthetic;
use bokehcam_live::capture::synthetic::Format;
use bokehcam_live::capture::{Camera, Captured, FrameBuffers};
use common::{COC_KINDS, Numbers, coc, depth, noise, psnr_db, settings, three_depths};

const SIZE: (u32, u32) = (150, 110);

/// Maps that need different bins: three depths, only far, all in focus, a slope, near and far.
fn maps() -> Vec<DepthMap> {
    let (width, height) = SIZE;
    let slope = depth(width, height, |x, _| 0.5 + 4.0 * x as f32 / width as f32);
    let two = depth(width, height, |x, y| if (x + y) % 60 < 20 { 0.45 } else { 6.0 });
    let flat = |z_m: f32| depth(width, height, move |_, _| z_m);
    vec![three_depths(width, height), flat(9.0), flat(1.0), slope, two]
}

fn blurred(cpu: &mut CpuBokeh, image: &ColorImage, map: &DepthMap, settings: &Settings) -> ColorImage {
    let mut out = ColorImage::default();
    cpu.blur(image, Some(map), &coc(settings.coc, SIZE.1), &mut out).expect("a blur");
    out
}

fn check(settings: Settings, what: &str) {
    let (image, maps) = (noise(SIZE.0, SIZE.1), maps());
    let plan = |settings: &Settings| Plan::new(settings, SIZE.0, SIZE.1);
    // The result of each map at each level, by an executor of its own.
    let alone: Vec<Vec<ColorImage>> = Quality::ALL
        .iter()
        .map(|&quality| {
            let settings = Settings { quality, ..settings.clone() };
            maps.iter()
                .map(|map| blurred(&mut CpuBokeh::new(plan(&settings), Some(1)), &image, map, &settings))
                .collect()
        })
        .collect();
    let all = Settings { adaptive: true, ..settings };
    let mut cpu = CpuBokeh::new(plan(&all), Some(2));
    let mut numbers = Numbers(11);
    for step in 0..60 {
        let quality = Quality::ALL[(numbers.next() * Quality::ALL.len() as f32) as usize];
        let map = (numbers.next() * maps.len() as f32) as usize;
        cpu.set_quality(quality);
        let out = blurred(&mut cpu, &image, &maps[map], &all);
        assert!(out == alone[quality as usize][map], "{what}: step {step}, {quality}, map {map}");
    }
}

#[test]
fn any_sequence_of_levels_is_bit_identical_to_each_alone() {
    for effect in COC_KINDS {
        check(Settings { highlights: 4.0, ..settings(effect) }, &format!("{effect:?}"));
    }
    check(Settings { rank: Some(Rank::Terms(6)), ..settings(CocKind::Depth) }, "one rank for all");
    check(Settings { far_max_px: 60.0, near_max_px: 90.0, ..settings(CocKind::Depth) }, "large");
}

#[test]
fn the_comparison_methods_have_levels_too() {
    for rank in [None, Some(Rank::Full)] {
        check(Settings { method: Method::Gather, rank, ..settings(CocKind::Depth) }, &format!("gather {rank:?}"));
    }
}

#[test]
fn an_executor_of_one_level_keeps_it() {
    let settings = settings(CocKind::Depth);
    let (image, map) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    let mut cpu = CpuBokeh::new(Plan::new(&settings, SIZE.0, SIZE.1), Some(1));
    let before = blurred(&mut cpu, &image, &map, &settings);
    cpu.set_quality(Quality::Best);
    assert!(blurred(&mut cpu, &image, &map, &settings) == before);
}

#[test]
fn one_level_takes_no_memory_for_others() {
    for effect in COC_KINDS {
        let one = Plan::new(&settings(effect), SIZE.0, SIZE.1);
        let all = Plan::new(&Settings { adaptive: true, ..settings(effect) }, SIZE.0, SIZE.1);
        assert_eq!((one.ladder.iter().count(), one.ladder.banks.len()), (1, 1));
        assert_eq!(all.ladder.iter().count(), Quality::ALL.len());
        assert!(one.slot_count() <= all.slot_count() && all.ladder.banks.len() <= 4, "levels share filters");
    }
}

/// Pictures with their depth and time.
type Frames = Vec<(ColorImage, DepthMap, u64)>;

/// Returns frames of the bundled recording and of the synthetic scene, with their depth and time.
fn scenes() -> [(&'static str, Frames); 2] {
    const FRAMES: usize = 6;
    let mut refiner = Refiner::new();
    let recorded = (0..FRAMES).map(|index| {
        let (color, mut map, time_ns) = portrait::frame(index);
        refiner.refine(&mut map, &color, time_ns);
        (color, map, time_ns)
    });
    let recorded = recorded.collect();
    let format = Format { size: (640, 360), fps: 30.0, frames: None, threads: 2 };
    let mut camera = Synthetic::new(format).expect("a scene");
    let synthetic = (0..FRAMES).map(|_| {
        let (mut color, mut map) = (ColorImage::default(), DepthMap::default());
        let captured = camera
            .next(FrameBuffers { color: &mut color, depth: &mut map, right: &mut GrayImage::default() })
            .expect("a frame");
        let Captured::Frame(stamp) = captured else { panic!("{captured:?}") };
        (color, map, stamp.time_ns)
    });
    [("recording", recorded), ("synthetic", synthetic.collect())]
}

/// A change of level changes the picture no more than the step from one frame to the next does.
#[test]
fn a_change_of_level_is_no_jump() {
    let lens =
        |focus_m| CocField::Depth(DepthCoc { coc_at_infinity_px: 14.0, focus_m, range_m: 0.0, max_coc_px: 22.0 });
    for (name, frames) in scenes() {
        let settings = Settings { adaptive: true, far_max_px: 14.0, near_max_px: 22.0, ..settings(CocKind::Depth) };
        let mut cpu = CpuBokeh::new(Plan::new(&settings, frames[0].0.width, frames[0].0.height), Some(2));
        let mut focus = Focus::new(FocusRule::Auto);
        let blurred: Vec<Vec<ColorImage>> = frames
            .iter()
            .map(|(color, map, time_ns)| {
                let field = lens(focus.focus_m(map, *time_ns));
                let mut at = |quality| {
                    let mut out = ColorImage::default();
                    cpu.set_quality(quality);
                    cpu.blur(color, Some(map), &field, &mut out).expect("a blur");
                    out
                };
                Quality::ALL.map(&mut at).into()
            })
            .collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / (frames.len() - 1) as f64;
        for level in 0..Quality::ALL.len() - 1 {
            let jump_db = mean(&mut (1..frames.len()).map(|k| psnr_db(&blurred[k][level], &blurred[k][level + 1])));
            // With and without a change of level, from one frame to the next.
            let still_db = mean(&mut (1..frames.len()).map(|k| psnr_db(&blurred[k - 1][level], &blurred[k][level])));
            let both_db = mean(&mut (1..frames.len()).map(|k| psnr_db(&blurred[k - 1][level], &blurred[k][level + 1])));
            let levels = format!("{} to {}", Quality::ALL[level], Quality::ALL[level + 1]);
            println!("{name}, {levels}: {jump_db:.1} dB; a frame on {still_db:.1} dB, with the change {both_db:.1} dB");
            assert!(jump_db > 34.0, "{name}, {levels}: {jump_db} dB");
        }
    }
}
