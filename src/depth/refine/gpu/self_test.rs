//! Checks that a device refines like the CPU.

use std::sync::Arc;

use super::super::Refiner;
use super::GpuRefiner;
use crate::compute::GpuError;
use crate::compute::device::{Device, SelfTest};
use crate::frame::{ColorImage, DepthMap};

const SIZE: (u32, u32) = (96, 64);
const MAP_SIZE: (u32, u32) = (60, 40);
const FRAMES: u32 = 3;
const FRAME_NS: u64 = 33_000_000;
/// Largest relative error of a correct depth.
const MAX_ERROR: f32 = 1e-3;

/// Refines a few small frames on the device and on the CPU, and compares them.
///
/// # Errors
/// Fails if the device fails.
pub fn run_self_test(device: &Arc<Device>) -> Result<SelfTest, GpuError> {
    let (mut cpu, mut gpu) = (Refiner::new(), GpuRefiner::new(device));
    let mut wrong = 0;
    for frame in 0..FRAMES {
        let (color, map) = scene(frame);
        let (mut expected, mut made) = (map.clone(), map);
        let time_ns = u64::from(frame) * FRAME_NS;
        cpu.refine(&mut expected, &color, time_ns);
        gpu.refine(&mut made, &color, time_ns, 1.0)?;
        // NaN counts as wrong.
        let is_same = |(a, b): &(&f32, &f32)| (*a - *b).abs() <= MAX_ERROR * *b;
        wrong += expected.metres.len() - made.metres.iter().zip(&expected.metres).filter(is_same).count();
    }
    let all = (SIZE.0 * SIZE.1 * FRAMES) as usize;
    Ok(SelfTest { wrong, all, one_in: 100, results: "depth values" })
}

/// Returns a person before a wall, with noise and an occlusion shadow, whose outline in the map is misplaced.
fn scene(frame: u32) -> (ColorImage, DepthMap) {
    let chance = |k: usize| ((k as u32 ^ (frame << 20)).wrapping_mul(0x9e37_79b1) >> 24) as u8;
    let is_near = |x: u32, y: u32, (width, height): (u32, u32), wider: u32| {
        (width / 3 - wider..width * 2 / 3 + wider).contains(&(x + frame)) && y > height / 3
    };
    let mut color = ColorImage::new(SIZE.0, SIZE.1);
    for (k, pixel) in color.rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (k as u32 % SIZE.0, k as u32 / SIZE.0);
        let base = if is_near(x, y, SIZE, 0) { [50, 40, 30] } else { [180, 190, 200] };
        pixel.copy_from_slice(&base.map(|value: u8| value + chance(k) % 9));
    }
    let mut map = DepthMap::new(MAP_SIZE.0, MAP_SIZE.1);
    for (k, metres) in map.metres.iter_mut().enumerate() {
        let (x, y) = (k as u32 % MAP_SIZE.0, k as u32 / MAP_SIZE.0);
        let noise = 1.0 + f32::from(chance(k)) * 2e-5;
        let is_hole = (MAP_SIZE.0 / 3 - 3..MAP_SIZE.0 / 3).contains(&x) || chance(k) < 2;
        *metres = if is_hole { 0.0 } else { noise * if is_near(x, y, MAP_SIZE, 1) { 1.2 } else { 3.0 } };
    }
    (color, map)
}
