//! The GPU finds the disparities that the CPU finds, to the bit.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

mod common;

use std::sync::Arc;

use bokehcam::compute::device::Device;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::compute::{Backend, GpuError};
use bokehcam::depth::stereo::cpu::CpuExecutor;
use bokehcam::depth::stereo::executor::Executor;
use bokehcam::depth::stereo::fixed::UNKNOWN;
use bokehcam::depth::stereo::gpu::GpuExecutor;
use bokehcam::depth::stereo::{self, Effort, Pair, Settings};
use bokehcam::frame::{DisparityMap, GrayImage};
use common::Numbers;

fn device() -> Arc<Device> {
    Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"))
}

fn picture(width: usize, height: usize, mut luma: impl FnMut(usize, usize) -> u8) -> Vec<u8> {
    (0..width * height).map(|k| luma(k % width, k / width)).collect()
}

/// A texture of chance, smooth in places and with edges, as two eyes see it: stripes of rows at different disparities,
/// up to `most`, with a little noise of each eye's own.
fn pair(width: usize, height: usize, most: usize) -> [Vec<u8>; 2] {
    let mut numbers = Numbers(11);
    let mut level = 0.5;
    let texture = picture(width + most, height, |x, _| {
        level = if x % 23 == 0 { numbers.next() } else { 0.8 * level + 0.2 * numbers.next() };
        (255.0 * level) as u8
    });
    let noise = (0..2).map(|eye| {
        let mut own = Numbers(eye + 2);
        picture(width, height, |x, y| {
            let shift = if eye == 0 { 0 } else { (y / 5 * 7 + x / (width / 3 + 1) * 3) % (most + 1) };
            texture[y * (width + most) + x + shift].saturating_add((own.next() * 4.0) as u8)
        })
    });
    noise.collect::<Vec<_>>().try_into().expect("two eyes")
}

