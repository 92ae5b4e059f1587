//! The GPU's passes that drop speckles and fill gaps agree with a plain per-pixel reference, on maps that are hard for
//! connected-component labelling.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;
use crate::on_gpu::device;

use bokehcam::compute::device::{Device, Readback, Recorder};
use bokehcam::depth::stereo::fixed::{FILLED, MAX_SPECKLE_STEP, UNKNOWN};
use bokehcam::depth::stereo::gpu::postprocess::{Scratch, create_passes};
use bokehcam::depth::stereo::gpu::shaders;
use common::Numbers;

/// Runs the GPU's passes on a map.
fn tidied(device: &Device, size: (usize, usize), max_speckle: u32, map: &[u16]) -> Vec<u16> {
    use wgpu::BufferUsages as Usage;
    let buffer = |bytes, usage| device.create_buffer("test", bytes, usage);
    let pixels = map.len();
    let words: Vec<u32> = map.iter().map(|&disparity| disparity.into()).collect();
    let on_device = buffer(pixels * 4, Usage::STORAGE | Usage::COPY_DST);
    device.queue.write_buffer(&on_device, 0, bytemuck::cast_slice(&words));
    // The executor's buffers hold leftover values.
    let used = [1, 2, 3].map(|number: u32| {
        let used = buffer(pixels * 4, Usage::STORAGE | Usage::COPY_DST);
        device.queue.write_buffer(&used, 0, bytemuck::cast_slice(&vec![number * 0x0123_4567; pixels]));
        used
    });
    let scratch = Scratch { labels: &used[0], sizes: &used[1], filled: &used[2] };
    let out = buffer(pixels * 2, Usage::STORAGE | Usage::COPY_SRC);
    let mut back = Readback::new(device, "words back", pixels * 2);
    let constants = shaders::matcher_constants(size, 16, max_speckle, false);
    let mut recorder = Recorder::new(device, None);
    create_passes(device, size, &constants, &on_device, scratch, &out).iter().for_each(|pass| recorder.record(pass));
    let take = |bytes: &[u8]| bytes.as_chunks().0[..pixels].iter().map(|bytes| u16::from_le_bytes(*bytes)).collect();
    recorder.submit_and_read(device, &mut back, &out, out.size(), take).expect("the device is there")
}

/// The reference: the same result, pixel by pixel.
fn expected((width, height): (usize, usize), max_speckle: u32, map: &[u16]) -> Vec<u16> {
    let mut out = map.to_vec();
    let mut seen = vec![false; map.len()];
    for from in 0..map.len() {
        if map[from] == UNKNOWN || std::mem::replace(&mut seen[from], true) {
            continue;
        }
        let (mut found, mut at) = (vec![from], 0);
        while let Some(&here) = found.get(at) {
            at += 1;
            let (x, y) = (here % width, here / width);
            let beside = [(x > 0).then(|| here - 1), (x + 1 < width).then_some(here + 1)];
            let others = [(y > 0).then(|| here - width), (y + 1 < height).then_some(here + width)];
            for next in beside.into_iter().chain(others).flatten() {
                let touches = map[next] != UNKNOWN && map[next].abs_diff(map[here]) <= MAX_SPECKLE_STEP;
                if touches && !std::mem::replace(&mut seen[next], true) {
                    found.push(next);
                }
            }
        }
        if found.len() <= max_speckle as usize {
            found.into_iter().for_each(|pixel| out[pixel] = UNKNOWN);
        }
    }
    for row in out.chunks_exact_mut(width) {
        let known = row.to_vec();
        for x in (0..width).filter(|&x| known[x] == UNKNOWN) {
            let left = known[..x].iter().rfind(|&&d| d != UNKNOWN);
            let right = known[x..].iter().find(|&&d| d != UNKNOWN);
            row[x] = left.map_or(UNKNOWN, |&left| left.min(*right.unwrap_or(&left)) | FILLED);
        }
    }
    out
}

type Place = (usize, usize);

const LOW: u16 = 500;
const HIGH: u16 = 9000;

/// Draws a spiral one pixel wide, with one-pixel gaps between its arms, from the first pixel inwards.
fn spiral((width, height): Place) -> Vec<u16> {
    let mut map = vec![UNKNOWN; width * height];
    let inside = |x: isize, y: isize| (0..width as isize).contains(&x) && (0..height as isize).contains(&y);
    let place = |x: isize, y: isize| y as usize * width + x as usize;
    let (mut x, mut y, mut ahead) = (0, 0, (1, 0));
    map[0] = LOW;
    loop {
        // Neither the next pixel nor the one after it is set.
        let is_free = |map: &[u16], (dx, dy): (isize, isize)| {
            let is_empty = |x: isize, y: isize| map[place(x, y)] == UNKNOWN;
            let (next, after) = ((x + dx, y + dy), (x + 2 * dx, y + 2 * dy));
            inside(next.0, next.1)
                && is_empty(next.0, next.1)
                && (!inside(after.0, after.1) || is_empty(after.0, after.1))
        };
        if !is_free(&map, ahead) {
            ahead = (-ahead.1, ahead.0);
            if !is_free(&map, ahead) {
                return map;
            }
        }
        (x, y) = (x + ahead.0, y + ahead.1);
        map[place(x, y)] = LOW;
    }
}

