//! The laws that every blur obeys, on the CPU executor.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Method, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::depth::matting::{self, Matting};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc};
use common::{COC_KINDS, coc, codes_apart, color, depth, noise, settings, shapes, three_depths};

fn blur(settings: &Settings, color: &ColorImage, map: &DepthMap, field: &CocField) -> ColorImage {
    let mut out = ColorImage::default();
    let plan = Plan::new(settings, color.width, color.height);
    CpuBokeh::new(plan, Some(2)).blur(color, Some(map), field, &mut out).expect("a blur of fitting input");
    out
}

#[test]
fn a_constant_picture_stays_constant() {
    let (width, height) = (67, 45);
    let map = three_depths(width, height);
    for effect in COC_KINDS {
        for shape in shapes() {
            for (quality, rank, highlights) in [
                (Quality::Draft, None, 0.0),
                (Quality::Balanced, None, 8.0),
                (Quality::Best, Some(Rank::Terms(7)), 0.0),
                (Quality::Balanced, Some(Rank::Terms(1)), 8.0),
                (Quality::Draft, Some(Rank::Full), 0.0),
            ] {
                let aperture = Aperture { shape: shape.clone(), intensity: 0.0 };
                let settings = Settings { aperture, quality, rank, highlights, ..settings(effect) };
                let constant = color(width, height, |_, _| [200, 90, 13]);
                let out = blur(&settings, &constant, &map, &coc(effect, height));
                let worst = codes_apart(&out, &constant);
                assert!(worst <= 1, "{effect:?} {shape:?} {quality} {rank:?} {highlights}: {worst}");
            }
        }
    }
}

/// Convolves directly in two dimensions with the bank's own kernel, borders repeated.
fn convolve(image: &ColorImage, plan: &Plan, radius_px: f32) -> Vec<f32> {
    let node = plan.bank.nearest_node(radius_px);
    let (kernel, reach) = (plan.bank.kernel(node, false), plan.bank.node_half_width[node] as i64);
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let mut out = Vec::new();
    for y in 0..height {
        for x in 0..width {
            for p in 0..3 {
                let mut sum = 0.0;
                for (k, tap) in kernel.iter().enumerate() {
                    let (i, j) = (k as i64 % (2 * reach + 1) - reach, k as i64 / (2 * reach + 1) - reach);
                    let at = (y + j).clamp(0, height - 1) * width + (x + i).clamp(0, width - 1);
                    sum += tap * srgb_to_linear(f32::from(image.rgb[(at * 3 + p) as usize]) / 255.0);
                }
                out.push(sum);
            }
        }
    }
    out
}

#[test]
fn full_rank_is_the_two_dimensional_convolution() {
    let image = noise(48, 37);
    for shape in [Shape::Disc, Shape::Heart, Shape::Polygon { blades: 5, rotation_deg: 0.0, curvature: 0.0 }] {
        let settings = Settings {
            rank: Some(Rank::Full),
            aperture: Aperture { shape, intensity: 0.0 },
            far_max_px: 6.5,
            ..settings(CocKind::Uniform)
        };
        let plan = Plan::new(&settings, 48, 37);
        let direct = convolve(&image, &plan, 6.5);
        let out = blur(&settings, &image, &DepthMap::default(), &CocField::Uniform { radius_px: 6.5 });
        for (code, light) in out.rgb.iter().zip(&direct) {
            let expected = linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0;
            assert!((f32::from(*code) - expected).abs() <= 1.0, "{code} against {expected}");
        }
    }
}

#[test]
fn the_exact_gather_is_the_two_dimensional_convolution_too() {
    let image = noise(40, 30);
    let settings =
        Settings { method: Method::Gather, rank: Some(Rank::Full), near_max_px: 6.5, ..settings(CocKind::Depth) };
    let lens = DepthCoc { coc_at_infinity_px: 12.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 6.5 };
    let map = depth(40, 30, |_, _| 100.0);
    let plan = Plan::new(&settings, 40, 30);
    let direct = convolve(&image, &plan, 6.5);
    let out = blur(&settings, &image, &map, &CocField::Depth(lens));
    for (code, light) in out.rgb.iter().zip(&direct) {
        assert!((f32::from(*code) - linear_to_srgb(*light) * 255.0).abs() <= 1.0);
    }
}

