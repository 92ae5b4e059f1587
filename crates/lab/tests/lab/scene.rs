//! The renderer against the laws of optics, and the bundled recording against the renderer.

use bokehcam::bokeh::aperture::{Aperture, Shape, lens_points};
use bokehcam::color::encode_srgb;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::DepthCoc;
use bokehcam_lab::scene::{LinearImage, PointLight, Scene, ThinLens, View};
use glam::{DVec2, Vec3};

const COC_AT_INFINITY_PX: f32 = 14.0;
const FOCUS_M: f32 = 1.2;

fn view() -> View {
    View { width: 97, height: 81, focal_px: 600.0, camera_offset_m: 0.0 }
}

/// Returns a light on the optical axis, of radius `radius_px` when sharp.
fn light_at(depth_m: f32, radius_px: f32) -> PointLight {
    let radius_m = radius_px * depth_m / view().focal_px;
    PointLight { centre_m: depth_m * Vec3::Z, radius_m, radiance: Vec3::splat(50.0) }
}

/// Renders the light through an aperture.
fn blurred(light: PointLight, points: &[DVec2]) -> LinearImage {
    let lens = ThinLens { coc_at_infinity_px: COC_AT_INFINITY_PX, focus_m: FOCUS_M, aperture: points };
    Scene::point_lights(&[light]).render_thin_lens(&view(), 0.0, &lens, 2).hdr
}

/// Returns the moments of a picture about the optical axis: the mean position and the mean squared distance.
fn moments_px(image: &LinearImage) -> (DVec2, f64) {
    let axis = view().principal_point_px().as_dvec2();
    let pixels = || {
        image.rgb.iter().enumerate().map(|(index, light)| {
            let (x, y) = (index % image.width as usize, index / image.width as usize);
            (DVec2::new(x as f64, y as f64) - axis, f64::from(light.x))
        })
    };
    let sum: f64 = pixels().map(|(_, w)| w).sum();
    assert!(sum > 0.0, "the light must be in the picture");
    let mean = pixels().map(|(p, w)| p * w).sum::<DVec2>() / sum;
    (mean, pixels().map(|(p, w)| (p - mean).length_squared() * w).sum::<f64>() / sum)
}

fn of(shape: Shape) -> Aperture {
    Aperture { shape, intensity: 0.0 }
}

#[test]
fn a_point_becomes_a_disc_of_the_thin_lens_radius() {
    let disc = lens_points(&of(Shape::Disc), 6000);
    let coc = DepthCoc { coc_at_infinity_px: COC_AT_INFINITY_PX, focus_m: FOCUS_M, range_m: 0.0, max_coc_px: 100.0 };
    for depth_m in [0.5, 0.8, 2.0, 4.0, 12.0] {
        let (mean, spread) = moments_px(&blurred(light_at(depth_m, 3.0), &disc));
        // A disc of radius r spreads by r^2 / 2; the light itself, 3 px, and the square pixel add theirs.
        let radius_px = (2.0 * (spread - 4.5 - 1.0 / 6.0)).sqrt();
        let expected_px = f64::from(coc.coc_px(depth_m).abs());
        assert!((radius_px - expected_px).abs() < 0.1, "{depth_m} m: radius {radius_px}, expected {expected_px}");
        assert!(mean.length() < 0.05, "{depth_m} m: the middle moved by {mean}");
    }
}

#[test]
fn in_focus_the_lens_is_a_pinhole() {
    let disc = lens_points(&of(Shape::Disc), 4000);
    let (_, spread) = moments_px(&blurred(light_at(FOCUS_M, 0.3), &disc));
    assert!(spread < 0.01, "all of it is in one pixel: {spread}");
}

#[test]
fn a_far_light_shows_the_aperture_and_a_near_one_the_aperture_turned() {
    // A triangle with one corner to the left: its spread is skewed to that side.
    let triangle = lens_points(&of(Shape::Polygon { blades: 3, rotation_deg: 0.0, curvature: 0.0 }), 3000);
    let reach = |depth_m: f32| {
        let image = blurred(light_at(depth_m, 0.3), &triangle);
        let axis_px = view().principal_point_px().x;
        let lit = image.rgb.iter().enumerate().filter(|(_, light)| light.x > 1e-4);
        let columns = lit.map(|(index, _)| (index % image.width as usize) as f32 - axis_px);
        columns.fold((0.0f32, 0.0f32), |(low, high), x| (low.min(x), high.max(x)))
    };
    let (far_left, far_right) = reach(6.0);
    let (near_left, near_right) = reach(0.6);
    // c = 11.2 px and -14 px; the opposite edge of the triangle is half as far as its corner.
    assert!((far_left + 11.2).abs() < 1.2 && (far_right - 5.6).abs() < 1.2, "{far_left} {far_right}");
    assert!((near_right - 14.0).abs() < 1.2 && (near_left + 7.0).abs() < 1.2, "{near_left} {near_right}");
}

#[test]
fn light_is_neither_made_nor_lost_and_clipping_comes_before_the_lens() {
    let disc = lens_points(&of(Shape::Disc), 2000);
    let lens = ThinLens { coc_at_infinity_px: 6.0, focus_m: FOCUS_M, aperture: &disc };
    let light = light_at(3.0, 2.0);
    let picture = Scene::point_lights(&[light]).render_thin_lens(&view(), 0.0, &lens, 2);
    let total = |image: &LinearImage| image.rgb.iter().map(|light| f64::from(light.x)).sum::<f64>();
    let area_px = std::f64::consts::PI * 2.0f64.powi(2);
    assert!((total(&picture.clipped) / area_px - 1.0).abs() < 0.02, "{}", total(&picture.clipped));
    assert!((total(&picture.hdr) / total(&picture.clipped) - 50.0).abs() < 1e-2);
}