/// A disparity for every pixel, given its place and the size of the picture.
type Made = fn(Place, Place) -> u16;

const MADE: [(&str, Made); 15] = [
    ("nothing", |_, _| UNKNOWN),
    ("one island", |_, _| LOW),
    ("a slope that hangs together", |(x, y), _| ((x + y) as u16 * MAX_SPECKLE_STEP) % 16_000),
    ("a slope that does not", |(x, y), _| ((x + y) as u16 * (MAX_SPECKLE_STEP + 1)) % 16_000),
    ("a checkerboard", |(x, y), _| [LOW, HIGH][(x + y) % 2]),
    ("a checkerboard with holes", |(x, y), _| [LOW, UNKNOWN][(x + y) % 2]),
    ("a checkerboard of one island", |(x, y), _| LOW + (x + y) as u16 % 2 * MAX_SPECKLE_STEP),
    ("a comb that is joined above", |(x, y), _| if x % 2 == 0 || y == 0 { LOW } else { UNKNOWN }),
    ("a comb that is joined below", |(x, y), (_, height)| if x % 2 == 0 || y + 1 == height { LOW } else { HIGH }),
    ("a comb that lies", |(x, y), (width, _)| if y % 2 == 0 || x + 1 == width { LOW } else { UNKNOWN }),
    ("a snake that lies", |(x, y), (width, _)| {
        let turn = if y % 4 == 1 { x + 1 == width } else { y % 4 == 3 && x == 0 };
        if y % 2 == 0 || turn { LOW } else { HIGH }
    }),
    ("a snake that stands", |(x, y), (_, height)| {
        let turn = if x % 4 == 1 { y + 1 == height } else { x % 4 == 3 && y == 0 };
        if x % 2 == 0 || turn { LOW } else { UNKNOWN }
    }),
    ("stairs", |(x, y), _| if (x + y) % 5 < 2 { LOW } else { HIGH }),
    ("stairs to the left", |(x, y), (width, _)| if (width - x + y) % 7 < 2 { LOW } else { UNKNOWN }),
    // Horizontal bars of 1 to 32 pixels, and in other rows vertical ones.
    ("islands of many sizes", |(x, y), _| {
        let (column, row) = (x % 34, y % 34);
        let lies = y / 34 % 2 == 0 && row % 2 == 0 && column <= row;
        let stands = y / 34 % 2 == 1 && column % 2 == 0 && row <= column;
        if lies || stands { LOW } else { UNKNOWN }
    }),
];

fn assert_tidied(device: &Device, size: Place, max_speckle: u32, map: &[u16], what: &str) {
    let (expected, found) = (expected(size, max_speckle, map), tidied(device, size, max_speckle, map));
    let off = (0..map.len()).filter(|&k| expected[k] != found[k]).collect::<Vec<_>>();
    let Some(&first) = off.first() else { return };
    let (x, y) = (first % size.0, first / size.0);
    let [expected, found] = [expected[first], found[first]];
    panic!("{what}, {size:?}, {max_speckle}: {} differ, at first {x},{y}: {expected} and {found}", off.len());
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn islands_of_any_shape_are_found() {
    let device = device();
    for size in [(1, 1), (1, 70), (70, 1), (2, 5), (3, 3), (37, 41), (64, 64), (127, 9), (129, 140), (300, 69)] {
        let made = MADE
            .map(|(what, made)| (what, (0..size.0 * size.1).map(|k| made((k % size.0, k / size.0), size)).collect()));
        let two = spiral(size).iter().map(|&d| d.min(HIGH)).collect();
        for (what, map) in made.into_iter().chain([("a spiral", spiral(size)), ("two spirals", two)]) {
            for max_speckle in [0, 1, 16, 25, 10_000, u32::MAX] {
                assert_tidied(&device, size, max_speckle, &map, what);
            }
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn islands_of_chance_are_found_every_time() {
    let device = device();
    let mut numbers = Numbers(3);
    for size in [(1, 200), (200, 1), (53, 61), (128, 90), (511, 200)] {
        // About the percolation threshold, where speckles begin to span the picture, and at few and many known pixels.
        for known in [0.1, 0.5, 0.593, 0.65, 0.9] {
            // Only equal disparities connect, or some of their neighbours, too.
            for (levels, apart) in [(1.0, 170), (2.0, 170), (90.0, 170), (6.0, 60), (100.0, 20)] {
                let mut one =
                    || if numbers.next() < known { (numbers.next() * levels) as u16 * apart } else { UNKNOWN };
                let map: Vec<u16> = (0..size.0 * size.1).map(|_| one()).collect();
                let what = format!("{known} known, {levels} levels {apart} apart");
                for max_speckle in [1, 6, 100] {
                    for _ in 0..2 {
                        assert_tidied(&device, size, max_speckle, &map, &what);
                    }
                }
            }
        }
    }
}
