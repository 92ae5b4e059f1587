//! Laws of the quality bench: its metrics, its renderer, its rivals and its damage.
#![allow(dead_code, missing_docs)]

#[path = "../../benches/quality/builder.rs"]
mod builder;
#[path = "../../benches/quality/damage.rs"]
mod damage;
#[path = "../../benches/quality/flip.rs"]
mod flip;
#[path = "../../benches/quality/highlight.rs"]
mod highlight;
#[path = "../../benches/quality/lens.rs"]
mod lens;
#[path = "../../benches/quality/methods.rs"]
mod methods;
#[path = "../../benches/quality/metrics.rs"]
mod metrics;
#[path = "../../benches/quality/picture.rs"]
mod picture;
#[path = "../../benches/quality/rivals.rs"]
mod rivals;
#[path = "../../benches/quality/scenes.rs"]
mod scenes;
#[path = "../../benches/quality/sheet.rs"]
mod sheet;
#[path = "../../benches/quality/texture.rs"]
mod texture;
#[path = "../../benches/quality/truth.rs"]
mod truth;

use std::f32::consts::PI;

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::frame::ColorImage;
use bokehcam::optics::DepthCoc;
use glam::Vec2;

use damage::Damage;
use lens::{Rgba, Scene, Surface};
use picture::{Plane, Rgb, decode_srgb, encode_srgb};

const SIZE: (usize, usize) = (72, 56);

fn color(of: impl Fn(u32, u32) -> [u8; 3]) -> ColorImage {
    let (width, height) = (64, 48);
    ColorImage { width, height, rgb: (0..width * height).flat_map(|k| of(k % width, k / width)).collect() }
}

fn surface(coc_px: f32, slope: Vec2, of: impl Fn(Vec2) -> Rgba + Sync) -> Surface {
    Surface { coc_px, slope, texture: texture::render_texture(SIZE, 0, of), margin_px: 0 }
}

fn scene(shape: Shape, surfaces: Vec<Surface>) -> Scene {
    let (width, height) = SIZE;
    Scene { width, height, coc_at_infinity_px: 20.0, aperture: Aperture { shape, intensity: 0.0 }, surfaces }
}

/// Returns three surfaces with edges, one of them slanted, with the CoC scaled by `strength`.
fn layers(strength: f32, of: impl Fn(Vec2) -> Rgb + Copy + Sync) -> Scene {
    let cut = |p: Vec2, radius: f32| {
        texture::coverage_from_distance(texture::disc_distance(p, Vec2::new(30.0, 25.0), radius))
    };
    scene(
        Shape::Disc,
        vec![
            surface(9.0 * strength, Vec2::new(0.05, 0.02) * strength, |p| texture::premultiply(of(p), 1.0)),
            surface(0.0, Vec2::ZERO, |p| texture::premultiply(of(p), cut(p, 15.0))),
            surface(-6.0 * strength, Vec2::ZERO, |p| texture::premultiply(of(p), cut(p, 6.0))),
        ],
    )
}

