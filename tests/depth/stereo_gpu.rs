//! The GPU finds the same disparities as the CPU, to the bit.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;
use crate::on_gpu::device;

use std::sync::Arc;

use bokehcam::compute::device::Device;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::compute::{Backend, GpuError};
use bokehcam::depth::stereo::cpu::CpuExecutor;
use bokehcam::depth::stereo::executor::Executor;
use bokehcam::depth::stereo::fixed::{ONE, UNKNOWN, is_known};
use bokehcam::depth::stereo::gpu::GpuExecutor;
use bokehcam::depth::stereo::{self, Effort, Pair, Settings};
use bokehcam::frame::{DisparityMap, GrayImage};
use common::Numbers;

fn picture(width: usize, height: usize, mut luma: impl FnMut(usize, usize) -> u8) -> Vec<u8> {
    (0..width * height).map(|k| luma(k % width, k / width)).collect()
}

/// Creates a pair of a random texture, smooth in places and with edges: stripes of rows at different disparities, up to
/// `most`, with a little independent noise in each picture.
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

/// Checks that both executors find the same disparities in the pairs, one after the other, with speckles of up to
/// `max_speckle` pixels dropped; returns the last disparities.
fn same(
    device: &Arc<Device>,
    size: (usize, usize),
    disparities: usize,
    max_speckle: u32,
    pairs: &[[Vec<u8>; 2]],
) -> Vec<u16> {
    let mut workers = ThreadPool::new("test", 2);
    let mut cpu = CpuExecutor::new(size, disparities, max_speckle, 2);
    let mut gpu = GpuExecutor::new(device, size, disparities, max_speckle).expect("room for a small picture");
    let mut found = [vec![1; size.0 * size.1], vec![2; size.0 * size.1]];
    // The priors: none, the disparities of the same pair, and those of another right picture, which can be any in the
    // range.
    let other = &pairs[pairs.len() - 1][1];
    let rounds = pairs.iter().flat_map(|[left, right]| [[left, right], [left, right], [left, other], [left, right]]);
    for (number, [left, right]) in rounds.enumerate() {
        cpu.compute_disparities([left, right], &mut workers, &mut found[0]).expect("the CPU matches");
        gpu.compute_disparities([left, right], &mut workers, &mut found[1]).expect("the GPU matches");
        assert_same(&found[0], &found[1], size, &format!("{disparities} disparities, {max_speckle}, round {number}"));
    }
    found[0].clone()
}

fn assert_same(expected: &[u16], found: &[u16], size: (usize, usize), what: &str) {
    let off = (0..expected.len()).filter(|&k| expected[k] != found[k]).collect::<Vec<_>>();
    if let Some(&first) = off.first() {
        let (x, y) = (first % size.0, first / size.0);
        let [expected, found] = [expected[first], found[first]];
        panic!("{what}, {size:?}: {} differ, at first {x},{y}: {expected} and {found}", off.len());
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn disparities_agree_whatever_the_size_and_range() {
    let device = device();
    for (width, height) in [(17, 13), (1, 1), (1, 9), (2, 3), (4096, 2), (33, 200), (150, 41)] {
        for disparities in [1, 16, 64, 90, 128, 256] {
            let pairs = [pair(width, height, (disparities - 1).min(60)), pair(width, height, 3)];
            for max_speckle in [0, 12] {
                same(&device, (width, height), disparities, max_speckle, &pairs);
            }
        }
    }
    let found = same(&device, (150, 41), 64, 12, &[pair(150, 41, 20)]);
    let known = found.iter().filter(|&&disparity| is_known(disparity)).count();
    assert!(known > found.len() / 2, "{known} of {} are known", found.len());
    assert!(
        found.iter().any(|&disparity| is_known(disparity) && disparity % ONE != 0),
        "some are between whole pixels"
    );
    assert!(found.iter().any(|&disparity| !is_known(disparity) && disparity != UNKNOWN), "some are filled");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn disparities_agree_on_extreme_pictures() {
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
        for max_speckle in [0, 3] {
            same(&device, (width, height), disparities, max_speckle, &pairs);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn maps_agree_at_every_effort() {
    for (width, height) in [(17, 13), (1, 1), (33, 200), (150, 41)] {
        for disparities in [16, 64, 128] {
            let size = (width as u32, height as u32);
            let settings = Settings { size, disparities, effort: Effort::Fast, threads: 2 };
            let image = |luma| GrayImage { width: size.0, height: size.1, luma };
            let pairs = [20, 20, 3].map(|most| pair(width, height, most).map(image));
            let color = common::noise(size.0, size.1);
            let mut maps = [DisparityMap::default(), DisparityMap::default()];
            let mut matchers = [Backend::Cpu, Backend::Gpu]
                .map(|backend| stereo::create(&settings, backend, None).expect("a matcher on any adapter"));
            for effort in [Effort::Fast, Effort::Full, Effort::Fast] {
                for (number, [left, right]) in pairs.iter().enumerate() {
                    let color = (number > 0).then_some(&color);
                    for (matcher, map) in matchers.iter_mut().zip(&mut maps) {
                        matcher.set_effort(effort);
                        matcher.compute_disparity(Pair { left, color, right }, map).expect("a map");
                    }
                    let same = maps[0].px == maps[1].px;
                    assert!(same, "{width}x{height}, {disparities} disparities, {effort:?}, pair {number}");
                }
            }
            assert_ne!(matchers[0].describe(), matchers[1].describe());
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_the_device_cannot_hold_is_an_error() {
    let Err(error) = GpuExecutor::new(&device(), (60_000, 60_000), 256, 0) else { panic!("no device holds so much") };
    assert!(matches!(error, GpuError::Failed(_)));
    assert!(error.to_string().contains("60000 x 60000"), "{error}");
}

/// Prints the pass times, of a pair of any size: `BOKEHCAM_PAIR=1280x720x128 cargo test --release --test stereo_gpu --
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
    let mut gpu = GpuExecutor::new(&device(), (width, height), disparities, 100).expect("room for the picture");
    let mut out = vec![0; width * height];
    for _ in 0..5 {
        let started = std::time::Instant::now();
        gpu.compute_disparities([&left, &right], &mut workers, &mut out).expect("the GPU matches");
        let (whole, passes) = (started.elapsed(), gpu.pass_times().iter().collect::<Vec<_>>());
        eprintln!("{}: {whole:?} {passes:?}", gpu.describe());
        assert!(passes.iter().map(|(_, time)| *time).sum::<std::time::Duration>() <= whole);
    }
}
