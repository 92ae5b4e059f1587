//! The program as a PipeWire filter that replaces a camera for other programs; needs WirePlumber 0.5 or later.

use std::process::Command;

use bokehcam::frame::ColorImage;

use super::program::run;
use super::readers::GStreamer;
use super::session::{PICTURES, Player, Run, graph, node, picture, state, until, yuyv};

/// Maximum mean error after another decoding and encoding, in codes.
const NEAR: f64 = 4.0;

fn mirrored(picture: &ColorImage) -> ColorImage {
    let mut mirrored = picture.clone();
    for row in mirrored.rgb.chunks_mut(3 * picture.width as usize) {
        row.as_chunks_mut::<3>().0.reverse();
    }
    mirrored
}

/// Returns the mean absolute difference between a frame and the nearest of several, in codes.
fn off(frame: &[u8], of: &[Vec<u8>]) -> f64 {
    let off = |other: &Vec<u8>| {
        let sum: u64 = frame.iter().zip(other).map(|(one, other)| u64::from(one.abs_diff(*other))).sum();
        sum as f64 / frame.len() as f64
    };
    of.iter().map(off).fold(f64::INFINITY, f64::min)
}

/// Whether the session manager supports filters; waits until it is ready for them.
fn has_filters() -> bool {
    let told = Command::new("wireplumber").arg("--version").output().unwrap().stdout;
    let told = String::from_utf8(told).unwrap();
    let version = told.split_whitespace().last().unwrap();
    let [major, minor] = [0, 1].map(|at| version.split('.').nth(at).unwrap().parse::<u32>().unwrap());
    let knows = (major, minor) >= (0, 5);
    if knows {
        let is_there = || graph().iter().any(|object| object["props"]["metadata.name"] == "filters");
        until("the manager's filters", || is_there().then_some(()));
    }
    knows
}

/// A reader of a camera gets the filter's pictures. Only the filter opens the camera, which is idle without readers.
/// After the filter's end, readers get the camera's own pictures.
#[test]
#[ignore = "needs PipeWire"]
fn who_asks_for_the_camera_is_given_the_filter() {
    let knows_filters = has_filters();
    let camera = Player::start("cam", &["--to", "pipewire:cam"]);
    let arguments = ["stream", "pipewire:cam", "--to", "filter", "--effect", "none", "--mirror"];
    let filter = Run::start(&arguments);
    if !knows_filters {
        let said = filter.refused();
        assert!(said.contains("use WirePlumber 0.5 or later"), "{said}");
        return;
    }
    until("the filter", || node("bokehcam.cam"));
    let is_at_rest = |name: &str| matches!(state(name)?.as_str(), "suspended" | "idle").then_some(());
    until("nobody to read", || is_at_rest("cam"));

    let own: Vec<Vec<u8>> = (0..PICTURES).map(|number| yuyv(&picture(number))).collect();
    let turned: Vec<Vec<u8>> = (0..PICTURES).map(|number| yuyv(&mirrored(&picture(number)))).collect();
    let reader = GStreamer::start("cam", 90);
    let frames = reader.end().frames;
    // The still card comes first.
    let first = frames.iter().position(|frame| off(frame, &turned) < NEAR).expect("a picture of the filter's");
    assert!(first < 60, "{first} frames before");
    for (at, frame) in frames.iter().enumerate() {
        assert!(off(frame, &own) > NEAR, "frame {at} is the camera's");
        assert!(at < first || off(frame, &turned) < NEAR, "frame {at} is nobody's");
    }
    until("nobody to read", || is_at_rest("cam"));

    let report = filter.end();
    assert!(report["pipewire"][0]["shown"].as_u64().unwrap() > 20, "{report}");
    until("no filter", || node("bokehcam.cam").is_none().then_some(()));
    let frames = GStreamer::start("cam", 60).end().frames;
    assert!(frames.iter().filter(|frame| own.contains(frame)).count() > 20, "the camera's own pictures");
    camera.end();
}

#[test]
fn a_filter_is_for_a_camera_as_pipewire_has_it() {
    for arguments in [&["demo", "--to", "filter"][..], &["pipewire:cam", "--to", "filter", "--to", "filter"]] {
        let ran = run(&[&["stream"], arguments].concat());
        assert!(ran.code == 2 && ran.stderr.starts_with("error: --to filter: "), "{}", ran.stderr);
    }
}
