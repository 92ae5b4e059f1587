//! The camera is closed while nobody watches.

use std::path::Path;
use std::time::{Duration, Instant};

use bokehcam::v4l2::holders::holders;

use super::machine::{BARS, CAMERA, Machine, Stream, VERSIONS, VIRTUAL, distance_from, frame, open, until, wish};

fn camera_is_open() -> bool {
    !holders(Path::new(CAMERA)).is_empty()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn the_camera_is_open_only_while_somebody_watches() {
    for version in VERSIONS {
        let machine = Machine::new();
        machine.loopback(version);
        machine.at_30_fps();
        let stream = Stream::show("0 --size 320x180 --fps 30 --effect none --on-demand");
        for turn in 0..3 {
            until("nobody watches: the camera is closed", Duration::from_secs(6), || !camera_is_open());
            // Both buffers hold the card by then: what was last seen of the camera is for nobody.
            std::thread::sleep(Duration::from_millis(2500));
            assert!(!camera_is_open());
            let began = Instant::now();
            let mut reader = open(VIRTUAL, wish((320, 180), 30.0, Some("YUYV".parse().unwrap())));
            let mut cards = 0;
            while distance_from(&frame(&mut reader).0, &BARS, 4) > 5 {
                cards += 1;
                assert!(began.elapsed() < Duration::from_secs(5), "{version}: only cards");
            }
            let took = began.elapsed();
            println!("{version}, {turn}: the camera's picture after {} ms, {cards} cards before", took.as_millis());
            // The goal, on an emulated processor that others use as well.
            assert!(cards > 0, "{version}: an old picture of the camera");
            assert!(took < Duration::from_millis(500), "{version}: {took:?}");
            assert!(camera_is_open());
            drop(reader);
        }
        until("the last one has gone", Duration::from_secs(6), || !camera_is_open());
        let report = stream.report(true);
        assert_eq!(report["frames"]["dropped"]["corrupt"], 0);
    }
}
