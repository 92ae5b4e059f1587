//! Isochronous transfers of USB webcams: bandwidth that is reserved, or lacks, and packets that are lost.

use bokehcam_live::v4l2::FourCc;
use rustix::process::Signal;

use super::machine::{HANG, beside, bokehcam, frame_now, open, run, until, wish};
use super::webcam::{ISOCHRONOUS, NAME, SIZE, Webcam, read};

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn an_isochronous_webcam_plays_in_each_of_its_formats_and_sizes() {
    let webcam = Webcam::plug(&[ISOCHRONOUS, "--formats", "mjpeg:320x240:640x480,yuyv:320x240:640x480,nv12:320x240"]);
    // Each takes another alternate setting, up to two packets in a microframe.
    for (fourcc, size) in [("MJPG", SIZE), ("MJPG", (640, 480)), ("YUYV", SIZE), ("YUYV", (640, 480)), ("NV12", SIZE)] {
        let fourcc: FourCc = fourcc.parse().unwrap();
        let lost = read(&mut open(NAME, wish(size, 15.0, Some(fourcc))), 8, size);
        assert_eq!(lost.corrupt, 0, "{fourcc}");
        webcam.line_with(&format!("{}x{} at 15.00", size.0, size.1));
        webcam.line_with("stream over (setting 0)");
    }
}

/// The driver keeps back a picture that lacks a packet, and only its number is missing; newer ones hand it on and mark it.
#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn pictures_with_lost_packets_are_counted_and_never_shown() {
    for parameter in ["nodrop=0", "nodrop=1"] {
        let webcam = Webcam::plug_with(parameter, &[ISOCHRONOUS, "--lose", "5"]);
        for fourcc in ["MJPG", "YUYV"] {
            let lost = read(&mut webcam.open(fourcc), 20, SIZE);
            let (count, other) = if parameter == "nodrop=1" { (lost.corrupt, 0) } else { (lost.driver, lost.corrupt) };
            assert!(count >= 3 && other == 0, "{parameter} {fourcc}: {lost:?}");
        }
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_bus_without_bandwidth_is_told_with_a_way_out() {
    let formats = ["--formats", "mjpeg:320x240:640x480,yuyv:320x240:640x480"];
    let mut webcam = Webcam::plug(&[&[ISOCHRONOUS, "--bandwidth", "1024"], &formats[..]].concat());
    let node = webcam.node.clone();
    let stream = |mode: &str| format!("stream {node} --effect none --to null {mode}");
    let told = "not enough USB bandwidth to start; choose --format MJPG, a smaller --size or a lower --fps, or plug the camera";
    run(&stream("--size 640x480 --format YUYV --frames 5")).refused(1, &[told]);
    webcam.line_with("no bandwidth for 2048 bytes");
    // The ways out.
    for mode in ["--size 640x480 --format MJPG", "--size 320x240 --format YUYV"] {
        run(&stream(&format!("{mode} --frames 5"))).done();
    }
    // Another camera takes the bandwidth while this one is away.
    let mut camera = webcam.open("YUYV");
    read(&mut camera, 3, SIZE);
    for command in ["unplug", "bandwidth 100", "plug"] {
        webcam.say(command);
    }
    until("it is refused", || {
        frame_now(&mut camera);
        webcam.lines_with("no bandwidth") > 0
    });
    webcam.say("bandwidth 1024");
    read(&mut camera, 5, SIZE);
    drop(camera);
    // Not to be taken for lines of what follows.
    webcam.lines_with("");
    // It takes the bandwidth while this one stalls: starting the stream again is refused, then opening it.
    let program = beside(bokehcam(&stream("--size 320x240 --format YUYV")));
    webcam.line_with("stream YUYV 320x240");
    ["bandwidth 100", "stall"].iter().for_each(|command| webcam.say(command));
    (0..2).for_each(|_| drop(webcam.line_with("no bandwidth")));
    let said = program.end_by(Signal::INT, HANG).stderr;
    assert!(said.contains(told) && !said.contains("STREAMON"), "{said}");
}