#[test]
fn the_right_eye_sees_a_plane_shifted_by_focal_length_times_baseline_over_depth() {
    let (depth_m, baseline_m) = (2.0, 0.06);
    let view = View { width: 160, height: 60, focal_px: 400.0, camera_offset_m: 0.0 };
    let disparity_px = (view.focal_px * baseline_m / depth_m) as usize;
    assert_eq!(disparity_px, 12);
    let scene = Scene::mottled_wall(depth_m);
    let (left, depth) = pinhole(&scene, &view, 0.0, 4);
    let (right, _) = pinhole(&scene, &view.right_camera(baseline_m), 0.0, 4);
    assert!(depth.metres.iter().all(|z_m| (z_m - depth_m).abs() < 1e-5));
    let mut contrast = 0;
    for y in 0..60usize {
        for x in disparity_px..160 {
            let (l, r) = (left.rgb[3 * (160 * y + x)], right.rgb[3 * (160 * y + x - disparity_px)]);
            assert!(l.abs_diff(r) <= 1, "({x}, {y}): {l} and {r}");
            contrast = contrast.max(l.abs_diff(left.rgb[3 * (160 * y + disparity_px)]));
        }
    }
    assert!(contrast > 60, "a flat wall would prove nothing: {contrast}");
}

#[test]
fn the_portrait_loops_and_moves_between() {
    let scene = Scene::portrait();
    let view = View::new(96, 54);
    let (start, start_depth) = pinhole(&scene, &view, 0.0, 1);
    let (end, end_depth) = pinhole(&scene, &view, scene.period_s(), 1);
    assert_eq!(start, end);
    assert_eq!(start_depth, end_depth);
    let (middle, _) = pinhole(&scene, &view, 0.5 * scene.period_s(), 1);
    assert!(start.rgb.iter().zip(&middle.rgb).filter(|(a, b)| a.abs_diff(**b) > 30).count() > 200);
}

#[test]
fn threads_change_nothing() {
    let scene = Scene::portrait();
    let view = View::new(64, 37);
    let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
    scene.render_pinhole(&view, 0.3, 2, 5, &mut color, &mut depth);
    assert_eq!((color, depth), pinhole(&scene, &view, 0.3, 2));
    let points = lens_points(&of(Shape::Disc), 8);
    let lens = ThinLens { coc_at_infinity_px: 2.0, focus_m: scene.focus_m(), aperture: &points };
    let render = |threads| scene.render_thin_lens(&view, 0.3, &lens, threads);
    assert_eq!(render(1), render(3));
}

#[test]
fn the_subject_is_where_the_focus_is_and_something_is_in_front_and_behind() {
    let scene = Scene::portrait();
    let view = View::new(640, 360);
    let (_, depth) = pinhole(&scene, &view, 0.0, 1);
    assert!(depth.metres.iter().all(|z_m| (0.3..13.1).contains(z_m)), "the recording's format holds 13.1 m");
    let face = depth.metres[640 * 190 + 325];
    assert!((face - scene.focus_m()).abs() < 0.04, "{face}");
    let share = |low: f32, high: f32| {
        depth.metres.iter().filter(|z_m| (low..high).contains(*z_m)).count() as f32 / depth.metres.len() as f32
    };
    assert!(share(0.3, 0.7) > 0.05 && share(1.0, 1.5) > 0.1 && share(3.0, 13.0) > 0.3);
}

#[test]
fn empty_pictures_and_apertures_are_answered() {
    let scene = Scene::mottled_wall(1.0);
    let (color, depth) = pinhole(&scene, &View::new(0, 7), 0.0, 1);
    assert!(color.rgb.is_empty() && depth.metres.is_empty());
    let lens = ThinLens { coc_at_infinity_px: 2.0, focus_m: 1.0, aperture: &[] };
    let picture = scene.render_thin_lens(&View::new(4, 3), 0.0, &lens, 1);
    assert!(picture.hdr.rgb.iter().all(|light| *light == Vec3::ZERO));
}

#[test]
fn encoding_follows_the_srgb_formula() {
    assert_eq!([0.0, 1.0, 7.0, -1.0].map(encode_srgb), [0, 255, 255, 0]);
    // 0.0031308 is the end of the linear part; 0.21586 encodes to 128; NaN becomes black.
    assert_eq!([0.003_130_8, 0.215_860_5, f32::NAN].map(encode_srgb), [10, 128, 0]);
}

#[test]
fn a_bundled_frame_is_what_the_renderer_makes() {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/portrait");
    let (color, depth) = pinhole(&Scene::portrait(), &View::new(640, 360), 5.0 / 12.0, 16);
    let there = image::open(folder.join("rgb/000005.png")).expect("bundled picture").into_rgb8();
    assert_eq!(there.dimensions(), color.size());
    // Mathematical functions round differently on another machine: a thousandth of the values may be off.
    let off = there.iter().zip(&color.rgb).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    assert!(off * 1000 <= color.rgb.len(), "{off} bytes differ");
    let there = image::open(folder.join("depth/000005.png")).expect("bundled depth map").into_luma16();
    let off = there.iter().zip(&depth.metres).filter(|(a, z_m)| (f32::from(**a) - **z_m * 5000.0).abs() > 2.0).count();
    assert!(off * 1000 <= depth.metres.len(), "{off} depths differ");
}

fn pinhole(scene: &Scene, view: &View, time_s: f64, samples_per_pixel: u32) -> (ColorImage, DepthMap) {
    let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
    scene.render_pinhole(view, time_s, samples_per_pixel, 2, &mut color, &mut depth);
    (color, depth)
}
