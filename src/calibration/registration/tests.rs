use super::*;
use crate::calibration::Distortion;

const PINHOLE: Distortion = Distortion::RadialTangential([0.0; 8]);
const CAMERA: CameraIntrinsics = camera((80, 60), (70.0, 70.0), (39.5, 29.5), PINHOLE);

const fn camera(
    size: (u32, u32),
    (fx, fy): (f64, f64),
    (cx, cy): (f64, f64),
    distortion: Distortion,
) -> CameraIntrinsics {
    let (focal_px, center_px) = (DVec2::new(fx, fy), DVec2::new(cx, cy));
    CameraIntrinsics { size: Some(size), focal_px, center_px, distortion }
}

fn map(width: u32, height: u32, depth: impl Fn(f32, f32) -> f32) -> DepthMap {
    let metres = (0..width * height).map(|k| depth((k % width) as f32, (k / width) as f32)).collect();
    DepthMap { width, height, metres, ..DepthMap::default() }
}

fn registered(calibration: RgbdCalibration, from: &DepthMap) -> DepthMap {
    let (mut scratch, mut into) = Default::default();
    Registration::new(calibration, from.size()).unwrap().register(from, &mut scratch, &mut into);
    into
}

#[test]
fn one_camera_sees_what_it_saw() {
    let from = map(80, 60, |x, y| if (x + y) % 7.0 == 0.0 { 0.0 } else { 0.5 + 0.1 * x + 0.03 * y });
    let into = registered(RgbdCalibration::identity(CAMERA), &from);
    assert_eq!(into.size(), from.size());
    for (into, from) in into.metres.iter().zip(&from.metres) {
        assert!((into - from).abs() <= 1e-6 * from, "{into} {from}");
    }
    // Also with pictures of another size.
    let half = map(40, 30, |x, _| 1.0 + x);
    assert_eq!(registered(RgbdCalibration::identity(CAMERA), &half), half);
}

#[test]
fn a_slanted_plane_is_where_it_is_for_another_camera() {
    // As of a time-of-flight camera and of webcams with a wide and a fisheye lens.
    let rational = Distortion::RadialTangential([3.13, 2.32, 1e-4, -5e-5, 0.13, 3.46, 3.35, 0.66]);
    let wide = Distortion::RadialTangential([-0.28, 0.07, 2e-4, 1e-4, 0.0, 0.0, 0.0, 0.0]);
    let fisheye = Distortion::Equidistant([0.0034, 0.0007, -0.0020, 0.0002]);
    for (of_depth, of_color) in [(PINHOLE, PINHOLE), (rational, PINHOLE), (PINHOLE, wide), (rational, fisheye)] {
        check_slanted_plane(of_depth, of_color);
    }
}

fn check_slanted_plane(of_depth: Distortion, of_color: Distortion) {
    // The plane through (0, 0, 2) with this normal, both in the colour camera's space.
    let (point, normal) = (DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.3, -0.2, -1.0).normalize());
    let rotation = DMat3::from_rotation_y(0.08) * DMat3::from_rotation_x(-0.05) * DMat3::from_rotation_z(0.03);
    let translation_m = DVec3::new(0.06, -0.01, 0.02);
    let depth = camera((160, 120), (145.0, 146.0), (80.5, 59.0), of_depth);
    let color = camera((320, 180), (300.0, 300.0), (159.0, 91.0), of_color);
    let ray = |camera: &CameraIntrinsics, x: f32, y: f32| {
        camera.unproject(DVec2::new(x.into(), y.into()), camera.distortion.max_radius()).extend(1.0)
    };
    let from =
        map(160, 120, |x, y| ((point - translation_m).dot(normal) / (rotation * ray(&depth, x, y)).dot(normal)) as f32);
    let into = registered(RgbdCalibration { depth, color, rotation, translation_m }, &from);
    let out = color.resized(into.size());
    assert_eq!(into.size(), (156, 88), "as fine as the depth");
    let (mut known, mut inner) = (0, 0);
    for (k, &z_m) in into.metres.iter().enumerate() {
        let (x, y) = (k as u32 % into.width, k as u32 / into.width);
        // The part that both cameras see.
        let inside = (25..into.width - 25).contains(&x) && (18..into.height - 18).contains(&y);
        inner += u32::from(inside);
        if z_m > 0.0 {
            let exact_m = point.dot(normal) / ray(&out, x as f32, y as f32).dot(normal);
            // Tolerance: the slope of the plane within a pixel, or two with a lens.
            let tolerance_m = if of_color.is_none() { 0.012 } else { 0.02 };
            assert!((f64::from(z_m) - exact_m).abs() < tolerance_m, "{z_m} {exact_m} at {x}, {y}: {of_color:?}");
            known += u32::from(inside);
        }
    }
    assert_eq!(known, inner, "no gaps with {of_depth:?} and {of_color:?}");
}

