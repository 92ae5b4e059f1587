//! The camera is closed while the virtual camera has no reader.

use std::path::Path;
use std::time::{Duration, Instant};

use bokehcam_live::v4l2::holders::list_holders;

use super::machine::{BARS, CAMERA, Machine, Stream, VERSIONS, VIRTUAL, distance_from, frame, open, until, wish};
use super::webcam::{ISOCHRONOUS, SIZE, Webcam};

fn camera_is_open() -> bool {
    !list_holders(Path::new(CAMERA)).is_empty()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn the_camera_is_open_only_while_somebody_watches() {
    for version in VERSIONS {
        let machine = Machine::new();
        machine.loopback(version);
        machine.at_30_fps();
        let stream = Stream::show("0 --size 320x180 --fps 30 --effect none --on-demand");
        for turn in 0..4 {
            until("nobody watches: the camera is closed", || !camera_is_open());
            // By then, both buffers hold the card. The camera's picture changes, so that a stale frame would be
            // detected.
            std::thread::sleep(Duration::from_millis(2500));
            machine.control("test_pattern", if turn % 2 == 0 { "100% White" } else { "75% Colorbar" });
            assert!(!camera_is_open());
            let (bars, white) = (
                |image: &_| distance_from(image, &BARS, 4) <= 5,
                |image: &_| distance_from(image, &[[255; 3]; 8], 0) <= 5,
            );
            let began = Instant::now();
            let mut reader = open(VIRTUAL, wish((320, 180), 30.0, Some("YUYV".parse().unwrap())));
            let mut cards = 0;
            loop {
                let image = frame(&mut reader).0;
                let (new, old) =
                    if turn % 2 == 0 { (white(&image), bars(&image)) } else { (bars(&image), white(&image)) };
                assert!(!old, "{version}, {turn}: an old picture of the camera");
                if new {
                    break;
                }
                cards += 1;
                assert!(cards < 10_000, "{version}: only cards");
            }
            println!("{version}, {turn}: the camera's picture after {:?}, {cards} cards before", began.elapsed());
            assert!(camera_is_open());
            drop(reader);
        }
        until("the last one has gone", || !camera_is_open());
        let report = stream.report(true);
        assert_eq!(report["frames"]["dropped"]["corrupt"], 0);
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_streams_only_while_somebody_watches() {
    let webcam = Webcam::plug(&[ISOCHRONOUS]);
    webcam.machine.loopback(VERSIONS[0]);
    let asked = format!("{} --size 320x240 --format MJPG --effect none --on-demand", webcam.node);
    let stream = Stream::show(&asked);
    webcam.line_with("stream MJPEG");
    webcam.line_with("stream over");
    for turn in 0..2 {
        std::thread::sleep(Duration::from_millis(700));
        assert_eq!(webcam.lines_with("stream"), 0, "{turn}: it streams for nothing");
        let mut reader = open(VIRTUAL, wish(SIZE, 15.0, Some("YUYV".parse().unwrap())));
        webcam.line_with("stream MJPEG");
        for _ in 0..10 {
            frame(&mut reader);
        }
        assert_eq!(webcam.lines_with("stream"), 0, "{turn}: once for each reader");
        drop(reader);
        webcam.line_with("stream over");
    }
    stream.report(true);
}