/// Both executors' winners of the pairs, one after the other, are the same; returns those of the last.
fn same(device: &Arc<Device>, size: (usize, usize), disparities: usize, pairs: &[[Vec<u8>; 2]]) -> Vec<u16> {
    let mut workers = ThreadPool::new("test", 2);
    let mut cpu = CpuExecutor::new(size, disparities, 2);
    let mut gpu = GpuExecutor::new(device, size, disparities).expect("room for a small picture");
    let mut found = [vec![1; size.0 * size.1], vec![2; size.0 * size.1]];
    let mut numbers = Numbers(5);
    let most = disparities.next_multiple_of(16) as f32;
    // Nothing likely, anything the range has and 0, and nothing again.
    let likely: Vec<u16> = (0..size.0 * size.1).map(|_| (numbers.next() * (most + 1.0)) as u16).collect();
    let rounds = pairs.iter().flat_map(|pair| [(pair, None), (pair, Some(&*likely)), (pair, None)]);
    for (number, ([left, right], likely)) in rounds.enumerate() {
        cpu.winners([left, right], likely, &mut workers, &mut found[0]).expect("the CPU matches");
        gpu.winners([left, right], likely, &mut workers, &mut found[1]).expect("the GPU matches");
        let off = (0..found[0].len()).filter(|&k| found[0][k] != found[1][k]).collect::<Vec<_>>();
        if let Some(&first) = off.first() {
            let (x, y) = (first % size.0, first / size.0);
            let [cpu, gpu] = [found[0][first], found[1][first]];
            panic!(
                "{size:?}, {disparities} disparities, round {number}: {} differ, at first {x},{y}: {cpu} and {gpu}",
                off.len()
            );
        }
    }
    found[0].clone()
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn winners_agree_whatever_the_size_and_range() {
    let device = device();
    for (width, height) in [(17, 13), (1, 1), (1, 9), (2, 3), (4096, 2), (33, 200), (150, 41)] {
        for disparities in [1, 16, 64, 90, 128, 256] {
            let pairs = [pair(width, height, (disparities - 1).min(60)), pair(width, height, 3)];
            same(&device, (width, height), disparities, &pairs);
        }
    }
    let found = same(&device, (150, 41), 64, &[pair(150, 41, 20)]);
    let known = found.iter().filter(|&&winner| winner != UNKNOWN).count();
    assert!(known > found.len() / 2, "{known} of {} are known", found.len());
    assert!(found.iter().any(|&winner| winner != UNKNOWN && winner % 64 != 0), "some are between whole pixels");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn winners_agree_on_extreme_pictures() {
    let device = device();
    let (width, height) = (61, 37);
    let mut numbers = Numbers(5);
    let mut chance = || picture(width, height, |_, _| (numbers.next() * 256.0) as u8);
    let pairs = [
        [vec![0; width * height], vec![0; width * height]],
        [vec![255; width * height], vec![9; width * height]],
        [chance(), chance()],
        [chance(), vec![128; width * height]],
        [picture(width, height, |x, _| x as u8 * 4), picture(width, height, |x, _| x as u8 * 4 + 3)],
        [
            picture(width, height, |x, y| (x % 3 * y % 2 * 255) as u8),
            picture(width, height, |x, _| (x % 3 * 100) as u8),
        ],
    ];
    for disparities in [16, 32, 96] {
        same(&device, (width, height), disparities, &pairs);
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn maps_agree_at_every_effort() {
    for (width, height) in [(17, 13), (1, 1), (33, 200), (150, 41)] {
        for disparities in [16, 64, 128] {
            let size = (width as u32, height as u32);
            let settings = Settings { size, disparities, effort: Effort::Fast, threads: 2 };
            let [left, right] = pair(width, height, 20).map(|luma| {
                let mut image = GrayImage::default();
                (image.width, image.height, image.luma) = (size.0, size.1, luma);
                image
            });
            let mut maps = [DisparityMap::default(), DisparityMap::default()];
            let mut matchers = [Backend::Cpu, Backend::Gpu]
                .map(|backend| stereo::create(&settings, backend, None).expect("a matcher on any adapter"));
            for effort in [Effort::Fast, Effort::Full, Effort::Fast] {
                for (matcher, map) in matchers.iter_mut().zip(&mut maps) {
                    matcher.set_effort(effort);
                    matcher.disparity(Pair { left: &left, color: None, right: &right }, map).expect("a map");
                }
                assert!(maps[0].px == maps[1].px, "{width}x{height}, {disparities} disparities, {effort:?}");
            }
            assert_ne!(matchers[0].describe(), matchers[1].describe());
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_the_device_cannot_hold_is_an_error() {
    let Err(error) = GpuExecutor::new(&device(), (60_000, 60_000), 256) else { panic!("no device holds so much") };
    assert!(matches!(error, GpuError::Failed(_)));
    assert!(error.to_string().contains("60000 x 60000"), "{error}");
}

/// Prints the times, of a pair of any size: `BOKEHCAM_PAIR=1280x720x128 cargo test --release --test stereo_gpu --
/// --ignored --nocapture the_passes`.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn the_passes_of_a_pair_take_less_time_than_the_pair() {
    let wanted = std::env::var("BOKEHCAM_PAIR").unwrap_or_else(|_| "160x120x32".to_owned());
    let wanted: Vec<usize> =
        wanted.split('x').map(|number| number.parse().expect("COLUMNSxROWSxDISPARITIES")).collect();
    let (width, height, disparities) = (wanted[0], wanted[1], wanted[2]);
    let [left, right] = pair(width, height, disparities / 2);
    let mut workers = ThreadPool::new("test", 1);
    let mut gpu = GpuExecutor::new(&device(), (width, height), disparities).expect("room for the picture");
    let mut out = vec![0; width * height];
    for _ in 0..5 {
        let started = std::time::Instant::now();
        gpu.winners([&left, &right], None, &mut workers, &mut out).expect("the GPU matches");
        let (whole, passes) = (started.elapsed(), gpu.pass_times().collect::<Vec<_>>());
        eprintln!("{}: {whole:?} {passes:?}", gpu.describe());
        assert!(passes.iter().map(|(_, time)| *time).sum::<std::time::Duration>() <= whole);
    }
}
