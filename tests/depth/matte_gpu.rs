//! The GPU finds the mixed pixels that the CPU finds.
//!
//! The law: of the mixed pixels that either finds, all but one in 200 are mixed on both, between the same surfaces,
//! with alphas within 0.001 and colours within 0.01 (one in 40 for a picture with few). The others are near a limit
//! where rounding decides, and so may a blob be that was traced there, or was traced from another pixel. On one device
//! the matte of a picture is always the same, to the bit.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::{common, on_gpu, portrait};

use std::sync::Arc;
use std::time::Instant;

use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::compute::Device;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::depth::background::BackgroundMemory;
use bokehcam::depth::matting::gpu::GpuMatting;
use bokehcam::depth::matting::{KnownBackground, MIN_STEP_PX, Matting, Revision};
use bokehcam::depth::refine::Refiner;
use bokehcam::frame::{ColorImage, DepthMap, Matte, MixedPixel};
use bokehcam::optics::{CocField, CocKind, DepthCoc};
use common::{coc, psnr_db, settings};
use on_gpu::{chance, device, size_of_timed, tell_of_passes};

const JUMP: f32 = 0.05;
const FRAME_NS: u64 = 33_000_000;
const ONE_IN: usize = 200;
const ONE_IN_OF_FEW: usize = 40;

type Frame = (ColorImage, DepthMap);

/// Returns a moving person with a soft outline, and with hair that the map has in part, before a slanted wall and
/// beside a pole. The depth has relative noise of `noise`, and is unknown here and there.
fn scene(size: (u32, u32), frame: usize, noise: f32) -> Frame {
    const HAIRS: usize = 24;
    let (width, height) = (size.0 as f32, size.1 as f32);
    let (middle, radius) = ([0.45 * width + 1.3 * frame as f32, 0.55 * height], 0.27 * width.min(height));
    let hairs: [[f32; 3]; HAIRS] = std::array::from_fn(|k| {
        let (sine, cosine) = (6.3 * chance(k, 77)).sin_cos();
        [cosine, sine, radius * (1.1 + 0.6 * chance(k, 78))]
    });
    let (mut color, mut map) = (ColorImage::new(size.0, size.1), DepthMap::new(size.0, size.1));
    for (k, (pixel, metres)) in color.rgb.chunks_exact_mut(3).zip(&mut map.metres).enumerate() {
        let [x, y] = [k % size.0 as usize, k / size.0 as usize];
        let (dx, dy) = (x as f32 - middle[0], y as f32 - middle[1]);
        let off = dx.hypot(dy) - radius;
        let hair = hairs.iter().map(|[cosine, sine, length]| {
            let (along, beside) = (dx * cosine + dy * sine, (dx * sine - dy * cosine).abs());
            if (0.0..*length).contains(&along) { 0.6 * (1.0 - beside).max(0.0) } else { 0.0 }
        });
        let hair = hair.fold(0.0, f32::max);
        // A far patch of a hair's colour, but wide.
        let is_patch = dx > 0.0 && (dy + 0.3 * radius).abs() < 5.0 && off < 0.6 * radius && chance(k, 41) > 0.15;
        let share = (0.5 - 0.7 * off).clamp(if is_patch { 0.4 } else { hair }, 1.0);
        let is_pole = (x as f32 - 0.85 * width).abs() < 2.2;
        for (p, code) in pixel.iter_mut().enumerate() {
            let mixed = share * [60.0, 45.0, 40.0][p] + (1.0 - share) * [150.0, 160.0, 190.0][p];
            let grain = 14.0 * chance(3 * k + p, frame) + 40.0 * chance(x / 9 * 131 + y / 9, 3);
            *code = (if is_pole { [20.0, 120.0, 30.0][p] } else { mixed } + grain) as u8;
        }
        let is_near = off < 0.0 || (hair > 0.3 && chance(k / 3, 5) < 0.3);
        let depth_m = match () {
            () if is_pole => 0.7,
            () if is_near => 1.2 + 0.05 * y as f32 / height,
            () => 3.0 + x as f32 / width,
        };
        let is_missing = chance(k, frame + 30) < 0.002;
        let unknown = [0.0, f32::NAN, f32::INFINITY][k % 3];
        *metres = if is_missing { unknown } else { depth_m * (1.0 + noise * (chance(k, frame + 9) - 0.5)) };
    }
    (color, map)
}

