//! The GPU executor agrees with the CPU executor, pass by pass and as a whole.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::bokeh::bank::STEPS_PER_PX;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::gpu::GpuBokeh;
use bokehcam::bokeh::ladder::Compositing;
use bokehcam::bokeh::plan::{CELL, Plan, SEGMENT};
use bokehcam::bokeh::{Bokeh, Job, Method, Probe, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::depth::matting::{self, Matting};
use bokehcam::frame::{ColorImage, DepthMap, MixedPixel};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc, Ramp};
use common::{COC_KINDS, Numbers, coc, codes_apart, color, depth, noise, settings, shapes, three_depths};

/// Limit of the difference of an 8-bit value, in codes: at most one in a thousand may exceed it, none may exceed its
/// double. A radius between two nodes of the bank may round to either.
const CODES: u8 = 2;
/// Limit of the difference of a radius: one node of the bank.
const RADIUS_PX: f32 = 1.0 / STEPS_PER_PX;
/// Limit of the difference of a bin before filtering, in linear light or coverage: the GPU stores half precision.
const LIGHT_IN: f32 = 5e-4;
/// Limit of the difference of a filtered bin.
const LIGHT: f32 = 2e-3;

fn gpu(plan: &Plan) -> GpuBokeh {
    GpuBokeh::new(plan, false, None).expect("a Vulkan adapter, software included")
}

fn job(ticket: u64, color: &ColorImage, map: &DepthMap, field: &CocField) -> Job {
    let job = Job::new(Pooled::detached(color.clone()), Some(Pooled::detached(map.clone())), *field);
    Job { ticket, ..job }
}

fn same(settings: &Settings, image: &ColorImage, map: &DepthMap, field: &CocField, what: &str) {
    same_but(LIGHT_IN, settings, image, map, field, what);
}

/// Checks both executors, with bins that may differ by `light_in` before filtering.
fn same_but(light_in: f32, settings: &Settings, image: &ColorImage, map: &DepthMap, field: &CocField, what: &str) {
    let mut plan = Plan::new(settings, image.width, image.height);
    let mut cpu = CpuBokeh::new(plan.clone(), Some(2));
    let mut gpu = gpu(&plan);
    plan.split_by_depth(Some(map), field);
    let mut expected = ColorImage::default();
    cpu.blur(image, Some(map), field, &mut expected).expect("the CPU blurs");
    gpu.submit(job(3, image, map, field)).expect("the GPU takes a frame");
    let finished = gpu.collect(true).expect("the GPU blurs").expect("a frame comes back");
    assert_eq!(finished.ticket, 3);
    assert_eq!(finished.picture.memory().unwrap().size(), image.size());

    for k in (0..plan.bins.len()).filter(|&k| cpu.is_present(k) && plan.compositing != Compositing::Gather) {
        let (bin, around) = (&plan.bins[k], (plan.radius_cells(&plan.bins[k]) + 1) * CELL);
        let edges = bin.width.next_multiple_of(64) / SEGMENT + 1;
        for probe in [Probe::Bin(k), Probe::Reach(k), Probe::Blur(k)] {
            // The position of a value in bin pixels, the radius of bin pixels that it depends on, and its limit.
            let (at, around, limit): (&dyn Fn(usize) -> (usize, usize), usize, f32) = match probe {
                Probe::Bin(_) => (&|n| (n % bin.width, n / bin.width), 0, light_in),
                Probe::Reach(_) => (&|n| (n / 2 % edges * SEGMENT, n / 2 / edges * CELL), around, RADIUS_PX),
                Probe::Blur(_) => (&|n| (n % bin.width, n / bin.width), 2 * around, LIGHT),
            };
            let (mut ours, mut theirs) = (cpu.probe(probe), gpu.probe(probe).expect("a probe"));
            assert_eq!(ours.len(), theirs.len(), "{what}: {probe:?}");
            // The CPU leaves bins empty where the whole neighbourhood is in focus.
            for (n, (a, b)) in ours.iter_mut().zip(&mut theirs).enumerate() {
                if cpu.is_idle_around(at(n), around, bin.scale) {
                    (*a, *b) = ([0.0; 4], [0.0; 4]);
                }
            }
            close(&ours, &theirs, limit, &format!("{what}: {probe:?}"));
        }
    }
    let differences: Vec<u8> =
        finished.picture.memory().unwrap().rgb.iter().zip(&expected.rgb).map(|(a, b)| a.abs_diff(*b)).collect();
    let beyond = differences.iter().filter(|&&d| d > CODES).count();
    let worst = differences.iter().max().copied().unwrap_or(0);
    assert!(beyond <= differences.len() / 1000 + 1 && worst <= 2 * CODES, "{what}: {beyond} beyond, worst {worst}");
}

