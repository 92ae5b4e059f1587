//! Power management of USB webcams: one that sleeps while it is not used, one that forgets everything meanwhile, and programs
//! that are frozen, as at the beginning of the system's sleep.

use std::fs;

use super::machine::{HANG, beside, bokehcam, sh, until};
use super::webcam::{ISOCHRONOUS, SIZE, Webcam, read};

/// Has the webcam sleep soon after it was used, and waits until it does.
fn doze(webcam: &Webcam) {
    let power = webcam.usb().join("power");
    fs::write(power.join("autosuspend_delay_ms"), "100").unwrap();
    until("it sleeps", || fs::read_to_string(power.join("runtime_status")).unwrap().trim() == "suspended");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_sleeps_is_woken_with_its_controls() {
    // The flag b: it has to be reset when it wakes, and forgets its controls by that.
    for (quirk, endpoint) in [("", &[][..]), ("1209:0001:b", &[ISOCHRONOUS])] {
        sh(&format!("echo '{quirk}' > /sys/module/usbcore/parameters/quirks"));
        let webcam = Webcam::plug(endpoint);
        sh(&format!("v4l2-ctl -d {} -c brightness=40", webcam.node));
        webcam.line_with("set brightness 40");
        for _ in 0..2 {
            doze(&webcam);
            let mut camera = webcam.open("MJPG");
            assert_eq!(read(&mut camera, 5, SIZE).corrupt, 0);
            webcam.line_with("stream MJPEG 320x240");
            let brightness = sh(&format!("v4l2-ctl -d {} -C brightness", webcam.node));
            assert_eq!(brightness.trim(), "brightness: 40");
        }
    }
    sh("echo > /sys/module/usbcore/parameters/quirks");
}

/// Freezes all programs for a second, as the system's sleep does first.
fn freeze() {
    sh("echo 1 > /sys/module/suspend/parameters/pm_test_delay && echo freezer > /sys/power/pm_test && \
        echo freeze > /sys/power/state && echo none > /sys/power/pm_test");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn programs_that_were_frozen_go_on_with_the_webcam() {
    let webcam = Webcam::plug(&[ISOCHRONOUS]);
    // Enough that it still streams when a slow machine has frozen it twice.
    let asked = "--size 320x240 --format MJPG --frames 150 --effect none --to null";
    let stream = beside(bokehcam(&format!("stream {} {asked}", webcam.node)));
    webcam.line_with("stream MJPEG");
    freeze();
    freeze();
    let ran = stream.end(HANG);
    let over = webcam.line_with("stream over");
    let skipped: u64 = over.rsplit_once(" sent, ").unwrap().1.split(' ').next().unwrap().parse().unwrap();
    assert!(skipped >= 15, "it was frozen while it streamed: {over}");
    let warnings = ran.done().lines().filter(|line| line.starts_with("warning: ")).count();
    // At most a start of the stream and frames again for each, and a low rate.
    assert!(warnings <= 5, "{}", ran.stderr);
}