fn matted(matting: &mut Matting, (color, map): &Frame, behind: Option<&KnownBackground>) -> DepthMap {
    let mut map = map.clone();
    matting.find_with_background(&mut ThreadPool::new("matte", 1), (&mut map, color), JUMP, behind);
    map
}

fn is_close(a: &MixedPixel, b: &MixedPixel) -> bool {
    let same = |a: f32, b: f32, most: f32| a == b || (a - b).abs() <= most;
    let colors = a.difference.iter().zip(&b.difference).all(|(a, b)| same(*a, *b, 0.01));
    let depths = same(a.near_m, b.near_m, 1e-4 * a.near_m) && same(a.far_m, b.far_m, 1e-4 * a.far_m);
    same(a.alpha, b.alpha, 1e-3) && same(a.background_alpha, b.background_alpha, 1e-3) && depths && colors
}

fn assert_same(made: &DepthMap, expected: &DepthMap, one_in: usize, name: &str) {
    let same_bits = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
    assert!(made.metres.iter().zip(&expected.metres).all(same_bits), "{name}: the depth stays");
    let (made, expected) = (&made.matte.pixels, &expected.matte.pixels);
    assert!(made.is_sorted_by(|a, b| a.at < b.at), "{name}: row by row");
    let found = |pixel: &&MixedPixel| made.binary_search_by_key(&pixel.at, |made| made.at);
    let both = expected.iter().filter(|pixel| found(pixel).is_ok()).count();
    let close = expected.iter().filter(|pixel| found(pixel).is_ok_and(|k| is_close(&made[k], pixel))).count();
    let all = made.len() + expected.len() - both;
    let off = all - close;
    assert!(off * one_in <= all, "{name}: {off} of {all} are off, {} on one of both", all - both);
}

