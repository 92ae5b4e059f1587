//! Self-test of a device: whether it finds the same mattes as the CPU.

use std::sync::Arc;

use super::super::Matting;
use super::GpuMatting;
use crate::compute::GpuError;
use crate::compute::device::{Device, SelfTest};
use crate::compute::thread_pool::ThreadPool;
use crate::depth::matting::{KnownBackground, Revision};
use crate::frame::{ColorImage, DepthMap, MixedPixel};

const SIZE: (u32, u32) = (96, 64);
const STEP: f32 = 0.05;
/// Tolerance of alpha; a mixed pixel on one side only is wrong, too.
const TOLERANCE: f32 = 0.01;

/// Finds the mattes of a small picture on the device and on the CPU, without and with a background, and compares them.
///
/// # Errors
/// The device failed.
pub fn run_self_test(device: &Arc<Device>) -> Result<SelfTest, GpuError> {
    let (mut cpu, mut gpu) = (Matting::default(), GpuMatting::new(device));
    let mut workers = ThreadPool::new("matte", 1);
    let (color, map) = scene();
    let pixels = map.metres.len();
    let light: Box<[[f32; 256]; 3]> = Box::new([[0.5; 256]; 3]);
    let (rgb, inverse, rounds) = (vec![0; 3 * pixels], vec![0.25; pixels], vec![1; pixels]);
    let background = KnownBackground {
        rgb: &rgb,
        inverse: &inverse,
        rounds: &rounds,
        min_rounds: 1,
        light: &light,
        surface_step: STEP,
        revision: Revision::default(),
    };
    let (mut wrong, mut all) = (0, 0);
    for background in [None, Some(&background)] {
        let [mut expected, mut made] = [map.clone(), map.clone()];
        cpu.find_with_background(&mut workers, (&mut expected, &color), STEP, background);
        gpu.find_mixed_pixels((&mut made, &color), None, STEP, background)?;
        let (expected, made) = (&expected.matte.pixels, &made.matte.pixels);
        let is_same = |a: &MixedPixel, b: &MixedPixel| (a.alpha - b.alpha).abs() <= TOLERANCE;
        let same = expected.iter().filter(|pixel| {
            made.binary_search_by_key(&pixel.at, |made| made.at).is_ok_and(|k| is_same(&made[k], pixel))
        });
        // In order, without duplicates.
        let is_sorted = made.is_sorted_by(|a, b| a.at < b.at);
        wrong += if is_sorted { expected.len().max(made.len()) - same.count() } else { expected.len() + 1 };
        all += expected.len();
    }
    Ok(SelfTest { wrong, all, one_in: 50, results: "mixed pixels" })
}

/// A person with a soft outline before a wall; the map has part of the hair.
fn scene() -> (ColorImage, DepthMap) {
    let chance = |k: usize| ((k as u32).wrapping_mul(0x9e37_79b1) >> 24) as u8;
    let (mut color, mut map) = (ColorImage::new(SIZE.0, SIZE.1), DepthMap::new(SIZE.0, SIZE.1));
    for (k, (pixel, metres)) in color.rgb.chunks_exact_mut(3).zip(&mut map.metres).enumerate() {
        let (x, y) = ((k as u32 % SIZE.0) as f32, (k as u32 / SIZE.0) as f32);
        let off = (x - 40.0).hypot(y - 40.0) - 20.3;
        let hair = if (y as u32).is_multiple_of(9) && x > 55.0 && x < 80.0 { 0.4 } else { 0.0 };
        let alpha = (0.5 - off).clamp(hair, 1.0);
        let code = |p: usize| alpha * [60.0, 50.0, 40.0][p] + (1.0 - alpha) * [180.0, 190.0, 200.0][p];
        pixel.copy_from_slice(&[0, 1, 2].map(|p| code(p) as u8 + chance(k + 7 * p) % 9));
        *metres = if off < 0.0 || (hair > 0.0 && (x as u32).is_multiple_of(7)) { 1.0 } else { 3.0 + 0.01 * x };
    }
    (color, map)
}
