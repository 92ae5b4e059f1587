//! The check whether a pair is rectified, on synthetic and on real pictures.
#![allow(missing_docs)]

use std::path::PathBuf;

use bokehcam::calibration::StereoCalibration;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::depth::stereo::check::{PairCheck, Verdict, check_pair};
use bokehcam::frame::GrayImage;

const SIZE: (u32, u32) = (320, 240);

/// Returns smooth noise that depends on the position alone.
fn texture(x: f32, y: f32) -> f32 {
    let corner = |x: i32, y: i32| {
        let mut bits = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
        for _ in 0..2 {
            bits = (bits ^ (bits >> 15)).wrapping_mul(0x2C1B_3C6D);
            bits ^= bits >> 12;
        }
        (bits % 256) as f32
    };
    let octave = |x: f32, y: f32| {
        let (left, top) = (x.floor(), y.floor());
        let row = |y: i32| {
            let (a, b) = (corner(left as i32, y), corner(left as i32 + 1, y));
            a + (b - a) * (x - left)
        };
        row(top as i32) * (1.0 - (y - top)) + row(top as i32 + 1) * (y - top)
    };
    0.6 * octave(x / 5.0, y / 5.0) + 0.4 * octave(x / 17.0, y / 13.0)
}

/// Creates a picture whose pixel (x, y) shows the texture at `place(x, y)`.
fn picture(place: impl Fn(f32, f32) -> (f32, f32)) -> GrayImage {
    let (width, height) = SIZE;
    let pixels = (0..width * height).map(|k| ((k % width) as f32, (k / width) as f32));
    let luma = pixels.map(|(x, y)| place(x, y)).map(|(x, y)| texture(x, y) as u8).collect();
    GrayImage { width, height, luma }
}

/// Creates a pair with a disparity of `near_px` in the upper half and 3 pixels less below; the right picture is lower
/// by `down_px`.
fn pair(near_px: f32, down_px: f32) -> [GrayImage; 2] {
    let disparity_px = move |y: f32| if y < 120.0 { near_px } else { near_px - 3.0 };
    [picture(|x, y| (x, y)), picture(move |x, y| (x + disparity_px(y - down_px), y - down_px))]
}

fn checked([left, right]: &[GrayImage; 2]) -> PairCheck {
    check_pair(left, right, 64).unwrap()
}

#[test]
fn a_rectified_pair_is_one() {
    let found = checked(&pair(20.0, 0.0));
    assert!(found.matches > 60, "{found:?}");
    assert!(found.vertical_px.abs() < 0.05 && found.vertical_spread_px < 0.2, "{found:?}");
    assert_eq!((found.negative_fraction, found.verdict()), (0.0, Verdict::Rectified), "{found:?}");
    assert!((found.largest_px - 20.0).abs() < 0.5, "{found:?}");
}

#[test]
fn rows_are_measured_to_parts_of_a_pixel() {
    for down_px in [-13.0, -4.5, 1.25, 2.0, 7.75, 20.0] {
        let found = checked(&pair(20.0, down_px));
        assert!(found.matches > 40 && (found.vertical_px - down_px).abs() < 0.12, "{down_px}: {found:?}");
        let Verdict::Misaligned { px } = found.verdict() else { panic!("{down_px}: {found:?}") };
        assert!((px - down_px.abs()).abs() < 0.4, "{px} of {down_px}");
        assert!(found.verdict().to_string().contains("rows are off by up to"));
    }
}

#[test]
fn a_turned_picture_is_not_rectified_though_its_middle_is() {
    let left = picture(|x, y| (x, y));
    let right = picture(|x, y| (x + 10.0 + (y - 120.0) * 0.02, y - (x - 160.0) * 0.02));
    let found = checked(&[left, right]);
    assert!(found.vertical_px.abs() < 0.75 && matches!(found.verdict(), Verdict::Misaligned { .. }), "{found:?}");
}

#[test]
fn exchanged_eyes_are_seen() {
    let [left, right] = pair(20.0, 0.0);
    let found = checked(&[right, left]);
    assert_eq!((found.negative_fraction, found.verdict()), (1.0, Verdict::Swapped), "{found:?}");
    assert!(found.verdict().to_string().contains("swapped"));
}

#[test]
fn brightness_does_not_matter() {
    let [left, mut right] = pair(12.0, 0.0);
    right.luma.iter_mut().for_each(|luma| *luma = *luma / 2 + 20);
    let found = checked(&[left, right]);
    assert!(found.matches > 60 && found.verdict() == Verdict::Rectified, "{found:?}");
}

#[test]
fn where_nothing_is_nothing_is_said() {
    let flat = GrayImage { width: 320, height: 240, luma: vec![90; 320 * 240] };
    // Stripes look the same everywhere along the rows, and repeat every eight pixels.
    let stripes = picture(|x, _| (if x as u32 % 8 < 4 { 0.0 } else { 40.0 }, 0.0));
    let other = picture(|x, y| (y + 3000.0, x + 5000.0));
    let left = picture(|x, y| (x, y));
    for pair in [[flat.clone(), flat], [stripes.clone(), stripes], [left, other]] {
        let found = checked(&pair);
        assert!(matches!(found.verdict(), Verdict::Unclear { .. }), "{found:?}");
        assert!(found.verdict().to_string().contains("texture"));
    }
    for (width, height) in [(0, 0), (1, 1), (7, 300), (300, 3), (17, 17), (40, 40)] {
        let small = GrayImage { width, height, luma: vec![7; (width * height) as usize] };
        assert_eq!(check_pair(&small, &small, 256).unwrap(), PairCheck::default());
    }
}

