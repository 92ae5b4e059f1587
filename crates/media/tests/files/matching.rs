//! The accuracy of the stereo matcher on pairs with ground truth.

use std::path::{Path, PathBuf};

use bokehcam::compute::Backend;
use bokehcam::depth::stereo::{Effort, Pair, Settings, create};
use bokehcam::frame::{DisparityMap, GrayImage};
use bokehcam_media::recording::still::{read_color, read_disparity};

fn matched([left, right]: &[GrayImage; 2], disparities: u32, effort: Effort) -> DisparityMap {
    let mut map = DisparityMap::default();
    create(&Settings { size: left.size(), disparities, effort, threads: 2 }, Backend::Cpu, None)
        .expect("the CPU can be had")
        .compute_disparity(Pair { left, color: None, right }, &mut map)
        .expect("a pair of one size");
    map
}

/// Returns the percentage of pixels with ground truth whose disparity is off by more than 2 px.
fn bad_2(map: &DisparityMap, truth: &DisparityMap) -> f32 {
    assert_eq!(map.size(), truth.size());
    let known: Vec<_> = map.px.iter().zip(&truth.px).filter(|(_, t)| t.is_finite() && **t > 0.0).collect();
    assert!(known.len() > 1000, "there is a truth");
    100.0 * known.iter().filter(|(d, t)| (*d - *t).abs() > 2.0).count() as f32 / known.len() as f32
}

fn luma(path: &Path) -> GrayImage {
    let mut gray = GrayImage::default();
    gray.set_luma_from(&read_color(path).expect("a picture"));
    gray
}

#[test]
fn the_bundled_recording_is_matched_as_well_as_ever() {
    let recording = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/stereo");
    for (effort, most) in [(Effort::Full, 13.5), (Effort::Fast, 20.0)] {
        let eyes = ["image_2", "image_3"].map(|eye| luma(&recording.join(eye).join("000008.png")));
        let truth = read_disparity(&recording.join("disp/000008.png")).expect("the truth");
        let bad = bad_2(&matched(&eyes, 96, effort), &truth);
        assert!(bad < most, "{effort:?}: bad-2.0 is {bad} %");
    }
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo"]
fn real_pairs_are_matched_as_well_as_ever() {
    let data = PathBuf::from(std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data"));
    let cases = [
        (
            "motorcycle/motorcycle_left.png",
            "motorcycle/motorcycle_right.png",
            "motorcycle/motorcycle_disp.pfm",
            64,
            8.0,
        ),
        ("terrace/im0.png", "terrace/im1.png", "terrace/disp0.pfm", 32, 2.5),
        (
            "kitti2012/image_0/000010_10.png",
            "kitti2012/image_1/000010_10.png",
            "kitti2012/disp_noc/000010_10.png",
            128,
            6.5,
        ),
        (
            "kitti2012/image_0/000002_10.png",
            "kitti2012/image_1/000002_10.png",
            "kitti2012/disp_noc/000002_10.png",
            128,
            8.5,
        ),
    ];
    for (left, right, truth, disparities, most) in cases {
        let [left, right, truth] = [left, right, truth].map(|path| data.join("stereo").join(path));
        let eyes = [luma(&left), luma(&right)];
        let bad = bad_2(&matched(&eyes, disparities, Effort::Full), &read_disparity(&truth).expect("a truth"));
        assert!(bad < most, "{}: bad-2.0 is {bad} %", left.display());
    }
}
