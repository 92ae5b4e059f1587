//! With privacy, detail behind the focal plane is gone before it is blurred.
#![allow(missing_docs)]

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::depth::matting::{self, Matting};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::{CocField, CocKind, DepthCoc};

use crate::common::{color, psnr_db, settings};
use crate::portrait;

/// Blurs a picture without privacy, and with it.
fn both(settings: &Settings, image: &ColorImage, map: Option<&DepthMap>, field: &CocField) -> [ColorImage; 2] {
    [false, true].map(|privacy| {
        let plan = Plan::new(&Settings { privacy, ..settings.clone() }, image.width, image.height);
        let mut out = ColorImage::default();
        CpuBokeh::new(plan, Some(2)).blur(image, map, field, &mut out).expect("a blur of fitting input");
        out
    })
}

/// Returns the amplitude, in linear light, of waves of `period_px` across a picture, away from its sides.
fn amplitude(image: &ColorImage, period_px: f64, margin: usize) -> f64 {
    use std::f64::consts::TAU;
    let width = image.width as usize;
    let (mut real, mut imaginary, mut weights) = (0.0, 0.0, 0.0);
    for (k, pixel) in
        image.rgb.chunks_exact(3).enumerate().filter(|(k, _)| (margin..width - margin).contains(&(k % width)))
    {
        let x = (k % width - margin) as f64 + 0.5;
        // A Hann window: other waves hardly count.
        let weight = 1.0 - (TAU * x / (width - 2 * margin) as f64).cos();
        let (sin, cos) = (TAU * x / period_px).sin_cos();
        let light = weight * f64::from(srgb_to_linear(f32::from(pixel[1]) / 255.0));
        (real, imaginary, weights) = (real + light * cos, imaginary + light * sin, weights + weight);
    }
    2.0 * f64::hypot(real, imaginary) / weights
}

#[test]
fn waves_as_fine_as_a_cell_are_gone() {
    for radius_px in [8.0, 11.0, 16.0, 24.0, 40.0_f32] {
        let settings = Settings { far_max_px: radius_px, ..settings(CocKind::Uniform) };
        let (mut kept, mut private) = (0.0, 0.0);
        // Some periods fall on zeros of the disc's transfer: the sum over all counts.
        for step in 0..12 {
            let period_px = (0.4 * f64::from(radius_px)).max(6.4) * (1.0 + 0.03 * f64::from(step));
            let wave = |x: u32| (std::f64::consts::TAU * f64::from(x) / period_px).sin() as f32;
            // Brighter from row to row, so that rounding to codes does not add up.
            let light = |x: u32, y: u32| 0.45 + 0.1 * y as f32 / 96.0 + 0.4 * wave(x);
            let image = color(480, 96, |x, y| [(255.0 * linear_to_srgb(light(x, y))).round() as u8; 3]);
            let [off, on] = both(&settings, &image, None, &CocField::Uniform { radius_px });
            kept += amplitude(&off, period_px, 96);
            private += amplitude(&on, period_px, 96);
        }
        assert!(kept > 0.02, "{radius_px} px: {kept}");
        assert!(private < 0.15 * kept, "{radius_px} px: {private} of {kept}");
    }
}

#[test]
fn a_portrait_looks_the_same() {
    let (image, mut map, _) = portrait::frame(0);
    let coc_at_infinity_px = 0.05 * image.height as f32;
    let settings =
        Settings { far_max_px: coc_at_infinity_px, near_max_px: coc_at_infinity_px, ..settings(CocKind::Depth) };
    let lens = DepthCoc { coc_at_infinity_px, focus_m: 1.0, range_m: 0.2, max_coc_px: 2.0 * coc_at_infinity_px };
    Matting::default().find_mixed_pixels(&mut map, &image, lens.inverse_depth_step(matting::MIN_STEP_PX));
    let [off, on] = both(&settings, &image, Some(&map), &CocField::Depth(lens));
    assert!(psnr_db(&off, &on) > 42.0, "{} dB", psnr_db(&off, &on));
    // Detail that is gone changes some pixels.
    assert_ne!(off.rgb, on.rgb);
}