/// Returns the centroid of the light above the background, and the root mean square distance from it.
fn spot(image: &ColorImage, background: f32) -> (f64, f64, f64) {
    let (mut sum, mut sum_x, mut sum_y, mut sum_xx) = (0.0, 0.0, 0.0, 0.0);
    for (k, pixel) in image.rgb.chunks_exact(3).enumerate() {
        let light = f64::from(srgb_to_linear(f32::from(pixel[1]) / 255.0) - background);
        let (x, y) = (f64::from(k as u32 % image.width), f64::from(k as u32 / image.width));
        sum += light;
        sum_x += light * x;
        sum_y += light * y;
        sum_xx += light * (x * x + y * y);
    }
    let (x, y) = (sum_x / sum, sum_y / sum);
    (x, y, (sum_xx / sum - x * x - y * y).max(0.0).sqrt())
}

/// Returns a bright square on black, `size` pixels wide, and its centre.
fn bright_square(size: u32) -> (ColorImage, f64) {
    let image = color(101, 101, |x, y| {
        let inside = |v: u32| (50..50 + size).contains(&v);
        if inside(x) && inside(y) { [255; 3] } else { [0; 3] }
    });
    (image, 50.0 + f64::from(size - 1) / 2.0)
}

#[test]
fn a_blurred_point_does_not_shift() {
    let far = depth(101, 101, |_, _| 1e6);
    for (quality, coc_px) in Quality::ALL.into_iter().flat_map(|quality| [12.0, 16.0].map(|coc_px| (quality, coc_px))) {
        for size in [4, 5, 6, 7] {
            let (image, middle) = bright_square(size);
            let field =
                CocField::Depth(DepthCoc { coc_at_infinity_px: coc_px, focus_m: 1.0, range_m: 0.0, max_coc_px: 18.0 });
            let settings = Settings { quality, far_max_px: coc_px, ..settings(CocKind::Depth) };
            let (x, y, _) = spot(&blur(&settings, &image, &far, &field), 0.0);
            let shift_px = (x - middle).abs().max((y - middle).abs());
            assert!(shift_px < 0.05, "{quality}, {coc_px} px, {size}: {x} {y} {middle}");
        }
    }
}

#[test]
fn quality_changes_fidelity_never_the_amount_of_blur() {
    let far = depth(101, 101, |_, _| 1e6);
    let (image, _) = bright_square(5);
    for coc_px in [3.0, 5.0, 8.0, 12.0, 16.0] {
        let field =
            CocField::Depth(DepthCoc { coc_at_infinity_px: coc_px, focus_m: 1.0, range_m: 0.0, max_coc_px: 18.0 });
        let spread = |quality| {
            let settings = Settings { quality, far_max_px: coc_px, ..settings(CocKind::Depth) };
            spot(&blur(&settings, &image, &far, &field), 0.0).2
        };
        let best = spread(Quality::Best);
        for quality in Quality::ALL {
            let ratio = spread(quality) / best;
            assert!((ratio - 1.0).abs() < 0.03, "{quality} at {coc_px} px: {ratio}");
        }
    }
}

#[test]
fn nothing_beside_a_highlight_is_darker_than_its_surroundings() {
    let background = [60, 70, 80];
    let image = color(141, 141, |x, y| {
        let inside = (x as i32 - 70).pow(2) + (y as i32 - 70).pow(2) < 100;
        if inside { [255; 3] } else { background }
    });
    let far = depth(141, 141, |_, _| 1e6);
    for shape in shapes() {
        for rank in [1, 2, 3, 4, 8] {
            let aperture = Aperture { shape: shape.clone(), intensity: 0.0 };
            let settings = Settings {
                aperture,
                rank: Some(Rank::Terms(rank)),
                highlights: 8.0,
                rim: 0.0,
                ..settings(CocKind::Depth)
            };
            let out = blur(&settings, &image, &far, &coc(CocKind::Depth, 141));
            for (p, &ground) in background.iter().enumerate() {
                let lowest = out.rgb.iter().skip(p).step_by(3).min().copied().unwrap_or(0);
                let light = |code: u8| srgb_to_linear(f32::from(code) / 255.0);
                // Half a code value is lost in rounding.
                let least = 0.98 * light(ground) - 0.5 / 255.0;
                assert!(light(lowest) >= least, "{shape:?} rank {rank}: {lowest} beside {ground}");
            }
        }
    }
}

