//! Pictures in memory of the caller: the blur equals that of the executor's own pictures.
#![allow(missing_docs)]

use crate::common;

use std::ops::ControlFlow;

use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::slices::{Pixels, Radii, Sample, SliceBlur};
use bokehcam::bokeh::{BokehError, Method, Rank, Settings};
use bokehcam::color::{encode_srgb, srgb_to_linear};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::{CocField, CocKind};
use common::{COC_KINDS, DOF, coc, noise, settings, three_depths};

const SIZE: (u32, u32) = (300, 170);

fn blurred<T: Sample + Default>(blur: &mut SliceBlur, pixels: &[T], coc: Radii<'_>) -> Vec<T> {
    let mut out = vec![T::default(); pixels.len()];
    let flow = blur.blur(pixels, coc, &mut out, || ControlFlow::Continue(())).unwrap();
    assert!(flow.is_continue());
    out
}

fn light_of(image: &ColorImage) -> Vec<f32> {
    image.rgb.iter().map(|&code| srgb_to_linear(f32::from(code) / 255.0)).collect()
}

fn radii_of(map: &DepthMap) -> Vec<f32> {
    let CocField::Depth(lens) = DOF else { unreachable!() };
    map.metres.iter().map(|&metres| lens.coc_px(metres)).collect()
}

fn methods() -> [Settings; 3] {
    let layered = settings(CocKind::Depth);
    let gather = Settings { method: Method::Gather, ..layered.clone() };
    let exact = Settings { rank: Some(Rank::Full), ..gather.clone() };
    [layered, gather, exact]
}

#[test]
fn codes_are_blurred_as_the_executor_blurs_them() {
    let (image, map) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    for kind in COC_KINDS {
        let (settings, field) = (settings(kind), coc(kind, SIZE.1));
        let mut expected = ColorImage::default();
        let mut cpu = CpuBokeh::new(Plan::new(&settings, SIZE.0, SIZE.1), Some(2));
        cpu.blur(&image, Some(&map), &field, &mut expected).unwrap();
        let mut slices = SliceBlur::new(&settings, SIZE, Some(2)).unwrap();
        assert_eq!(blurred(&mut slices, &image.rgb, Radii::Field(&field, Some(&map))), expected.rgb);
    }
}

#[test]
fn given_radii_are_those_of_a_rule_over_depth() {
    let (image, map) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    let radii = radii_of(&map);
    for settings in methods() {
        let mut slices = SliceBlur::new(&settings, SIZE, Some(2)).unwrap();
        let by_rule = blurred(&mut slices, &image.rgb, Radii::Field(&DOF, Some(&map)));
        assert_eq!(blurred(&mut slices, &image.rgb, Radii::Each(&radii)), by_rule);
        assert_ne!(by_rule, image.rgb);
    }
}

#[test]
fn one_radius_given_for_each_pixel_is_that_radius() {
    let (image, radii) = (noise(SIZE.0, SIZE.1), vec![12.0; (SIZE.0 * SIZE.1) as usize]);
    let mut slices = SliceBlur::new(&settings(CocKind::Uniform), SIZE, Some(2)).unwrap();
    let field = coc(CocKind::Uniform, SIZE.1);
    let by_rule = blurred(&mut slices, &image.rgb, Radii::Field(&field, None));
    assert_eq!(blurred(&mut slices, &image.rgb, Radii::Each(&radii)), by_rule);
    assert_ne!(by_rule, image.rgb);
}

/// Both differ by the sRGB curve, whose polynomial for codes is off by 0.004 of a code, and by what is interpolated between
/// pixels of a bin: codes or light.
#[test]
fn linear_light_is_blurred_as_its_codes_are() {
    let (image, map) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    let light = light_of(&image);
    for settings in methods().into_iter().chain([settings(CocKind::Uniform), settings(CocKind::Ramp)]) {
        // Only bounded light is summed in integers.
        let settings = Settings { rank: Some(settings.rank.unwrap_or(Rank::Terms(4))), ..settings };
        let field = coc(settings.coc, SIZE.1);
        let mut slices = SliceBlur::new(&settings, SIZE, Some(2)).unwrap();
        let codes = blurred(&mut slices, &image.rgb, Radii::Field(&field, Some(&map)));
        let linear = blurred(&mut slices, &light, Radii::Field(&field, Some(&map)));
        let apart = codes.iter().zip(&linear).map(|(&code, &light)| code.abs_diff(encode_srgb(light)));
        let apart: Vec<u8> = apart.collect();
        let beyond = apart.iter().filter(|&&apart| apart > 1).count();
        assert!(apart.iter().all(|&apart| apart <= 2) && beyond <= apart.len() / 5000, "{:?}", settings.method);
    }
}

