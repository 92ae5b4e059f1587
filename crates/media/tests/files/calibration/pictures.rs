//! Pictures that are resampled by a map.

use bokehcam::calibration::StereoCalibration;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::frame::{ColorImage, GrayImage};
use glam::{DVec2, DVec3};

use super::{NONE, RADTAN, SIZE, rig};

/// Returns noise of a size.
fn noise((width, height): (u32, u32)) -> (ColorImage, GrayImage) {
    let mut bits = 1_u64;
    let mut byte = || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 56) as u8
    };
    let mut color = ColorImage::new(width, height);
    color.rgb.iter_mut().for_each(|value| *value = byte());
    let luma = (0..width * height).map(|_| byte()).collect();
    (color, GrayImage { width, height, luma })
}

/// Returns a rig whose pictures of `size` are already rectified.
fn rectified(size: (u32, u32)) -> StereoCalibration {
    let mut calibration = rig(NONE, 500.0, [0.0; 3]);
    for eye in &mut calibration.cameras {
        eye.size = Some(size);
        eye.focal_px = DVec2::splat(f64::from(size.0));
        eye.center_px = DVec2::new(f64::from(size.0), f64::from(size.1)) * 0.47;
    }
    calibration.translation_m = DVec3::new(-0.06, 0.0, 0.0);
    calibration
}

#[test]
fn a_rectified_pair_keeps_every_bit() {
    for size in [(2, 2), (3, 2), (2, 5), (65, 3), (128, 96), (333, 127)] {
        let rectifier = Rectifier::new(&rectified(size), size).unwrap();
        let ((color, gray), mut to_color, mut to_gray) = (noise(size), ColorImage::default(), GrayImage::default());
        rectifier.rectify_left(&color, &mut to_color);
        rectifier.rectify_right(&gray, &mut to_gray);
        assert_eq!(to_color, color, "{size:?}");
        assert_eq!(to_gray, gray, "{size:?}");
    }
}

#[test]
fn pixels_are_mixed_of_their_four_neighbours() {
    let rectifier = Rectifier::new(&rig(RADTAN, 460.0, [1.0, -2.0, 3.0]), SIZE).unwrap();
    let (color, gray) = noise(SIZE);
    let (mut to_color, mut to_gray) = (ColorImage::default(), GrayImage::default());
    rectifier.rectify_left(&color, &mut to_color);
    rectifier.rectify_right(&gray, &mut to_gray);
    let mixed = |side: usize, value: &dyn Fn(u32, u32) -> f64, x: u32, y: u32| {
        let p = rectifier.maps()[side].source_px(x, y).unwrap();
        let (left, top) = (p.x.floor().min(638.0), p.y.floor().min(478.0));
        let (part_x, part_y, left, top) = (p.x - left, p.y - top, left as u32, top as u32);
        let row = |y| value(left, y) * (1.0 - part_x) + value(left + 1, y) * part_x;
        row(top) * (1.0 - part_y) + row(top + 1) * part_y
    };
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let at = (y * SIZE.0 + x) as usize;
            let gray_value = |x: u32, y: u32| f64::from(gray.luma[(y * SIZE.0 + x) as usize]);
            // Weights are whole 256ths, and there is one rounding.
            assert!((f64::from(to_gray.luma[at]) - mixed(1, &gray_value, x, y)).abs() < 2.0);
            for channel in 0..3 {
                let value = |x: u32, y: u32| f64::from(color.rgb[(y * SIZE.0 + x) as usize * 3 + channel]);
                assert!((f64::from(to_color.rgb[at * 3 + channel]) - mixed(0, &value, x, y)).abs() < 2.0);
            }
        }
    }
}

#[test]
fn parts_make_the_whole() {
    let rectifier = Rectifier::new(&rig(RADTAN, 460.0, [1.0, -2.0, 3.0]), SIZE).unwrap();
    let (color, gray) = noise(SIZE);
    let (mut to_color, mut to_gray) = (ColorImage::default(), GrayImage::default());
    rectifier.rectify_left(&color, &mut to_color);
    rectifier.rectify_right(&gray, &mut to_gray);
    let [left, right] = rectifier.maps();
    let (mut parts_color, mut parts_gray) = (vec![1; 640 * 480 * 3], vec![1; 640 * 480]);
    for rows in [0..7, 7..8, 8..301, 301..480] {
        left.remap_color_rows(&color, rows.clone(), &mut parts_color[rows.start * 1920..rows.end * 1920]);
        right.remap_gray_rows(&gray, rows.clone(), &mut parts_gray[rows.start * 640..rows.end * 640]);
    }
    assert!(parts_color == to_color.rgb && parts_gray == to_gray.luma);
}

#[test]
fn what_no_eye_saw_is_black() {
    let mut calibration = rectified(SIZE);
    let mut given = *Rectifier::new(&calibration, SIZE).unwrap().rectification();
    // The window moves 100 pixels to the left and 50 up, beyond the picture.
    given.centers_px = given.centers_px.map(|center_px| center_px + DVec2::new(100.0, 50.0));
    calibration.stored_rectification = Some(given);
    let rectifier = Rectifier::new(&calibration, SIZE).unwrap();
    let white = ColorImage { rgb: vec![255; 640 * 480 * 3], width: 640, height: 480 };
    let mut seen = ColorImage::default();
    rectifier.rectify_left(&white, &mut seen);
    for (k, rgb) in (0..).zip(seen.rgb.as_chunks().0) {
        let is_inside = k % 640 >= 100 && k / 640 >= 50;
        assert_eq!(*rgb, if is_inside { [255; 3] } else { [0; 3] }, "pixel {k}");
    }
}
