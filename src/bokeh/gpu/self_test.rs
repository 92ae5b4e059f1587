//! Self-test of a device: compares its blur with the CPU's.

use std::sync::Arc;

use super::GpuBokeh;
use crate::bokeh::aperture::Aperture;
use crate::bokeh::cpu::CpuBokeh;
use crate::bokeh::plan::Plan;
use crate::bokeh::{Bokeh, BokehError, Job, Method, Settings};
use crate::budget::Quality;
use crate::compute::GpuError;
use crate::compute::device::{Device, SelfTest};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::optics::{CocField, CocKind, DepthCoc};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;
const RADIUS_PX: f32 = 12.0;
/// Largest accepted difference of an 8-bit value.
const CODES: u8 = 4;

/// Blurs a small noise picture at three distances on `device` and on the CPU, once per device.
///
/// # Errors
/// The device failed, or its result differs from the CPU's.
pub fn run_self_test(device: &Arc<Device>) -> Result<(), BokehError> {
    match device.find_fault::<GpuBokeh, BokehError>(|| Ok(compare_with_cpu(device)?.fault(device)))? {
        Some(GpuError::Failed(fault)) => Err(GpuError::Failed(format!("{fault} (--backend cpu avoids it)")).into()),
        Some(fault) => Err(fault.into()),
        None => Ok(()),
    }
}

fn compare_with_cpu(device: &Arc<Device>) -> Result<SelfTest, BokehError> {
    let settings = Settings {
        coc: CocKind::Depth,
        method: Method::Layered,
        aperture: Aperture::default(),
        rim: 0.2,
        rank: None,
        highlights: 4.0,
        quality: Quality::default(),
        adaptive: false,
        reuse: false,
        privacy: false,
        far_max_px: RADIUS_PX,
        near_max_px: RADIUS_PX,
    };
    let coc =
        CocField::Depth(DepthCoc { coc_at_infinity_px: RADIUS_PX, focus_m: 1.0, range_m: 0.0, max_coc_px: RADIUS_PX });
    let mut color = ColorImage::new(WIDTH, HEIGHT);
    for (k, value) in (0u32..).zip(&mut color.rgb) {
        *value = (k.wrapping_mul(0x9e37_79b1) >> 24) as u8;
    }
    let metres = (0..WIDTH * HEIGHT).map(|k| [0.6, 1.0, 4.0][(k % WIDTH * 3 / WIDTH) as usize]).collect();
    let depth = DepthMap { width: WIDTH, height: HEIGHT, metres, ..DepthMap::default() };

    let plan = Plan::new(&settings, WIDTH, HEIGHT);
    let mut expected = ColorImage::default();
    CpuBokeh::new(plan.clone(), Some(1)).blur(&color, Some(&depth), &coc, &mut expected)?;
    let mut gpu = GpuBokeh::with_device(&plan, Arc::clone(device))?;
    gpu.submit(Job::new(Pooled::detached(color), Some(Pooled::detached(depth)), coc))?;
    let finished = gpu.collect(true)?.ok_or(BokehError::Lost)?;
    let made = finished.picture.memory().ok_or(BokehError::Lost)?;
    let wrong = made.rgb.iter().zip(&expected.rgb).filter(|(a, b)| a.abs_diff(**b) > CODES).count();
    Ok(SelfTest { wrong, all: expected.rgb.len(), one_in: 100, results: "pixel values" })
}