#[test]
fn linear_light_has_no_white_and_no_highlights_to_recover() {
    let map = three_depths(SIZE.0, SIZE.1);
    let constant = vec![40.0f32; map.metres.len() * 3];
    let settings = Settings { highlights: 12.0, ..settings(CocKind::Depth) };
    let mut slices = SliceBlur::new(&settings, SIZE, Some(1)).unwrap();
    let out = blurred(&mut slices, &constant, Radii::Field(&DOF, Some(&map)));
    assert!(out.iter().all(|light| (light / 40.0 - 1.0).abs() < 1e-4));
    let odd = [f32::NAN, f32::INFINITY, -1.0, 1e30];
    let odd: Vec<f32> = constant.iter().enumerate().map(|(k, _)| odd[k % 4]).collect();
    let mut lone = vec![0.5; constant.len()];
    lone[constant.len() / 2] = 1e30;
    let flat = vec![6.0; map.metres.len()];
    for light in [odd, lone] {
        let out = blurred(&mut slices, &light, Radii::Each(&flat));
        assert!(out.iter().all(|light| (0.0..=Pixels::MAX_LIGHT).contains(light)));
    }
}

/// Regions that were near in one picture are far in the next, and the reverse.
#[test]
fn a_picture_is_the_same_whatever_came_before() {
    let image = noise(SIZE.0, SIZE.1);
    let rising: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|at| 9.0 * at as f32 / (SIZE.0 * SIZE.1) as f32 - 3.0).collect();
    let falling: Vec<f32> = rising.iter().rev().copied().collect();
    let turned: Vec<f32> = rising.iter().map(|radius_px| -radius_px).collect();
    let maps = [rising, falling, turned];
    let settings = settings(CocKind::Depth);
    for (before, radii) in (0..9).map(|k| (&maps[k / 3], &maps[k % 3])) {
        let fresh = blurred(&mut SliceBlur::new(&settings, SIZE, Some(2)).unwrap(), &image.rgb, Radii::Each(radii));
        let mut used = SliceBlur::new(&settings, SIZE, Some(2)).unwrap();
        blurred(&mut used, &image.rgb, Radii::Each(before));
        assert!(blurred(&mut used, &image.rgb, Radii::Each(radii)) == fresh);
    }
}

#[test]
fn what_is_stopped_leaves_nothing_behind() {
    let (image, map) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    let other = noise(SIZE.0, SIZE.1).rgb.into_iter().rev().collect::<Vec<u8>>();
    for settings in methods() {
        let mut slices = SliceBlur::new(&settings, SIZE, Some(2)).unwrap();
        let expected = blurred(&mut slices, &image.rgb, Radii::Field(&DOF, Some(&map)));
        let mut passes = 0;
        let mut count = || -> ControlFlow<()> {
            passes += 1;
            ControlFlow::Continue(())
        };
        let whole =
            slices.blur(&image.rgb, Radii::Field(&DOF, Some(&map)), &mut vec![0; other.len()], &mut count).unwrap();
        assert!(whole.is_continue() && passes >= 3, "{passes}");
        for stop in 0..passes {
            let mut left = stop;
            let go_on = || match left {
                0 => ControlFlow::Break(()),
                _ => {
                    left -= 1;
                    ControlFlow::Continue(())
                }
            };
            let flow = slices.blur(&other, Radii::Each(&radii_of(&map)), &mut vec![0; other.len()], go_on).unwrap();
            assert!(flow.is_break());
            assert_eq!(blurred(&mut slices, &image.rgb, Radii::Field(&DOF, Some(&map))), expected, "after pass {stop}");
        }
    }
}

#[test]
fn slices_that_are_no_picture_are_refused() {
    let narrow = Settings { far_max_px: 2.0, near_max_px: 2.0, ..settings(CocKind::Depth) };
    let mut slices = SliceBlur::new(&narrow, (4, 3), Some(1)).unwrap();
    let mut blur = |pixels: usize, radii: usize, out: usize| {
        let (pixels, radii, mut out) = (vec![0u8; pixels], vec![0.0; radii], vec![0u8; out]);
        slices.blur(&pixels, Radii::Each(&radii), &mut out, || ControlFlow::Continue(()))
    };
    assert!(blur(36, 12, 36).is_ok());
    for (pixels, radii, out) in [(35, 12, 36), (36, 11, 36), (36, 12, 37)] {
        assert!(matches!(blur(pixels, radii, out), Err(BokehError::Lengths { .. })));
    }
    let no_depth = slices.blur(&[0u8; 36], Radii::Field(&DOF, None), &mut [0; 36], || ControlFlow::Continue(()));
    assert!(matches!(no_depth, Err(BokehError::NoDepth)));
    let too_wide = Settings { far_max_px: 1e6, ..settings(CocKind::Depth) };
    assert!(matches!(SliceBlur::new(&too_wide, SIZE, None), Err(BokehError::TooWide { .. })));
}