#[test]
fn two_sizes_are_refused() {
    let [left, _] = pair(0.0, 0.0);
    let other = GrayImage { width: 160, height: 480, luma: left.luma.clone() };
    assert!(check_pair(&left, &other, 64).unwrap_err().to_string().contains("same size"));
}

fn data(path: &str) -> PathBuf {
    PathBuf::from(std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data")).join(path)
}

fn gray(path: &str) -> GrayImage {
    let image = image::open(data(path)).unwrap().to_luma8();
    GrayImage { width: image.width(), height: image.height(), luma: image.into_raw() }
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo, stereo_seq and calib"]
fn real_pairs() {
    let euroc = "stereo_seq/MicroEurocDataset/mav0/cam0/data/1403715276262142976.png";
    let frame = "stereo_seq/KITTI_sequence_1/image_l/000003.png";
    let rectified = [
        ("stereo/cones/im2.png".to_owned(), "stereo/cones/im6.png".to_owned()),
        ("stereo/motorcycle/motorcycle_left.png".into(), "stereo/motorcycle/motorcycle_right.png".into()),
        ("stereo/tsukuba/im3.png".into(), "stereo/tsukuba/im4.png".into()),
        ("stereo/terrace/im0.png".into(), "stereo/terrace/im1.png".into()),
        ("stereo/kitti2012/image_0/000002_10.png".into(), "stereo/kitti2012/image_1/000002_10.png".into()),
        ("stereo/kitti2012/image_0/000010_10.png".into(), "stereo/kitti2012/image_1/000010_10.png".into()),
        ("stereo/kitti2012/image_0/000031_10.png".into(), "stereo/kitti2012/image_1/000031_10.png".into()),
        ("stereo/kitti2012/image_0/000045_10.png".into(), "stereo/kitti2012/image_1/000045_10.png".into()),
        (frame.into(), frame.replace("image_l", "image_r")),
    ];
    for (left, right) in rectified {
        let [left, right] = [gray(&left), gray(&right)];
        let found = checked(&[left.clone(), right.clone()]);
        assert!(found.vertical_px.abs() < 0.5 && found.verdict() == Verdict::Rectified, "{found:?}");
        let exchanged = checked(&[right, left]);
        assert_eq!(exchanged.verdict(), Verdict::Swapped, "{exchanged:?}");
    }
    let raw = [(euroc.to_owned(), euroc.replace("cam0", "cam1"))];
    let boards = (1..=13).map(|k| (format!("calib/left{k:02}.jpg"), format!("calib/right{k:02}.jpg")));
    for (left, right) in raw.into_iter().chain(boards) {
        let found = checked(&[gray(&left), gray(&right)]);
        assert!(!matches!(found.verdict(), Verdict::Rectified | Verdict::Swapped), "{left}: {found:?}");
    }
}

/// Checks a pair after rectification.
fn rectified(calibration: &StereoCalibration, pair: [GrayImage; 2]) -> PairCheck {
    let rectifier = Rectifier::new(calibration, pair[0].size()).unwrap();
    let mut into = [GrayImage::default(), GrayImage::default()];
    for ((map, from), into) in rectifier.maps().iter().zip(&pair).zip(&mut into) {
        map.remap_gray(from, into);
    }
    check_pair(&into[0], &into[1], 160).unwrap()
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo_seq and calib"]
fn rectifying_makes_real_pairs_rectified() {
    let cameras = ["cam0", "cam1"].map(|eye| format!("stereo_seq/MicroEurocDataset/mav0/{eye}"));
    let sensors = cameras.each_ref().map(|camera| data(&format!("{camera}/sensor.yaml")));
    let euroc = bokehcam_calibration::load_calibration(&[&sensors[0], &sensors[1]]).unwrap();
    let found = rectified(&euroc, cameras.map(|camera| gray(&format!("{camera}/data/1403715276262142976.png"))));
    assert!(found.vertical_px.abs() < 0.3 && found.verdict() == Verdict::Rectified, "{found:?}");

    // The author's left camera stands on the right.
    let given =
        bokehcam_calibration::load_calibration(&[&data("calib/intrinsics.yml")]).unwrap().with_swapped_cameras();
    for rig in [given, StereoCalibration { stored_rectification: None, ..given }] {
        let boards = [6, 9, 12].map(|k| [format!("calib/right{k:02}.jpg"), format!("calib/left{k:02}.jpg")]);
        for board in boards {
            let found = rectified(&rig, board.each_ref().map(|path| gray(path)));
            assert!(found.matches > 10 && found.vertical_px.abs() < 0.5, "{board:?}: {found:?}");
            assert!(!matches!(found.verdict(), Verdict::Misaligned { .. } | Verdict::Swapped), "{board:?}: {found:?}");
        }
    }
}