/// Equal up to `limit`, relative to values above 1; at most one value in a thousand may be off by ten times as much,
/// where rounding fell the other way.
fn close(a: &[[f32; 4]], b: &[[f32; 4]], limit: f32, what: &str) {
    assert_eq!(a.len(), b.len(), "{what}");
    let off = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(1.0);
    let differences: Vec<f32> = a.as_flattened().iter().zip(b.as_flattened()).map(off).collect();
    let beyond = differences.iter().filter(|d| d.is_nan() || **d > limit).count();
    let worst = differences.iter().copied().fold(0.0, f32::max);
    let some = differences.len() / 1000 + 1;
    assert!(
        beyond <= some && worst <= 10.0 * limit,
        "{what}: {beyond} of {} beyond {limit}, worst {worst}; first {:?}",
        a.len() * 4,
        a.iter().zip(b).enumerate().find(|(_, (a, b))| (0..4).any(|k| off((&a[k], &b[k])) > limit || b[k].is_nan()))
    );
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn every_effect_and_quality_agrees() {
    let (image, map) = (noise(97, 71), three_depths(97, 71));
    for effect in COC_KINDS {
        for quality in Quality::ALL {
            let settings = Settings { quality, ..settings(effect) };
            same(&settings, &image, &map, &coc(effect, 71), &format!("{effect:?} {quality}"));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn private_blurs_agree() {
    let (image, map) = (noise(197, 141), three_depths(197, 141));
    for effect in COC_KINDS {
        for (quality, rank) in [(Quality::Draft, None), (Quality::Best, None), (Quality::Balanced, Some(Rank::Full))] {
            // Cells of several pixels of a bin in some, and pixels of a bin as cells in others.
            for far_max_px in [9.0, 16.0, 35.0] {
                let settings = Settings { privacy: true, quality, rank, far_max_px, ..settings(effect) };
                let field = match coc(effect, 141) {
                    CocField::Uniform { .. } => CocField::Uniform { radius_px: far_max_px },
                    CocField::Ramp(ramp) => CocField::Ramp(Ramp { max_px: far_max_px, ..ramp }),
                    CocField::Depth(lens) => CocField::Depth(DepthCoc { coc_at_infinity_px: 1.4 * far_max_px, ..lens }),
                };
                same(&settings, &image, &map, &field, &format!("{effect:?} {quality} {rank:?} {far_max_px} px"));
            }
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn near_layers_agree() {
    let (width, height) = (150, 80);
    let image = noise(width, height);
    // Staircases towards the camera, which occlude each other and the wall.
    let near_m = [0.25, 0.36, 0.5, 0.66, 0.8, 1.0, 4.0];
    let map = depth(width, height, |x, y| near_m[((x + y / 3) / 12 % 7) as usize]);
    for quality in Quality::ALL {
        let settings = Settings { quality, near_max_px: 24.0, ..settings(CocKind::Depth) };
        // The GPU stores CoC to a thousandth of a pixel, and small differences of CoC separate surfaces.
        same_but(5.0 * LIGHT_IN, &settings, &image, &map, &coc(CocKind::Depth, height), &format!("{quality}"));
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn every_aperture_and_rank_agrees() {
    let (image, map) = (noise(80, 60), three_depths(80, 60));
    for shape in shapes() {
        for rank in [Rank::Terms(1), Rank::Terms(6)] {
            let aperture = Aperture { shape: shape.clone(), intensity: 0.3 };
            let settings = Settings { aperture, rank: Some(rank), highlights: 6.0, ..settings(CocKind::Depth) };
            same(&settings, &image, &map, &coc(CocKind::Depth, 60), &format!("{shape:?} {rank:?}"));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn the_comparison_methods_agree() {
    let (image, map) = (noise(64, 48), three_depths(64, 48));
    for rank in [Rank::Terms(3), Rank::Full] {
        let aperture = Aperture { shape: Shape::Heart, intensity: 0.0 };
        let settings = Settings { method: Method::Gather, rank: Some(rank), aperture, ..settings(CocKind::Depth) };
        same(&settings, &image, &map, &coc(CocKind::Depth, 48), &format!("gather {rank:?}"));
    }
}

/// Above 16 px the filter radii are spaced evenly per octave, no longer per pixel.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn wide_radii_agree() {
    let (image, map) = (noise(64, 48), three_depths(64, 48));
    let field = CocField::Depth(DepthCoc { coc_at_infinity_px: 37.3, focus_m: 1.0, range_m: 0.0, max_coc_px: 51.7 });
    for (method, rank) in [(Method::Gather, Rank::Terms(2)), (Method::Layered, Rank::Full)] {
        let (far_max_px, near_max_px) = (37.3, 51.7);
        let settings = Settings { method, rank: Some(rank), far_max_px, near_max_px, ..settings(CocKind::Depth) };
        same(&settings, &image, &map, &field, &format!("wide {method:?} {rank:?}"));
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_range_of_focus_agrees() {
    let (width, height) = (97, 71);
    let (image, slope) = (noise(width, height), depth(width, height, |x, y| 0.3 + 0.02 * (x + y / 7) as f32));
    for (focus_m, range_m) in [(1.0, 0.3), (1.1, 1.0), (0.7, 9.0)] {
        let lens = DepthCoc { coc_at_infinity_px: 12.0, focus_m, range_m, max_coc_px: 18.0 };
        for (name, map) in [("slope", &slope), ("three depths", &three_depths(width, height))] {
            let what = format!("{name} {range_m} m around {focus_m} m");
            same(&settings(CocKind::Depth), &image, map, &CocField::Depth(lens), &what);
        }
    }
}

/// Pixels that mix two surfaces, some of which lie in front of the focal plane and occlude others.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn mixed_pixels_agree() {
    let (width, height) = (97, 71);
    let (grain, mut map) = (noise(width, height), three_depths(width, height));
    // A colour for each depth, with outlines as soft as a mean over 3x3 pixels.
    let hard = |x: u32, y: u32, p: usize| match map.metres[(y * width + x) as usize] {
        0.6 => [90, 160, 60][p],
        1.0 => [220, 120, 100][p],
        _ => [40, 60, 120][p] + u32::from(grain.rgb[3 * (y * width + x) as usize + p]) / 8,
    };
    let image = color(width, height, |x, y| {
        let near = |at: u32, end: u32| at.saturating_sub(1)..(at + 2).min(end);
        let around = || near(y, height).flat_map(|y| near(x, width).map(move |x| (x, y)));
        std::array::from_fn(|p| (around().map(|(x, y)| hard(x, y, p)).sum::<u32>() / around().count() as u32) as u8)
    });
    let field = coc(CocKind::Depth, 71);
    let CocField::Depth(lens) = field else { panic!("asked for depth") };
    Matting::default().find_mixed_pixels(&mut map, &image, lens.inverse_depth_step(matting::MIN_STEP_PX));
    assert!(map.matte.pixels.len() > 100, "{} mixed pixels", map.matte.pixels.len());
    // The hidden background is known behind some of the in-focus pixels.
    let of_others: Vec<u32> = (0..width * height).filter(|at| at % 5 < 2 && map.metres[*at as usize] == 1.0).collect();
    for at in of_others {
        if let Err(place) = map.matte.pixels.binary_search_by_key(&at, |pixel| pixel.at) {
            let known = MixedPixel {
                at,
                near_m: 1.0,
                far_m: 3.0,
                alpha: 1.0,
                background_alpha: 1.0,
                difference: [0.1, -0.05, 0.02],
            };
            map.matte.pixels.insert(place, known);
        }
    }
    for quality in Quality::ALL {
        for highlights in [0.0, 6.0] {
            let settings = Settings { quality, highlights, ..settings(CocKind::Depth) };
            same(&settings, &image, &map, &field, &format!("mixed, {quality}, {highlights}"));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn odd_inputs_agree() {
    let settings = settings(CocKind::Depth);
    for (width, height) in [(17, 13), (1, 1), (4096, 2), (3, 130)] {
        let (image, map) = (noise(width, height), three_depths(width, height));
        same(&settings, &image, &map, &coc(CocKind::Depth, height), &format!("{width}x{height}"));
    }
    let (width, height) = (70, 50);
    let constant = color(width, height, |_, _| [7, 130, 255]);
    let point = color(width, height, |x, y| if (x, y) == (31, 22) { [255; 3] } else { [3; 3] });
    let mut numbers = Numbers(3);
    let maps = [
        ("unknown", depth(width, height, |_, _| 0.0)),
        ("not a number", depth(width, height, |x, _| if x % 3 == 0 { f32::NAN } else { 2.0 })),
        (
            "extreme",
            depth(width, height, |_, _| [1e-7, 1.0, 1e9, f32::INFINITY, -4.0][(numbers.next() * 5.0) as usize]),
        ),
        ("small", three_depths(35, 25)),
        ("all in front", depth(width, height, |_, _| 0.5)),
    ];
    for (name, map) in &maps {
        for (kind, image) in [("constant", &constant), ("point", &point), ("noise", &noise(width, height))] {
            same(&settings, image, map, &coc(CocKind::Depth, height), &format!("{name} {kind}"));
        }
    }
}

/// Most of the picture is in focus, far from the rest: the CPU skips the unneeded work, with an equal result.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_the_cpu_leaves_out_makes_no_difference() {
    let (width, height) = (640, 200);
    let image = noise(width, height);
    for (name, metres) in [("far", 4.0), ("slightly far", 1.2), ("near", 0.5)] {
        let map = depth(width, height, |x, y| if x + y < 130 { metres } else { 1.0 + 1e-4 * (x % 7) as f32 });
        same(&settings(CocKind::Depth), &image, &map, &coc(CocKind::Depth, height), name);
    }
}

/// One executor for all levels gives, at each level, the result of an executor made for that level, to the bit.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn any_sequence_of_levels_agrees() {
    let (width, height) = (97, 71);
    let image = noise(width, height);
    let maps = [three_depths(width, height), depth(width, height, |x, _| 0.4 + 0.05 * x as f32)];
    for effect in COC_KINDS {
        let all = Settings { adaptive: true, ..settings(effect) };
        let field = coc(effect, height);
        let blurred = |gpu: &mut GpuBokeh, map: &DepthMap, quality| {
            gpu.submit(Job { quality, ..job(0, &image, map, &field) }).expect("room for a frame");
            gpu.collect(true).expect("a frame").expect("one is in flight").picture.memory().unwrap().clone()
        };
        let alone: Vec<Vec<ColorImage>> = (Quality::ALL.iter())
            .map(|&quality| {
                let mut gpu = gpu(&Plan::new(&Settings { quality, ..settings(effect) }, width, height));
                maps.iter().map(|map| blurred(&mut gpu, map, Quality::Draft)).collect()
            })
            .collect();
        let mut gpu = gpu(&Plan::new(&all, width, height));
        let mut numbers = Numbers(5);
        for step in 0..20 {
            let (level, map) = ((numbers.next() * Quality::ALL.len() as f32) as usize, (numbers.next() * 2.0) as usize);
            let out = blurred(&mut gpu, &maps[map], Quality::ALL[level]);
            assert!(out == alone[level][map], "{effect:?}: step {step}, {}", Quality::ALL[level]);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn frames_in_flight_come_back_in_order_and_whole() {
    let (width, height) = (64, 48);
    let plan = Plan::new(&settings(CocKind::Depth), width, height);
    let (mut gpu, mut cpu) = (gpu(&plan), CpuBokeh::new(plan, Some(1)));
    let (image, field) = (noise(width, height), coc(CocKind::Depth, height));
    let map = |k: u64| depth(width, height, |x, _| if u64::from(x) > 8 * (k % 7) { 1.0 } else { 3.0 });
    let (mut next, mut back) = (0, 0);
    while back < 20 {
        while next < 20 && gpu.in_flight() < gpu.capacity() {
            gpu.submit(job(next, &image, &map(next), &field)).expect("room for a frame");
            next += 1;
        }
        let finished = gpu.collect(true).expect("a frame").expect("one is in flight");
        assert_eq!(finished.ticket, back);
        let mut expected = ColorImage::default();
        cpu.blur(&image, Some(&map(back)), &field, &mut expected).expect("a blur");
        assert!(codes_apart(finished.picture.memory().unwrap(), &expected) <= CODES, "frame {back}");
        assert!(finished.times.iter().count() > 0);
        back += 1;
    }
    assert!(gpu.collect(true).expect("nothing is no failure").is_none());
}
