//! The GPU refines depth like the CPU.
//!
//! The law, for every frame of a sequence: pixels are unknown on both or on neither; and all depths but one in 500
//! agree to a relative difference of 1e-4, as a comparison may fall either way where rounding decides it, and moves a
//! pixel, or the end of a row of them, to another surface. Hardware fuses multiplications with additions: there, one in
//! 500 may be off by more than 1e-3, and one in 250 by more than 1e-4.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::{on_gpu, portrait};

use std::sync::Arc;
use std::time::Instant;

use bokehcam::compute::Device;
use bokehcam::depth::refine::Refiner;
use bokehcam::depth::refine::gpu::GpuRefiner;
use bokehcam::frame::{ColorImage, DepthMap};
use on_gpu::{chance, device, size_of_timed, tell_of_passes};

const FRAME_NS: u64 = 33_000_000;
/// Relative differences, and one in how many depths may exceed each.
const LIMITS: [(f32, usize); 1] = [(1e-4, 500)];
const HARDWARE_LIMITS: [(f32, usize); 2] = [(1e-3, 500), (1e-4, 250)];

/// A frame: picture, map, media time, and focus distance.
type Frame = (ColorImage, DepthMap, u64, f32);

/// Returns a moving person before a slanted wall and beside a pole, with colours that change at other places than depth
/// does. Holes are shadows beside near objects, a frame at the border, and random pixels and runs with the probability
/// `missing`.
fn scene(size: (u32, u32), from: (u32, u32), frame: usize, missing: f32) -> (ColorImage, DepthMap) {
    // 2 is the pole, 1 the person, 0 the wall; positions are fractions of the picture.
    let surface = |x: f32, y: f32, wider: f32| {
        let (dx, dy) = (x - 0.45 - 0.004 * frame as f32, y - 0.6);
        let is_person = dx * dx * 2.0 + dy * dy < (0.3 + wider).powi(2);
        if (x - 0.8).abs() < 0.02 + wider { 2 } else { usize::from(is_person) }
    };
    let mut color = ColorImage::new(size.0, size.1);
    for (k, pixel) in color.rgb.chunks_exact_mut(3).enumerate() {
        let place = [k % size.0 as usize, k / size.0 as usize].map(|at| at as f32 + 0.5);
        let of = surface(place[0] / size.0 as f32, place[1] / size.1 as f32, 0.0);
        let base = [[170.0, 180.0, 200.0], [60.0, 50.0, 45.0], [120.0, 40.0, 40.0]][of];
        let grain = 10.0 * chance(k, frame) + 30.0 * chance(k / 7, 0);
        pixel.copy_from_slice(&base.map(|value| (value + grain) as u8));
    }
    let mut map = DepthMap::new(from.0, from.1);
    for (k, metres) in map.metres.iter_mut().enumerate() {
        let (column, row) = (k % from.0 as usize, k / from.0 as usize);
        let (x, y) = ((column as f32 + 0.5) / from.0 as f32, (row as f32 + 0.5) / from.1 as f32);
        let of = surface(x, y, 0.012);
        let depth_m = [3.0 + x + 0.3 * y, 1.1 + 0.1 * y, 0.7][of];
        let is_shadow = of == 0 && surface(x + 0.03, y, 0.012) > 0;
        let is_frame = x < 0.03 || y > 0.97;
        let is_missing = chance(k, frame + 50) < missing || chance(k / 5, frame + 60) < 0.6 * missing;
        *metres = match () {
            () if is_shadow || is_frame || is_missing => [0.0, f32::NAN, -1.0][k % 3],
            () => depth_m * (1.0 + 0.006 * (chance(k, frame + 9) - 0.5)),
        };
    }
    (color, map)
}

fn scenes(size: (u32, u32), from: (u32, u32), count: usize, missing: f32) -> Vec<Frame> {
    let frame = |frame: usize| {
        let (color, map) = scene(size, from, frame, missing);
        (color, map, frame as u64 * FRAME_NS, 1.5)
    };
    (0..count).map(frame).collect()
}

