//! Large pictures are blurred in bands of rows: their seams are invisible.
#![allow(missing_docs)]

use std::ops::ControlFlow;

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::bokeh::cpu::BandedBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::slices::{Radii, Sample};
use bokehcam::bokeh::{Method, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::frame::{ColorImage, DepthMap, MixedPixel};
use bokehcam::optics::{CocField, CocKind};

use crate::common::{COC_KINDS, DOF, coc, codes_apart, depth, noise, settings, three_depths};

/// Blurs a picture as a whole, and in bands of 256 rows.
fn both(settings: &Settings, color: &ColorImage, map: &DepthMap, field: &CocField) -> [ColorImage; 2] {
    both_of(settings, color.size(), &color.rgb, Radii::Field(field, Some(map)))
        .map(|rgb| ColorImage { rgb, ..color.clone() })
}

/// Blurs pixels of any type as a whole, and in bands of 256 rows.
fn both_of<T: Sample>(settings: &Settings, size: (u32, u32), pixels: &[T], coc: Radii<'_>) -> [Vec<T>; 2] {
    let plan = || Plan::new(settings, size.0, size.1);
    [BandedBokeh::new(plan(), Some(2)), BandedBokeh::with_rows(plan(), Some(2), 256)].map(|mut executor| {
        let mut out = vec![T::default(); pixels.len()];
        assert!(executor.blur_pixels(pixels, coc, &mut out, |_| ControlFlow::Continue(())).is_continue());
        out
    })
}

/// Returns a subject in focus before a wall, along all rows.
fn subject(width: u32, height: u32) -> DepthMap {
    depth(width, height, |x, y| {
        let edge = 0.5 + 0.2 * (y as f32 / 40.0).sin();
        if (x as f32) < edge * width as f32 { 1.0 } else { 2.0 + y as f32 / height as f32 }
    })
}

#[test]
fn bands_are_the_whole_picture_to_the_bit() {
    let (width, height) = (72, 1700);
    let (color, map) = (noise(width, height), subject(width, height));
    for kind in COC_KINDS {
        for (quality, shape) in [(Quality::Balanced, Shape::Disc), (Quality::Best, Shape::Heart)] {
            let settings = Settings {
                quality,
                aperture: Aperture { shape, ..Aperture::default() },
                highlights: 4.0,
                ..settings(kind)
            };
            let [whole, banded] = both(&settings, &color, &map, &coc(kind, height));
            assert!(whole == banded, "{kind:?} {quality}: {}", codes_apart(&whole, &banded));
        }
    }
    for far_max_px in [12.0, 19.0, 40.0] {
        let settings = Settings { privacy: true, far_max_px, ..settings(CocKind::Uniform) };
        let [whole, banded] = both(&settings, &color, &map, &CocField::Uniform { radius_px: far_max_px });
        assert!(whole == banded, "private, {far_max_px} px: {}", codes_apart(&whole, &banded));
    }
    for rank in [None, Some(Rank::Full)] {
        let gather = Settings { method: Method::Gather, rank, ..settings(CocKind::Depth) };
        let [whole, banded] = both(&gather, &color, &map, &DOF);
        assert!(whole == banded, "gather, {rank:?}: {}", codes_apart(&whole, &banded));
    }
}

#[test]
fn bands_of_any_samples_by_given_radii_are_the_whole_picture_to_the_bit() {
    let size = (72, 1700);
    let (color, map) = (noise(size.0, size.1), subject(size.0, size.1));
    let CocField::Depth(lens) = DOF else { unreachable!() };
    let radii: Vec<f32> = map.metres.iter().map(|&metres| lens.coc_px(metres)).collect();
    let codes: Vec<u16> = color.rgb.iter().map(|&code| u16::from(code) * 257).collect();
    let light: Vec<f32> = color.rgb.iter().map(|&code| f32::from(code) / 255.0).collect();
    let settings = settings(CocKind::Depth);
    let [whole, banded] = both_of(&settings, size, &codes, Radii::Each(&radii));
    assert!(whole == banded && whole != codes, "16 bits");
    let [whole, banded] = both_of(&settings, size, &light, Radii::Each(&radii));
    assert!(whole == banded && whole != light, "linear light");
}

#[test]
fn bands_are_left_out_once_the_picture_is_stopped() {
    let (color, map) = (noise(72, 1700), subject(72, 1700));
    let mut executor = BandedBokeh::with_rows(Plan::new(&settings(CocKind::Depth), 72, 1700), Some(2), 256);
    let (mut out, mut passes) = (vec![0; color.rgb.len()], 0);
    let flow = executor.blur_pixels(&color.rgb, Radii::Field(&DOF, Some(&map)), &mut out, |_| {
        passes += 1;
        ControlFlow::Break(())
    });
    assert!(flow.is_break() && passes == 1);
}

#[test]
fn a_smaller_map_and_mixed_pixels_are_those_of_the_band() {
    let (width, height) = (72, 1700);
    let color = noise(width, height);
    let smaller = subject(width / 3, height / 3);
    let [whole, banded] = both(&settings(CocKind::Depth), &color, &smaller, &DOF);
    assert!(whole == banded, "a smaller map: {}", codes_apart(&whole, &banded));
    let mut map = subject(width, height);
    let edges = (0..width * height - 1).filter(|&at| map.metres[at as usize] < map.metres[at as usize + 1]);
    map.matte.pixels = edges
        .map(|at| MixedPixel {
            at,
            near_m: 1.0,
            far_m: map.metres[at as usize + 1],
            alpha: 0.5,
            background_alpha: 0.5,
            difference: [0.1, -0.1, 0.05],
        })
        .collect();
    let [whole, banded] = both(&settings(CocKind::Depth), &color, &map, &DOF);
    assert!(whole == banded, "mixed pixels: {}", codes_apart(&whole, &banded));
    map.matte.pixels.clear();
    let [without, _] = both(&settings(CocKind::Depth), &color, &map, &DOF);
    assert!(without != whole, "mixed pixels count");
}

#[test]
fn inpainting_from_a_band_differs_by_a_code_at_most() {
    let (width, height) = (96, 2600);
    let (color, map) = (noise(width, height), three_depths(width, height));
    let [whole, banded] = both(&settings(CocKind::Depth), &color, &map, &DOF);
    assert!(codes_apart(&whole, &banded) <= 1, "{}", codes_apart(&whole, &banded));
}