fn worst(a: &Plane<Rgb>, b: &Plane<Rgb>) -> f32 {
    a.data.iter().flatten().zip(b.data.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn equal_pictures_are_equal_by_every_metric() {
    let image = color(|x, y| [(x * 4) as u8, (y * 5) as u8, (x * y % 256) as u8]);
    assert_eq!(metrics::psnr(&image, &image, None), f64::INFINITY);
    assert!((metrics::ssim(&image, &image) - 1.0).abs() < 1e-12);
    assert_eq!(flip::mean_flip(&image, &image), 0.0);
    assert_eq!(metrics::mean_flicker(&[image.clone(), image], |_| true), 0.0);
}

#[test]
fn psnr_is_that_of_its_formula_and_of_its_region() {
    let (black, ten) = (color(|_, _| [0; 3]), color(|x, _| if x < 32 { [10; 3] } else { [0; 3] }));
    assert!((metrics::psnr(&black, &ten, None) - 10.0 * (65025.0f64 / 50.0).log10()).abs() < 1e-9);
    let left = Plane::from_fn(64, 48, |x, _| x < 32);
    assert!((metrics::psnr(&black, &ten, Some(&left)) - 10.0 * (65025.0f64 / 100.0).log10()).abs() < 1e-9);
    assert!(metrics::psnr(&black, &ten, Some(&left.map(|_| false))).is_nan());
}

#[test]
fn flip_agrees_with_its_authors_program() {
    // Means of the C++ reference, version 1.2 (crate nv-flip 0.1.2), for the same pictures.
    let ramp = color(|x, y| [(x * 4) as u8, (y * 5) as u8, (x * y % 256) as u8]);
    let checked =
        color(|x, y| [((x * 4) ^ ((x / 8 + y / 8) % 2 * 24)) as u8, (y * 5) as u8, ((x + 3) * y % 256) as u8]);
    let step = |at: u32| color(move |x, _| [if x < at { 40 } else { 200 }; 3]);
    for (a, b, expected) in
        [(&ramp, &checked, 0.218017), (&step(32), &step(35), 0.082034), (&ramp, &step(32), 0.815419)]
    {
        let found = flip::mean_flip(a, b);
        assert!((found - expected).abs() < 1e-3, "{found} instead of {expected}");
    }
}

#[test]
fn ssim_falls_with_contrast_as_in_its_formula() {
    // Constant pictures: only the luminance term is left.
    let (a, b) = (color(|_, _| [100; 3]), color(|_, _| [120; 3]));
    let expected = (2.0 * 100.0 * 120.0 + 6.5025) / (100.0f64.powi(2) + 120.0f64.powi(2) + 6.5025);
    assert!((metrics::ssim(&a, &b) - expected).abs() < 1e-9);
}

#[test]
fn a_constant_scene_is_constant_through_the_lens() {
    let constant = [0.3, 0.6, 0.1];
    let seen = layers(1.0, |_| constant).render_thin_lens(200);
    assert!(seen.data.iter().flatten().zip(constant.iter().cycle()).all(|(a, b)| (a - b).abs() < 2e-3));
}

#[test]
fn a_lens_without_an_opening_is_a_pinhole() {
    let of = |p: Vec2| texture::pattern_color(p, [1.0, 0.8, 0.5], texture::Pattern::Stripes(7.0), 3);
    let scene = layers(0.0, of);
    assert!(worst(&scene.render_thin_lens(256), &scene.render_pinhole()) < 0.02);
}

#[test]
fn a_far_point_of_light_shows_the_aperture_and_a_near_one_the_same_turned() {
    let middle = Vec2::new(35.5, 27.5);
    let triangle = Shape::Polygon { blades: 3, rotation_deg: 0.0, curvature: 0.0 };
    let area_of_triangle = 3.0 * 3f32.sqrt() / 4.0;
    for (shape, area) in [(Shape::Disc, PI), (triangle, area_of_triangle)] {
        let mut skew = [0.0; 2];
        for (coc_px, skew) in [12.0f32, -12.0].into_iter().zip(&mut skew) {
            let light = |p: Vec2| {
                [1000.0 * texture::coverage_from_distance(texture::disc_distance(p, middle, 1.5)), 0.0, 0.0, 1.0]
            };
            let scene = scene(shape.clone(), vec![surface(coc_px, Vec2::ZERO, light)]);
            let (sharp, seen) = (scene.render_pinhole(), scene.render_thin_lens(4000));
            let total = |of: &Plane<Rgb>| of.data.iter().map(|p| f64::from(p[0])).sum::<f64>();
            assert!((total(&seen) / total(&sharp) - 1.0).abs() < 5e-3, "no light is lost");
            let mean = |of: &dyn Fn(Vec2) -> f32| {
                let each = seen.data.iter().enumerate();
                let sum: f64 =
                    each.map(|(k, p)| f64::from(p[0] * of(Vec2::new((k % 72) as f32, (k / 72) as f32)))).sum();
                (sum / total(&seen)) as f32
            };
            let centroid = Vec2::new(mean(&|p| p.x), mean(&|p| p.y));
            assert!(centroid.distance(middle) < 0.1, "{shape:?}: {centroid}");
            // The area brighter than half the plateau equals that of the aperture.
            let plateau = seen.at(35, 27)[0];
            let found = seen.data.iter().filter(|p| p[0] > 0.5 * plateau).count() as f32;
            let expected = area * coc_px * coc_px;
            assert!((found / expected - 1.0).abs() < 0.06, "{shape:?}: {found} instead of {expected}");
            *skew = mean(&|p| (p.x - middle.x).powi(3));
        }
        if shape != Shape::Disc {
            // At 0 degrees one corner of a far triangle points to the left.
            assert!(skew[0] < -10.0 && skew[1] > 10.0, "{skew:?}");
        }
    }
}

#[test]
fn depth_gives_back_the_coc() {
    let scene = layers(1.0, |_| [0.5; 3]);
    let coc_px = scene.render_coc();
    assert_eq!(coc_px.at(30, 25), -6.0);
    assert_eq!(coc_px.at(18, 25), 0.0);
    let lens = DepthCoc { coc_at_infinity_px: 20.0, focus_m: scenes::FOCUS_M, range_m: 0.0, max_coc_px: 99.0 };
    let depth = truth::depth_from_coc(&coc_px, 20.0);
    assert!(depth.metres.iter().zip(&coc_px.data).all(|(&z_m, c)| (lens.coc_px(z_m) - c).abs() < 1e-4));
}

#[test]
fn rivals_keep_a_constant_picture() {
    let coc_px = layers(1.0, |_| [0.5; 3]).render_coc();
    let constant = coc_px.map(|_| [0.2, 0.4, 0.8]);
    let polygon = Shape::Polygon { blades: 5, rotation_deg: 20.0, curvature: 0.0 };
    for blurred in [
        rivals::scatter_blur(&constant, &coc_px, &Shape::Disc),
        rivals::scatter_blur(&constant, &coc_px, &polygon),
        rivals::golden_angle_blur(&constant, &coc_px),
        rivals::gaussian_blur(&constant, &coc_px),
        rivals::blended_blur(&constant, &coc_px),
        rivals::near_focus_far_blur(&constant, &coc_px),
    ] {
        assert!(worst(&blurred, &constant) < 1e-3);
    }
}

#[test]
fn rivals_blur_a_plane_as_the_lens_does() {
    let of = |p: Vec2| texture::premultiply(texture::pattern_color(p, [1.0; 3], texture::Pattern::Checks(9.0), 3), 1.0);
    for (shape, least_db) in
        [(Shape::Disc, 38.0), (Shape::Polygon { blades: 5, rotation_deg: 20.0, curvature: 0.0 }, 36.0)]
    {
        let scene = scene(shape.clone(), vec![surface(7.0, Vec2::ZERO, of)]);
        let (image, coc_px) = (decode_srgb(&encode_srgb(&scene.render_pinhole())), scene.render_coc());
        let truth = encode_srgb(&scene.render_thin_lens(1000));
        let mut all = vec![("scatter", rivals::scatter_blur(&image, &coc_px, &shape))];
        if shape == Shape::Disc {
            all.push(("golden", rivals::golden_angle_blur(&image, &coc_px)));
            all.push(("near, focus, far", rivals::near_focus_far_blur(&image, &coc_px)));
        }
        for (name, blurred) in all {
            let db = metrics::psnr(&encode_srgb(&blurred), &truth, None);
            assert!(db > least_db, "{name} {shape:?}: {db} dB");
        }
    }
}

#[test]
fn damage_is_as_strong_as_it_says() {
    let coc_px = Plane::from_fn(320, 200, |x, y| if x > 100 && y > 50 { 9.0 } else { -4.0 });
    let deviation = |of: &Plane<f32>| {
        let errors = of.data.iter().zip(&coc_px.data).map(|(a, b)| f64::from((a - b).powi(2)));
        (errors.sum::<f64>() / of.data.len() as f64).sqrt()
    };
    let (noisy, _) = Damage::Noise.apply(&coc_px, 1);
    assert!((deviation(&noisy) - 0.8).abs() < 0.08, "{}", deviation(&noisy));
    assert_ne!(noisy, Damage::Noise.apply(&coc_px, 2).0);
    let (_, known) = Damage::Holes.apply(&coc_px, 1);
    let unknown = known.data.iter().filter(|known| !**known).count() as f32 / known.data.len() as f32;
    assert!((0.05..0.053).contains(&unknown), "{unknown}");
    let (fat, _) = Damage::Fat.apply(&coc_px, 1);
    assert!(fat.at(103, 120) == -4.0 && fat.at(104, 120) == 9.0);
    let (coarse, _) = Damage::Coarse.apply(&Plane::from_fn(320, 200, |x, y| 0.1 * x as f32 - 0.2 * y as f32), 1);
    assert!((coarse.at(101, 97) - (10.1 - 19.4)).abs() < 1e-3);
}

#[test]
fn holes_take_the_nearest_depth() {
    let metres = Plane::from_fn(40, 30, |x, _| if (10..20).contains(&x) { 0.0 } else { x as f32 + 1.0 });
    let filled = damage::fill_from_nearest(&metres);
    assert_eq!((filled.at(14, 3), filled.at(15, 3), filled.at(3, 3)), (10.0, 21.0, 4.0));
}

#[test]
fn every_scene_fits_its_lens() {
    for kind in &scenes::KINDS {
        let scene = (kind.at)(0);
        let max_px = scene.render_coc().data.iter().fold(f32::NEG_INFINITY, |most, &c| most.max(c));
        assert!(max_px < scene.coc_at_infinity_px, "{}: {max_px}", kind.name);
        assert_eq!(scene.size(), scenes::SIZE);
    }
    let moving = scenes::KINDS.iter().filter(|kind| kind.moves);
    assert!(moving.into_iter().all(|kind| (kind.at)(0).render_coc() != (kind.at)(1).render_coc()));
}

#[test]
fn the_profile_of_a_known_disc_is_found() {
    let light = |rho: f32| if rho < highlight::COC_PX { 0.4 } else { 0.0 };
    let wall = decode_srgb(&ColorImage { width: 1, height: 1, rgb: vec![60; 3] }).data[0][0];
    let middle = Vec2::new(319.5, 179.5);
    let picture = Plane::from_fn(640, 360, |x, y| [wall + light(middle.distance(Vec2::new(x as f32, y as f32))); 3]);
    let profile = highlight::measure_profile(&encode_srgb(&picture));
    assert!(profile.ripple_percent < 1e-3 && profile.rim_px < 1.0 && profile.lowest_percent == 0.0, "{profile:?}");
    let mut dark = encode_srgb(&picture);
    dark.rgb[..3].copy_from_slice(&[50; 3]);
    assert!(highlight::measure_profile(&dark).lowest_percent < -20.0);
}