#[test]
fn the_subject_in_focus_stays_as_it_is_and_does_not_leak_into_the_background() {
    let (width, height) = (120, 90);
    let subject = |x: u32, y: u32| (40..80).contains(&x) && y >= 30;
    let image = color(width, height, |x, y| if subject(x, y) { [240, 30, 20] } else { [20, 40, 60] });
    let map = depth(width, height, |x, y| if subject(x, y) { 1.0 } else { 5.0 });
    let out = blur(&settings(CocKind::Depth), &image, &map, &coc(CocKind::Depth, height));
    for (k, (after, before)) in out.rgb.chunks_exact(3).zip(image.rgb.chunks_exact(3)).enumerate() {
        let far = after.iter().zip(before).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(far <= Some(2), "pixel {}, {}: {after:?} was {before:?}", k as u32 % width, k as u32 / width);
    }
}

#[test]
fn something_in_front_spreads_over_the_subject() {
    let (width, height) = (120, 60);
    let image = color(width, height, |x, _| if x < 40 { [255, 255, 255] } else { [0, 0, 0] });
    let map = depth(width, height, |x, _| if x < 40 { 0.6 } else { 1.0 });
    let out = blur(&settings(CocKind::Depth), &image, &map, &coc(CocKind::Depth, height));
    let light = |x: usize| srgb_to_linear(f32::from(out.rgb[(30 * width as usize + x) * 3]) / 255.0);
    // The CoC of the front is 8 px: half covered at its edge, some 5 px outside, nothing 12 px outside.
    assert!((light(39) + light(40) - 1.0).abs() < 0.1, "{} {}", light(39), light(40));
    assert!(light(45) > 0.05 && light(34) < 0.95 && light(52) < 1e-3 && light(25) > 0.99);
}

#[test]
fn unknown_depth_is_blurred_never_shown() {
    let image = noise(64, 48);
    let unknown = depth(64, 48, |x, _| [0.0, f32::NAN, -1.0, f32::INFINITY][x as usize % 4]);
    let far = depth(64, 48, |_, _| 1e9);
    let of = |map| blur(&settings(CocKind::Depth), &image, map, &coc(CocKind::Depth, 48));
    assert_eq!(of(&unknown), of(&far));
}

