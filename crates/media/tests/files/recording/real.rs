//! Pictures from real cameras, where available.

use std::path::{Path, PathBuf};

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::{Options, Recording, Scratch, StereoGeometry};

use super::{color_of, depth_of, right_of};

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with rgbd/person_turning"]
fn a_person_turning_before_a_wall() {
    let data = std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data");
    let options = Options { depth_scale: Some(1000.0), ..Options::default() };
    let recording = Recording::open(&Path::new(&data).join("rgbd/person_turning"), &options).unwrap();
    assert_eq!((recording.len(), recording.size(), recording.has_depth()), (40, (640, 480), true));
    assert!((33_333_000..=33_334_000).contains(&recording.period_ns()), "{} ns", recording.period_ns());

    let (mut scratch, mut color, mut depth) = (Scratch::default(), ColorImage::default(), DepthMap::default());
    for index in 0..recording.len() {
        recording.read_color(index, &mut scratch, &mut color).unwrap();
        recording.read_depth(index, &mut scratch, &mut depth).unwrap();
        assert_eq!((color.size(), depth.size()), ((640, 480), (640, 480)));

        let mut known: Vec<f32> = depth.metres.iter().copied().filter(|&metres| DepthMap::is_known(metres)).collect();
        known.sort_unstable_by(f32::total_cmp);
        // A quarter is unknown, in some frames more; the person is at 0.8 m, the wall at 2.7 m.
        let unknown = 1.0 - known.len() as f32 / depth.metres.len() as f32;
        assert!((0.25..0.45).contains(&unknown), "frame {index}: {unknown} unknown");
        let (near_m, far_m) = (known[known.len() / 100], known[known.len() * 95 / 100]);
        assert!((0.5..1.2).contains(&near_m) && (2.3..3.0).contains(&far_m), "frame {index}: {near_m} to {far_m} m");
    }
}

fn data(folder: &str) -> PathBuf {
    let data = std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data");
    Path::new(&data).join(folder)
}

fn open(folder: &str) -> Recording {
    Recording::open(&data(folder), &Options::default()).unwrap()
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo and stereo_seq"]
fn sequences_of_two_eyes() {
    let kitti = open("stereo_seq/KITTI_sequence_1");
    assert_eq!((kitti.layout(), kitti.len(), kitti.size(), kitti.period_ns()), ("KITTI", 20, (1226, 370), 100_000_000));
    let Some(StereoGeometry::Rectified(rig)) = kitti.stereo_geometry() else { panic!("{:?}", kitti.stereo_geometry()) };
    assert!((rig.focal_px - 707.091).abs() < 1e-3 && (rig.baseline_m - 0.537).abs() < 1e-3, "{rig:?}");

    let euroc = open("stereo_seq/MicroEurocDataset");
    assert_eq!((euroc.layout(), euroc.len(), euroc.size()), ("EuRoC/ASL", 6, (752, 480)));
    // Times come from the names of the pictures: there is no list.
    assert_eq!((euroc.time_ns(1), euroc.time_ns(5)), (50_000_128, 250_000_128));
    let Some(StereoGeometry::Raw(calibration)) = euroc.stereo_geometry() else {
        panic!("{:?}", euroc.stereo_geometry())
    };
    assert!((calibration.translation_m.length() - 0.110).abs() < 1e-3, "{calibration:?}");
    assert_eq!(right_of(&euroc, 5).unwrap().size(), (752, 480));

    // Single scenes: those of the first one's size, of which all can be read.
    let scenes = open("stereo/kitti2012");
    assert_eq!((scenes.len(), scenes.stereo_geometry()), (4, Some(&StereoGeometry::Uncalibrated)));
    (0..4).for_each(|index| color_of(&scenes, index).map(drop).unwrap());

    for index in 0..kitti.len() {
        color_of(&kitti, index).unwrap();
        assert_eq!(right_of(&kitti, index).unwrap().size(), kitti.size());
    }
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo"]
fn pairs_with_and_without_a_calibration() {
    let terrace = open("stereo/terrace");
    assert_eq!((terrace.layout(), terrace.disparity_count()), ("Middlebury stereo", None));
    assert_eq!(right_of(&terrace, 0).unwrap().size(), (713, 434));
    let mut known: Vec<f32> = depth_of(&terrace, 0).unwrap().metres;
    known.retain(|metres| *metres > 0.0);
    // A terrace, measured by a laser: half of the pixels, from 1.5 to 30 m.
    assert!((0.5..0.56).contains(&(known.len() as f32 / (713.0 * 434.0))), "{}", known.len());
    assert!(known.iter().all(|metres| (1.0..100.0).contains(metres)));
    assert_eq!(open("stereo/cones").stereo_geometry(), Some(&StereoGeometry::Uncalibrated));
}
