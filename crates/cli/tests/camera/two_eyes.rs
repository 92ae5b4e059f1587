//! Two cameras as a stereo pair.

use bokehcam_live::v4l2::{Device, controls};

use super::machine::{HANG, Machine, Stream, VERSIONS, run, sh};

const RIGHT: &str = "/dev/video1";
/// Module arguments: two cameras, each with an HDMI input of 30 frames per second at any size.
const TWO: &str = "n_devs=2 node_types=0x1,0x1 num_inputs=2,2 input_types=0xc,0xc vid_cap_nr=0,1";

/// Loads two cameras of 30 frames per second.
fn machine() -> Machine {
    let machine = Machine::with(TWO, VERSIONS[0]);
    machine.at_30_fps();
    sh(&format!("v4l2-ctl -d {RIGHT} -i 1 && v4l2-ctl -d {RIGHT} --set-dv-bt-timings index=5"));
    controls::set_control(&Device::open(RIGHT.as_ref()).unwrap(), "osd_text_mode", "None").unwrap();
    machine
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn two_cameras_give_pairs_and_every_frame_is_accounted_for() {
    let _machine = machine();
    let stream = Stream::start("0,1 --rectified --size 320x180 --fps 30 --effect none --frames 60 --to null");
    let report = stream.report(false);
    let frames = &report["frames"];
    println!("{frames}");
    // A dropped frame leaves its partner unpaired; the number depends on the machine's speed.
    assert!((1..=60).contains(&frames["delivered"].as_u64().unwrap()), "{frames}");
    let source = report["source"].as_str().unwrap();
    assert!(source.contains("/dev/video0") && source.contains(RIGHT), "{source}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn their_depth_is_matched() {
    let _machine = machine();
    let stream = Stream::start("0,1 --rectified --max-disparity 16 --size 160x90 --fps 30 --frames 4 --to null");
    let report = stream.report(false);
    assert!(report["frames"]["delivered"].as_u64().unwrap() > 0, "{report}");
    assert!(report["stages_ms"]["depth"]["p50"].as_f64().unwrap() > 0.0, "{report}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn while_one_camera_is_away_its_partner_s_frames_are_unpaired_and_then_it_goes_on() {
    let _machine = machine();
    let mut stream = Stream::start("0,1 --rectified --size 320x180 --fps 30 --effect none --to -");
    let frames = stream.frames((320, 180));
    let come = |count: u32| (0..count).for_each(|_| frames.recv_timeout(HANG).expect("a frame"));
    come(5);
    controls::set_control(&Device::open(RIGHT.as_ref()).unwrap(), "disconnect", "1").unwrap();
    // More frames than can be in flight.
    come(40);
    drop(frames);
    let report = stream.report(true);
    let frames = &report["frames"];
    println!("{frames}");
    assert!(frames["dropped"]["unpaired"].as_u64().unwrap() > 0, "{frames}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn cameras_without_a_size_in_common_are_refused() {
    let _machine = machine();
    // A webcam's fixed sizes do not match the other camera's HDMI size.
    sh("v4l2-ctl -d /dev/video0 -i 0 && v4l2-ctl -d /dev/video0 --set-fmt-video width=640,height=360");
    let ran = run("stream 0,1 --rectified --effect none --size 333x177 --frames 3 --to null");
    assert!(ran.code != 0 && ran.stderr.contains("both cameras need the same size"), "{}", ran.stderr);
}