#[test]
fn odd_and_tiny_pictures_work() {
    for (width, height) in [(1, 1), (17, 13), (2, 3), (4096, 2), (1, 300)] {
        for effect in COC_KINDS {
            for quality in [Quality::Draft, Quality::Balanced, Quality::Best] {
                let image = noise(width, height);
                let settings = Settings { quality, ..settings(effect) };
                let out = blur(&settings, &image, &three_depths(width, height), &coc(effect, height));
                assert_eq!(out.size(), (width, height));
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (image, map) = (noise(150, 110), three_depths(150, 110));
    let of = |threads| {
        let mut out = ColorImage::default();
        let plan = Plan::new(&settings(CocKind::Depth), 150, 110);
        let mut cpu = CpuBokeh::new(plan, Some(threads));
        for _ in 0..3 {
            cpu.blur(&image, Some(&map), &coc(CocKind::Depth, 110), &mut out).expect("a blur");
        }
        out
    };
    let one = of(1);
    assert_eq!(one, of(2));
    assert_eq!(one, of(5));
}

#[test]
fn a_frame_leaves_no_trace_in_the_next() {
    let (width, height) = (150, 110);
    let mut cpu = CpuBokeh::new(Plan::new(&settings(CocKind::Depth), width, height), Some(2));
    let (image, field) = (noise(width, height), coc(CocKind::Depth, height));
    let mut out = ColorImage::default();
    for k in 0..6 {
        let map = depth(width, height, |x, y| [0.5, 1.0, 4.0, 1.4][((x / 30 + y / 20 + k) % 4) as usize]);
        cpu.blur(&image, Some(&map), &field, &mut out).expect("a blur");
        assert_eq!(out, blur(&settings(CocKind::Depth), &image, &map, &field), "frame {k}");
    }
}

#[test]
fn a_surface_that_moves_away_leaves_no_trace() {
    let (width, height) = (96, 64);
    let frame = |k: u32| {
        let image = color(width, height, |x, y| [if (x / 2 + y / 2) % 2 == 0 { 60 + 30 * k as u8 } else { 20 }; 3]);
        (image, depth(width, height, |x, _| if x < width / 2 { 1.0 } else { 2.0 + k as f32 }))
    };
    for far_max_px in [1.0, 1.4, 1.5, 2.0, 2.5, 3.0, 5.0, 8.0, 12.0, 16.0, 24.0] {
        for quality in Quality::ALL {
            let settings = Settings { quality, far_max_px, near_max_px: 20.0, ..settings(CocKind::Depth) };
            let lens = DepthCoc { coc_at_infinity_px: far_max_px, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
            let field = CocField::Depth(lens);
            let mut executor = CpuBokeh::new(Plan::new(&settings, width, height), Some(2));
            for k in [0, 1, 2, 3, 4, 1, 0, 3] {
                let (image, mut map) = frame(k);
                Matting::default().find_mixed_pixels(&mut map, &image, lens.inverse_depth_step(matting::MIN_STEP_PX));
                let [mut after, mut alone] = [ColorImage::default(), ColorImage::default()];
                executor.blur(&image, Some(&map), &field, &mut after).expect("a blur");
                let mut fresh = CpuBokeh::new(Plan::new(&settings, width, height), Some(1));
                fresh.blur(&image, Some(&map), &field, &mut alone).expect("a blur");
                assert!(after == alone, "{far_max_px} px, {quality}, frame {k}: {}", codes_apart(&after, &alone));
            }
        }
    }
}

#[test]
fn what_has_left_a_side_of_the_picture_leaves_no_trace_there() {
    let (width, height) = (520, 40);
    let mut cpu = CpuBokeh::new(Plan::new(&settings(CocKind::Depth), width, height), Some(1));
    let (image, field) = (noise(width, height), coc(CocKind::Depth, height));
    let mut out = ColorImage::default();
    for (frame, metres) in [[4.0, 1.0], [1.0, 4.0], [0.5, 1.0], [1.0, 0.5], [1.0, 1.0], [4.0, 1.0]].iter().enumerate() {
        let map = depth(width, height, |x, _| metres[usize::from(x >= width / 2)]);
        cpu.blur(&image, Some(&map), &field, &mut out).expect("a blur");
        assert!(out == blur(&settings(CocKind::Depth), &image, &map, &field), "frame {frame}");
    }
}

#[test]
fn a_range_of_focus_is_sharp_as_a_whole_and_its_ends_are_focal_planes() {
    let (width, height) = (150, 110);
    let image = noise(width, height);
    let lens =
        |focus_m, range_m| CocField::Depth(DepthCoc { coc_at_infinity_px: 12.0, focus_m, range_m, max_coc_px: 18.0 });
    let settings = settings(CocKind::Depth);
    let (near_m, far_m) = (1.0 - 0.5 * 0.4f32, 1.0 + 0.5 * 0.4f32);
    let within = depth(width, height, |x, y| 0.801 + 0.398 * ((x * 7 + y * 13) % 101) as f32 / 101.0);
    let out = blur(&settings, &image, &within, &lens(1.0, 0.4));
    let worst = codes_apart(&out, &image);
    assert!(worst <= 1, "{worst}");
    assert!(out != blur(&settings, &image, &within, &lens(1.0, 0.0)), "without a range some of it is blurred");
    // Behind the focus range the blur equals that of a focus at its far end; in front of it, at its near end.
    let behind = depth(width, height, |x, _| [1.2, 1.9, 6.0, 0.0][x as usize / 10 % 4]);
    assert_eq!(blur(&settings, &image, &behind, &lens(1.0, 0.4)), blur(&settings, &image, &behind, &lens(far_m, 0.0)));
    let before = depth(width, height, |x, _| [0.8, 0.6, 0.3][x as usize / 10 % 3]);
    assert_eq!(blur(&settings, &image, &before, &lens(1.0, 0.4)), blur(&settings, &image, &before, &lens(near_m, 0.0)));
}
