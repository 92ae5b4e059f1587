//! The kernel's driver of USB webcams (`uvcvideo`): the webcam's name and formats, damaged pictures, dim light, and a webcam
//! that is unplugged and comes back.

use std::time::{Duration, Instant};

use bokehcam::frame::ColorImage;

use super::machine::{frame, run, until};
use super::webcam::{ISOCHRONOUS, NAME, SIZE, Webcam, read};

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_is_listed_by_its_name_and_plays_in_each_of_its_formats() {
    let webcam = Webcam::plug(&["--formats", "mjpeg:320x240:640x480,yuyv:320x240,nv12:320x240"]);
    let listed = run("devices").printed();
    let line = listed.lines().find(|line| line.contains(&format!("{}  ", webcam.node))).expect(&listed);
    assert!(line.contains(&format!("{NAME}  (uvcvideo")) && line.contains("USB 1209:0001, 480 Mbit/s"), "{line}");
    for fourcc in ["MJPG", "YUYV", "NV12"] {
        assert_eq!(read(&mut webcam.open(fourcc), 15, SIZE).corrupt, 0, "{fourcc}");
    }
    // Both are encoded from the same luma and chroma; between those of two blocks, chroma may be interpolated.
    let [yuyv, nv12] = ["YUYV", "NV12"].map(|fourcc| scene_colors(&frame(&mut webcam.open(fourcc)).0));
    assert!(yuyv.iter().flatten().zip(nv12.iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 2), "{yuyv:?} {nv12:?}");
}

/// Returns the colours of the generated scene: along the slope of grey at the top, and in the middle of the square, whose
/// position depends on the picture's number.
fn scene_colors(image: &ColorImage) -> Vec<[u8; 3]> {
    let pixel = |x_px: usize, y_px: usize| {
        let at = 3 * (y_px * image.size().0 as usize + x_px);
        [image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]]
    };
    let width_px = image.size().0 as usize;
    let is_red = |x_px: &usize| pixel(*x_px, 96)[0] > pixel(*x_px, 96)[2].saturating_add(60);
    let square: Vec<usize> = (0..width_px).filter(is_red).collect();
    assert!(square.len().abs_diff(64) <= 2, "the square is 64 pixels wide: {square:?}");
    let slope = (4..width_px).step_by(8).map(|x_px| pixel(x_px, 4));
    slope.chain([pixel(square[square.len() / 2], 96)]).collect()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn h264_is_named_passed_over_and_refused() {
    let webcam = Webcam::plug(&["--formats", "h264:320x240,mjpeg:320x240"]);
    let listed = run(&format!("devices {}", webcam.node)).printed();
    assert!(listed.contains("MJPG  320x240") && listed.contains("also H264, which cannot be read here"), "{listed}");
    run(&format!("stream {} --frames 3 --effect none --to null", webcam.node)).done();
    webcam.line_with("stream MJPEG 320x240");
    let asked = format!("stream {} --format H264 --frames 3 --to null", webcam.node);
    run(&asked).refused(1, &["H264 cannot be read here; choose --format from MJPG"]);
    drop(webcam);
    let webcam = Webcam::plug(&["--formats", "h264:320x240"]);
    let way_out = "let ffmpeg decode it: ffmpeg -f v4l2 -i NODE -f yuv4mpegpipe - | bokehcam stream -";
    run(&format!("stream {} --frames 3 --to null", webcam.node)).refused(1, &["it offers H264, but only", way_out]);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn damaged_pictures_are_counted_and_never_shown() {
    // The driver keeps back what it knows to be damaged, and raw pictures that are too short: only their numbers are missing.
    for (damage, fourcc, is_told) in
        [("--cut", "MJPG", true), ("--stray", "MJPG", true), ("--cut", "YUYV", false), ("--err", "MJPG", false)]
    {
        let webcam = Webcam::plug(&[damage, "5"]);
        let lost = read(&mut webcam.open(fourcc), 20, SIZE);
        let (count, other) = if is_told { (lost.corrupt, 0) } else { (lost.driver, lost.corrupt) };
        assert!(count >= 2 && other == 0, "{damage} {fourcc}: {lost:?}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_stalls_fails_or_is_unplugged_goes_on() {
    for endpoint in [&[][..], &[ISOCHRONOUS]] {
        let mut webcam = Webcam::plug(endpoint);
        let mut camera = webcam.open("MJPG");
        read(&mut camera, 5, SIZE);
        for (fails, mends) in [("stall", Some("go")), ("halt", None), ("unplug", Some("plug")), ("reset", None)] {
            webcam.say(fails);
            // Frames that were in flight still come.
            until("there are no frames", || super::machine::frame_now(&mut camera).is_none());
            mends.into_iter().for_each(|command| webcam.say(command));
            read(&mut camera, 5, SIZE);
        }
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_comes_back_without_the_format_is_taken_as_it_is() {
    let mut webcam = Webcam::plug(&["--replug-formats", "mjpeg:640x480"]);
    let mut camera = webcam.open("YUYV");
    read(&mut camera, 5, SIZE);
    webcam.say("unplug");
    until("there are no frames", || super::machine::frame_now(&mut camera).is_none());
    webcam.say("plug");
    // Scaled to the size that the frames had before.
    read(&mut camera, 5, SIZE);
    webcam.line_with("stream MJPEG 640x480");
}

/// The moments are spread over a picture's transfer, the pause before the next one, and the search for the camera.
#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_is_unplugged_at_any_moment_comes_back() {
    for endpoint in [&[][..], &[ISOCHRONOUS]] {
        let mut webcam = Webcam::plug(endpoint);
        let mut camera = webcam.open("MJPG");
        for round in 0_u64..15 {
            let began = Instant::now();
            let played = Duration::from_millis(round * 37 % 200);
            while began.elapsed() < played {
                super::machine::frame_now(&mut camera);
            }
            webcam.say("unplug");
            std::thread::sleep(Duration::from_millis(round * 61 % 300));
            webcam.say("plug");
            webcam.line_with("is /dev/video");
            read(&mut camera, 2, SIZE);
        }
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn as_many_frames_of_a_webcam_as_were_asked_for_are_delivered_however_many_are_damaged() {
    let webcam = Webcam::plug(&["--cut", "3"]);
    let mode = "--size 320x240 --format MJPG --effect none";
    let asked = format!("stream {} {mode} --frames 20 --to /tmp/asked.y4m --force", webcam.node);
    let said = run(&asked).done().to_owned();
    let (delivered, taken) = said.split_once("20 of ").expect(&said);
    assert!(!delivered.ends_with(|c: char| c.is_ascii_digit()), "{said}");
    let taken: u64 = taken.split(' ').next().unwrap().parse().unwrap();
    assert!(taken > 20 && said.contains(" damaged"), "{said}");
    // The file keeps its rate: where the camera was late, a picture is there twice.
    let frames = std::fs::read("/tmp/asked.y4m").unwrap().windows(6).filter(|bytes| bytes == b"FRAME\n").count();
    assert!(frames >= 20, "{frames}");
}

/// Most webcams expose longer in dim light, and keep promising the rate that was agreed on.
#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_gives_half_its_rate_is_named_as_the_cause() {
    let webcam = Webcam::plug(&["--drop", "2"]);
    let dim = format!("stream {} --size 320x240 --format MJPG --frames 45 --effect none --to null", webcam.node);
    let said = run(&dim).done().to_owned();
    assert!(said.contains("frames a second instead of 15"), "{said}");
}