#[test]
fn what_is_near_hides_what_is_behind_and_leaves_a_shadow() {
    let translation_m = DVec3::new(-0.1, 0.0, 0.0);
    let calibration = RgbdCalibration { translation_m, ..RgbdCalibration::identity(CAMERA) };
    let in_box = |x: f32, y: f32| (30.0..50.0).contains(&x) && (20.0..40.0).contains(&y);
    let from = map(80, 60, |x, y| if in_box(x, y) { 1.0 } else { 3.5 });
    let into = registered(calibration, &from);
    let at = |x: usize, y: usize| into.metres[y * 80 + x];
    // The box moves by 7 pixels, and the wall by 2.
    for y in 20..40 {
        assert!((23..43).all(|x| at(x, y) == 1.0), "row {y}");
        assert!((43..48).all(|x| at(x, y) == 0.0), "the shadow, row {y}");
        assert!((48..78).chain(0..23).all(|x| at(x, y) == 3.5), "row {y}");
    }
    assert!((0..78).all(|x| at(x, 10) == 3.5) && (78..80).all(|x| at(x, 10) == 0.0));
}

#[test]
fn a_surface_that_comes_nearer_has_no_gaps() {
    for z_m in [0.3, 0.5, 1.0, 2.7] {
        let calibration =
            RgbdCalibration { translation_m: DVec3::new(0.013, 0.007, -0.05), ..RgbdCalibration::identity(CAMERA) };
        let into = registered(calibration, &map(80, 60, |_, _| z_m));
        let inside = (10..50).flat_map(|y| (10..70).map(move |x| y * 80 + x));
        assert!(inside.into_iter().all(|k| (into.metres[k] - z_m + 0.05).abs() < 1e-5), "{z_m}");
    }
}

#[test]
fn a_camera_that_is_turned_about_its_axis_leaves_no_gaps() {
    for degrees in [3.0_f64, 20.0, 45.0, 90.0] {
        let rotation = DMat3::from_rotation_z(degrees.to_radians());
        let into =
            registered(RgbdCalibration { rotation, ..RgbdCalibration::identity(CAMERA) }, &map(80, 60, |_, _| 2.0));
        // What both see, however they are turned.
        let inside = |k: &usize| (k % 80).abs_diff(40).pow(2) + (k / 80).abs_diff(30).pow(2) < 27 * 27;
        assert!((0..80 * 60).filter(inside).all(|k| into.metres[k] == 2.0), "{degrees}");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let good = RgbdCalibration::identity(CAMERA);
    let refusal = |calibration: RgbdCalibration| Registration::new(calibration, (4, 2)).unwrap_err().to_string();
    for rotation in [DMat3::ZERO, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), DMat3::from_diagonal(DVec3::NAN)] {
        assert!(refusal(RgbdCalibration { rotation, ..good }).contains("rotation matrix"));
    }
    let translation_m = DVec3::new(50.0, 0.0, 0.0);
    assert!(refusal(RgbdCalibration { translation_m, ..good }).contains("metres"));
    let depth = CameraIntrinsics { focal_px: DVec2::ZERO, ..CAMERA };
    assert!(refusal(RgbdCalibration { depth, ..good }).contains("depth camera's fx"));
    for size in [None, Some((0, 60)), Some((80, 20_000))] {
        let color = CameraIntrinsics { size, ..CAMERA };
        assert!(refusal(RgbdCalibration { color, ..good }).contains("colour camera's width"));
    }
    let depth = CameraIntrinsics { size: Some((4000, 3000)), ..CAMERA };
    assert!(refusal(RgbdCalibration { depth, ..good }).contains("8 megapixels"));
    let color = CameraIntrinsics { center_px: DVec2::NAN, ..CAMERA };
    assert!(refusal(RgbdCalibration { color, ..good }).contains("cx and cy"));
    let color = CameraIntrinsics { distortion: Distortion::Equidistant([f64::NAN; 4]), ..CAMERA };
    assert!(refusal(RgbdCalibration { color, ..good }).contains("distortion"));
}

#[test]
fn odd_depths_lenses_and_sizes_do_no_harm() {
    // Polynomials that turn back at once, or have poles.
    let lenses = [
        PINHOLE,
        Distortion::RadialTangential([-9e3; 8]),
        Distortion::RadialTangential([0.0, 0.0, 9e3, -9e3, 0.0, -1.0, 0.0, 0.0]),
        Distortion::Equidistant([-5.0; 4]),
    ];
    for distortion in lenses {
        let camera = CameraIntrinsics { distortion, ..CAMERA };
        for from in [
            DepthMap::default(),
            map(1, 1, |_, _| 1.0),
            map(80, 60, |x, _| [f32::NAN, f32::INFINITY, -1.0, 1e-30, 1e30][x as usize % 5]),
        ] {
            let into = registered(RgbdCalibration::identity(camera), &from);
            assert!(into.metres.iter().all(|z_m| z_m.is_finite() && *z_m >= 0.0), "{distortion:?}");
        }
    }
}
