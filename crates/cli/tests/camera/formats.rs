//! Decoding of each format of the camera.

use bokehcam_live::layout::Content;
use bokehcam_live::v4l2::modes::{QueueKind, list_modes};
use bokehcam_live::v4l2::{Device, FourCc};

use super::machine::{BARS, CAMERA, Machine, distance_from, frame, open, run, wish};

const SIZE: (u32, u32) = (320, 180);
/// Rounding error of 8-bit YCbCr with limited range, in RGB codes.
const STEP: u8 = 3;
/// Chroma interpolation mixes colours at the bars' edges.
const MARGIN_PX: u32 = 3;

/// Returns the camera's colour formats on a kind of queue, in the driver's order.
fn offered(queue: QueueKind) -> Vec<FourCc> {
    let modes = list_modes(&Device::open(CAMERA.as_ref()).unwrap()).unwrap();
    assert!(modes.iter().all(|mode| mode.queue == queue));
    modes.iter().map(|mode| mode.fourcc).filter(|fourcc| fourcc.content() == Some(Content::Color)).collect()
}

fn check(fourcc: FourCc) {
    let name = fourcc.to_string();
    let mut camera = open(CAMERA, wish(SIZE, 60.0, Some(fourcc)));
    let (first, _) = frame(&mut camera);
    let (second, _) = frame(&mut camera);
    assert_eq!(first.size(), SIZE, "{name}");
    assert!(first.rgb == second.rgb, "{name}: two frames of a picture that stands still");
    let luma_only = first.rgb.chunks_exact(3).all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]);
    let greys = BARS.map(|[r, g, b]| {
        // The driver computes grey by BT.709.
        let luma = 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        [luma.round() as u8; 3]
    });
    let bars = if luma_only { &greys } else { &BARS };
    let step = distance_from(&first, bars, MARGIN_PX);
    // Formats with five bits per channel have coarser steps.
    let coarse = match name.as_str() {
        "RGBP" | "RGBR" | "RGBO" | "AR15" | "XR15" => 5,
        _ => STEP,
    };
    assert!(step <= coarse, "{name}: {step} codes from the picture");
    assert_eq!(luma_only, matches!(name.as_str(), "GREY" | "Y10" | "Y12" | "Y16" | "Y16-BE"), "{name}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn every_format_gives_the_cameras_picture() {
    let _machine = Machine::new();
    let offered = offered(QueueKind::SinglePlanar);
    let names: Vec<String> = offered.iter().map(ToString::to_string).collect();
    for needed in ["YUYV", "UYVY", "NV12", "YU12", "RGB3", "BGR3", "GREY"] {
        assert!(names.iter().any(|name| name == needed), "{needed} is not among {names:?}");
    }
    offered.into_iter().for_each(check);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_camera_of_several_planes_gives_the_same_picture() {
    let _machine =
        Machine::with("n_devs=1 node_types=0x1 num_inputs=1 input_types=0x0 multiplanar=2 vid_cap_nr=0", "0.12.7");
    let offered = offered(QueueKind::MultiPlanar);
    let names: Vec<String> = offered.iter().map(ToString::to_string).collect();
    for needed in ["YUYV", "NV12", "NM12", "YM12"] {
        assert!(names.iter().any(|name| name == needed), "{needed} is not among {names:?}");
    }
    offered.into_iter().for_each(check);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn what_the_camera_cannot_do_is_refused_or_said() {
    let _machine = Machine::new();
    run("stream 0 --to null --frames 1 --format MJPG").refused(1, &["MJPG", "YUYV"]);

    let near = run("stream 0 --to null --frames 1 --effect none --size 500x400");
    assert!(near.done().contains("does not support the requested mode"), "{}", near.stderr);
}