/// Checks the law on all these frames, one after the other. Returns the number of mixed pixels.
fn same(device: &Arc<Device>, name: &str, one_in: usize, frames: &[Frame]) -> usize {
    let (mut cpu, mut gpu) = (Matting::default(), Matting::default().with_device(Some(device)));
    let mut all = 0;
    for (k, frame) in frames.iter().enumerate() {
        let [expected, made] = [&mut cpu, &mut gpu].map(|matting| matted(matting, frame, None));
        assert_same(&made, &expected, one_in, &format!("{name}, frame {k}"));
        assert!(made.matte.pixels.len() <= Matte::max_pixels(made.width as usize, made.height as usize));
        all += made.matte.pixels.len();
    }
    assert_eq!(gpu.backends(), "gpu", "{name}");
    all
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn mattes_agree_whatever_the_size() {
    let device = device();
    let small = [(1, 1), (3, 2), (7, 60), (60, 7), (1, 50), (50, 1), (300, 3), (17, 13), (33, 65), (8, 8), (9, 33)];
    for size in small {
        same(&device, &format!("{size:?}"), ONE_IN_OF_FEW, &[scene(size, 0, 0.0), scene(size, 1, 0.02)]);
    }
    for size in [(160, 120), (161, 119), (333, 90), (90, 400), (320, 256)] {
        let mixed = same(&device, &format!("{size:?}"), ONE_IN, &[scene(size, 0, 0.0)]);
        assert!(mixed > 500, "{size:?} has {mixed}");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn mattes_agree_whatever_the_noise() {
    let device = device();
    // Where all is noise, rounding decides more comparisons, and what is traced from there.
    let one_in = |noise| if noise > 0.2 { ONE_IN_OF_FEW } else { ONE_IN };
    let count = |noise| same(&device, &format!("{noise}"), one_in(noise), &[scene((200, 150), 2, noise)]);
    let counts = [0.0, 0.01, 0.05, 0.1, 0.14, 0.3, 1.5].map(count);
    assert!(counts[3] > 2 * counts[0], "more edges, more to mix: {counts:?}");
    assert!(
        counts[5..].iter().all(|count| *count > counts[0]),
        "more edges than a picture has: the largest stay, {counts:?}"
    );
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn sequences_agree_and_nothing_is_left_of_the_frame_before() {
    let device = device();
    let sizes = [(160, 120), (160, 120), (160, 120), (90, 60), (160, 120)];
    let frames: Vec<_> = sizes.iter().enumerate().map(|(k, size)| scene(*size, 3 * k, 0.05 * (k % 3) as f32)).collect();
    same(&device, "a sequence", ONE_IN, &frames);
    let mut busy = Matting::default().with_device(Some(&device));
    for frame in frames.iter().chain(&frames) {
        let mut fresh = Matting::default().with_device(Some(&device));
        let [again, alone] = [&mut busy, &mut fresh].map(|matting| matted(matting, frame, None).matte);
        assert!(again == alone, "to the bit");
    }
    let (color, map) = &frames[0];
    for jump in [f32::INFINITY, f32::NAN, 1e6] {
        let mut map = map.clone();
        busy.find_mixed_pixels(&mut map, color, jump);
        assert!(map.matte.pixels.is_empty(), "beyond {jump} there is none");
    }
    let mut other = frames[3].1.clone();
    busy.find_mixed_pixels(&mut other, color, JUMP);
    assert!(other.matte.pixels.is_empty(), "of another size");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_is_known_behind_counts_as_on_the_processor() {
    let device = device();
    let (mut cpu, mut gpu) = (Matting::default(), Matting::default().with_device(Some(&device)));
    for (k, size) in [(160, 120), (160, 120), (161, 77), (161, 77), (161, 77)].into_iter().enumerate() {
        let frame = scene(size, k, 0.01);
        let pixels = frame.1.metres.len();
        // The wall, as far as it was randomly seen; the camera's exposure has changed since.
        let rgb: Vec<_> = (0..3 * pixels).map(|n| (165.0 + 20.0 * chance(n, k)) as u8).collect();
        let inverse: Vec<_> = (0..pixels).map(|n| 0.29 + 0.4 * (chance(n, 8) - 0.5).max(0.0)).collect();
        let rounds: Vec<_> = (0..pixels).map(|n| (4.0 * chance(n / 5, 9)) as u8).collect();
        let light: Box<[[f32; 256]; 3]> =
            Box::new([1.0, 0.9, 1.1].map(|gain| std::array::from_fn(|n| gain * (n as f32 / 255.0).powf(2.2))));
        let behind = KnownBackground {
            rgb: &rgb,
            inverse: &inverse,
            rounds: &rounds,
            min_rounds: 2,
            light: &light,
            surface_step: 2.0 * JUMP,
            revision: Revision { picture: 1000 + k as u64, rounds: 2000 + k as u64 },
        };
        for behind in [Some(&behind), None, Some(&behind)] {
            let [expected, made] = [&mut cpu, &mut gpu].map(|matting| matted(matting, &frame, behind));
            assert_same(&made, &expected, ONE_IN, &format!("frame {k}, known: {}", behind.is_some()));
            let known = |pixel: &&MixedPixel| pixel.background_alpha == 1.0 && pixel.alpha > 0.1;
            let known = made.matte.pixels.iter().filter(known).count();
            assert!((known > 15) == behind.is_some(), "frame {k}: behind {known} it is known");
        }
    }
    assert_eq!(gpu.backends(), "gpu");
}

fn lens(size: (u32, u32)) -> DepthCoc {
    let CocField::Depth(lens) = coc(CocKind::Depth, size.1) else { panic!("asked for depth") };
    lens
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_is_remembered_of_a_sequence_counts_as_on_the_processor() {
    let (device, size) = (device(), (160, 120));
    let mut workers = ThreadPool::new("depth", 1);
    let (mut cpu, mut gpu) = (Matting::default(), Matting::default().with_device(Some(&device)));
    let (mut background, lens) = (BackgroundMemory::default(), lens(size));
    let mut known = 0;
    for k in 0..60 {
        // A moving person uncovers background.
        let (color, map) = scene(size, k / 2, 0.0);
        let [mut expected, mut made] = [map.clone(), map];
        background.find_matte(&mut cpu, &mut workers, (&mut expected, &color), &lens);
        background.find_matte(&mut gpu, &mut workers, (&mut made, &color), &lens);
        assert_same(&made, &expected, ONE_IN, &format!("frame {k}"));
        known += made.matte.pixels.iter().filter(|pixel| pixel.background_alpha == 1.0 && pixel.alpha > 0.1).count();
        background.update(&mut workers, (&expected, &color), &lens, k as u64 * FRAME_NS);
    }
    assert!(known > 100, "behind {known} pixels it is known");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn blurred_pictures_are_alike() {
    let device = device();
    let mut refiner = Refiner::new();
    let mut recorded = |index: usize| {
        let (color, mut map, _) = portrait::frame(index);
        refiner.refine(&mut map, &color, index as u64 * FRAME_NS);
        (color, map)
    };
    let frames = [recorded(0), recorded(1), recorded(7), scene((320, 240), 0, 0.0), scene((320, 240), 5, 0.02)];
    for (k, (color, map)) in frames.iter().enumerate() {
        let lens = lens(color.size());
        let [expected, made] = [None, Some(&device)].map(|device| {
            let mut map = map.clone();
            Matting::default().with_device(device).find_mixed_pixels(
                &mut map,
                color,
                lens.inverse_depth_step(MIN_STEP_PX),
            );
            map
        });
        assert_same(&made, &expected, ONE_IN, &format!("frame {k}"));
        assert!(made.matte.pixels.len() > 1000, "frame {k} has {}", made.matte.pixels.len());
        let [with_made, with_expected] = [&made, &expected].map(|map| {
            let plan = Plan::new(&settings(CocKind::Depth), color.width, color.height);
            let mut out = ColorImage::default();
            CpuBokeh::new(plan, Some(1))
                .blur(color, Some(map), &CocField::Depth(lens), &mut out)
                .expect("it is blurred");
            out
        });
        let alike_db = psnr_db(&with_made, &with_expected);
        assert!(alike_db >= 60.0, "frame {k}: {alike_db} dB");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_map_that_was_refined_there_need_not_go_up() {
    let device = device();
    let (mut refiner, mut matting) =
        (Refiner::new().with_device(Some(&device)), Matting::default().with_device(Some(&device)));
    for (k, size) in [(160, 120), (160, 120), (91, 63), (160, 120)].into_iter().enumerate() {
        let (color, mut map) = scene(size, 4 * k, 0.01);
        if k == 3 {
            // The refiner has nothing to refine.
            refiner.reset();
            map.metres.fill(0.0);
        }
        refiner.refine(&mut map, &color, k as u64 * FRAME_NS);
        assert_eq!(refiner.device_frame().is_some(), k < 3);
        let frame = (color, map);
        matting.set_device_frame(refiner.device_frame());
        let of_device = matted(&mut matting, &frame, None).matte;
        // The device copy can be used once only: this frame is uploaded.
        let of_memory = matted(&mut matting, &frame, None).matte;
        assert!(of_device == of_memory && (of_device.pixels.len() > 300) == (k < 3), "frame {k}");
        let unknown = (frame.0.clone(), DepthMap::new(size.0, size.1));
        matting.set_device_frame(refiner.device_frame());
        let taken = matted(&mut matting, &unknown, None).matte;
        assert!(taken == of_device, "frame {k}: what was taken is what the device has");
        assert!(matted(&mut matting, &unknown, None).matte.pixels.is_empty(), "frame {k}: it is taken once");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_device_that_is_gone_is_followed_by_the_processor() {
    for gone_before in [0, 1, 3] {
        let device = device();
        let (mut cpu, mut gpu) = (Matting::default(), Matting::default().with_device(Some(&device)));
        for k in 0..5 {
            if k == gone_before {
                device.device.destroy();
            }
            let frame = scene((90, 60), k, 0.0);
            let [expected, made] = [&mut cpu, &mut gpu].map(|matting| matted(matting, &frame, None));
            assert_same(&made, &expected, ONE_IN_OF_FEW, &format!("frame {k}, gone before {gone_before}"));
            assert!(k < gone_before || made.matte == expected.matte, "to the bit");
        }
        assert_eq!(gpu.backends(), "gpu, then cpu");
        assert_eq!(Matting::default().with_device(Some(&device)).backends(), "cpu", "nobody tries that device again");
    }
}

/// Prints the pass times, of frames of any size: `BOKEHCAM_SIZE=1280x720 cargo test --release --test depth -- --ignored
/// --nocapture matte_gpu::the_passes`.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn the_passes_of_a_frame_take_less_time_than_the_frame() {
    let (device, size) = (device(), size_of_timed());
    let mut gpu = GpuMatting::new(&device);
    for frame in 0..5 {
        let (color, mut map) = scene(size, frame, 0.0);
        let began = Instant::now();
        gpu.find_mixed_pixels((&mut map, &color), None, JUMP, None).expect("the GPU finds mattes");
        tell_of_passes(&device, began.elapsed(), &gpu.pass_times());
    }
}