fn refined(refiner: &mut Refiner, (color, map, time_ns, focus_m): &Frame) -> DepthMap {
    let mut map = map.clone();
    refiner.set_focus(*focus_m);
    refiner.refine(&mut map, color, *time_ns);
    map
}

fn assert_same(device: &Device, made: &DepthMap, expected: &DepthMap, name: &str) {
    assert_eq!(made.size(), expected.size(), "{name}");
    let known = |map: &DepthMap| map.metres.iter().map(|&metres| DepthMap::is_known(metres)).collect::<Vec<_>>();
    assert!(known(made) == known(expected), "{name}: the same is known");
    let is_software = device.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    for &(limit, one_in) in if is_software { &LIMITS[..] } else { &HARDWARE_LIMITS } {
        let is_same = |(a, b): &(&f32, &f32)| (*a - *b).abs() <= limit * *b;
        let off = made.metres.iter().zip(&expected.metres).filter(|both| !is_same(both)).count();
        let all = expected.metres.len();
        assert!(off * one_in <= all, "{name}: {off} of {all} are off by more than {limit} of themselves");
    }
}

/// Checks the law on all these frames, one after the other. Returns the maps of the last.
fn same(device: &Arc<Device>, name: &str, frames: &[Frame]) -> DepthMap {
    let (mut cpu, mut gpu) = (Refiner::new(), Refiner::new().with_device(Some(device)));
    let mut last = DepthMap::default();
    for (k, frame) in frames.iter().enumerate() {
        let expected = refined(&mut cpu, frame);
        last = refined(&mut gpu, frame);
        assert_same(device, &last, &expected, &format!("{name}, frame {k}"));
    }
    assert_eq!(gpu.backends(), "gpu", "{name}");
    last
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn maps_agree_whatever_their_size_and_the_pictures() {
    let device = device();
    for (size, from) in [
        ((160, 120), (160, 120)),
        ((161, 119), (161, 119)),
        ((200, 150), (77, 61)),
        ((90, 70), (181, 133)),
        ((333, 40), (333, 40)),
        ((40, 300), (20, 300)),
        ((1, 1), (1, 1)),
        ((3, 2), (3, 2)),
        ((7, 60), (7, 60)),
        ((60, 7), (9, 4)),
        ((17, 13), (1, 1)),
        ((1, 50), (1, 50)),
        ((50, 1), (50, 1)),
        ((300, 3), (300, 3)),
    ] {
        for missing in [0.0, 0.02, 0.5, 0.97] {
            same(&device, &format!("{size:?} from {from:?}, {missing}"), &scenes(size, from, 3, missing));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn sequences_agree_whatever_happens_in_them() {
    let device = device();
    let size = (160, 100);
    let frames = || scenes(size, (80, 50), 10, 0.05);
    let with = |change: &dyn Fn(usize, &mut Frame)| {
        let mut frames = frames();
        frames.iter_mut().enumerate().for_each(|(k, frame)| change(k, frame));
        frames
    };
    same(&device, "as they are", &frames());
    same(&device, "focus", &with(&|k, frame| frame.3 = [1.5, 1.5, 3.0, 0.7, 40.0][k % 5]));
    same(&device, "a gap", &with(&|k, frame| frame.2 += if k > 4 { 800_000_000 } else { 0 }));
    same(&device, "back in time", &with(&|k, frame| frame.2 = if k > 4 { frame.2 / 3 } else { frame.2 }));
    same(&device, "two at once", &with(&|k, frame| frame.2 = k as u64 / 2 * FRAME_NS));
    let unknown = |frame: &mut Frame| frame.1.metres.fill(0.0);
    let none = same(&device, "nothing is ever known", &with(&|_, frame| unknown(frame)));
    assert!(none.metres.iter().all(|&metres| metres == 0.0));
    let none = same(
        &device,
        "nothing is known at last",
        &with(&|k, frame| {
            if k > 3 {
                unknown(frame)
            }
        }),
    );
    assert!(none.metres.iter().all(|&metres| metres == 0.0));
    same(
        &device,
        "nothing is known at first, and in between",
        &with(&|k, frame| {
            if k % 4 == 0 {
                unknown(frame)
            }
        }),
    );
    same(
        &device,
        "an empty map",
        &with(&|k, frame| {
            if k % 3 == 1 {
                frame.1 = DepthMap::default()
            }
        }),
    );
    let other = |size, from| {
        move |k: usize, frame: &mut Frame| {
            if (3..6).contains(&k) {
                (frame.0, frame.1) = scene(size, from, k, 0.05);
            }
        }
    };
    same(&device, "maps of another size", &with(&other(size, size)));
    same(&device, "maps of many samples", &with(&other(size, (320, 241))));
    same(&device, "pictures of another size", &with(&other((70, 90), (80, 50))));
    same(
        &device,
        "one known sample",
        &with(&|k, frame| {
            if k > 5 {
                unknown(frame);
                frame.1.metres[1234] = 2.0;
            }
        }),
    );
    let still = frames().swap_remove(0);
    let still = (0..12).map(|k| (still.0.clone(), still.1.clone(), k * FRAME_NS, 1.5)).collect::<Vec<_>>();
    same(&device, "the same again and again", &still);
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_refiner_forgets_on_a_device_as_on_the_processor() {
    let device = device();
    let (mut cpu, mut gpu) = (Refiner::new(), Refiner::new().with_device(Some(&device)));
    for (k, frame) in scenes((90, 60), (90, 60), 6, 0.02).iter_mut().enumerate() {
        if k == 3 {
            cpu.reset();
            gpu.reset();
            frame.1.metres.fill(0.0);
        }
        let [expected, made] = [&mut cpu, &mut gpu].map(|refiner| refined(refiner, frame));
        assert_same(&device, &made, &expected, &format!("frame {k}"));
        assert_eq!(made.metres.iter().all(|&metres| metres == 0.0), k == 3);
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_device_that_is_gone_is_followed_by_the_processor() {
    for gone_before in [0, 1, 3] {
        let device = device();
        let mut refiner = Refiner::new().with_device(Some(&device));
        let mut cpu = Refiner::new();
        for (k, frame) in scenes((90, 60), (45, 30), 6, 0.02).iter().enumerate() {
            if k == gone_before {
                device.device.destroy();
                // The remembered frames are gone, too.
                cpu = Refiner::new();
            }
            let [expected, made] = [&mut cpu, &mut refiner].map(|refiner| refined(refiner, frame));
            assert_same(&device, &made, &expected, &format!("frame {k}, gone before {gone_before}"));
            assert!(k < gone_before || made.metres == expected.metres, "to the bit");
        }
        assert_eq!(refiner.backends(), "gpu, then cpu");
        assert_eq!(Refiner::new().with_device(Some(&device)).backends(), "cpu", "nobody tries that device again");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn the_bundled_recording_agrees() {
    let frame = |index: usize| {
        let (color, map, _) = portrait::frame(index);
        (color, map, index as u64 * FRAME_NS, 1.0)
    };
    same(&device(), "portrait", &(0..6).map(frame).collect::<Vec<_>>());
}

/// Prints the pass times, of frames of any size: `BOKEHCAM_SIZE=1280x720 cargo test --release --test depth -- --ignored
/// --nocapture refine_gpu::the_passes`.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn the_passes_of_a_frame_take_less_time_than_the_frame() {
    let (device, size) = (device(), size_of_timed());
    let mut gpu = GpuRefiner::new(&device);
    for (color, mut map, time_ns, focus_m) in scenes(size, size, 5, 0.05) {
        let began = Instant::now();
        gpu.refine(&mut map, &color, time_ns, focus_m).expect("the GPU refines");
        tell_of_passes(&device, began.elapsed(), &gpu.pass_times());
    }
}
