//! Camera faults: each fault that the test camera can inject is counted or recovered from.

use std::time::Instant;

use bokehcam_live::capture::v4l2::V4l2Camera;

use super::machine::{
    BARS, CAMERA, Lost, Machine, Stream, VIRTUAL, distance_from, frame, open, sh, stamped, until, wish,
};

const SIZE: (u32, u32) = (320, 180);

fn camera() -> V4l2Camera {
    open(CAMERA, wish(SIZE, 60.0, Some("YUYV".parse().unwrap())))
}

/// Reads `frames` frames; asserts that all are intact, and returns the losses.
fn read(camera: &mut V4l2Camera, frames: usize) -> Lost {
    let mut lost = Lost::default();
    for _ in 0..frames {
        let (image, before) = frame(camera);
        lost.add(before);
        assert!(distance_from(&image, &BARS, 3) <= 3);
    }
    lost
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn frames_that_the_driver_marks_as_damaged_are_counted_one_by_one() {
    let machine = Machine::new();
    let mut camera = camera();
    let mut lost = read(&mut camera, 10);
    for _ in 0..5 {
        machine.control("inject_v4l2_buf_flag_error", "1");
        lost.add(read(&mut camera, 5));
    }
    lost.add(read(&mut camera, 5));
    assert_eq!(lost.corrupt, 5, "{lost:?}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn frames_that_the_driver_drops_are_counted() {
    let machine = Machine::new();
    machine.control("percentage_of_dropped_buffers", "50");
    let mut camera = camera();
    read(&mut camera, 5);
    // For each frame, its index, counting lost ones, and its capture time.
    let (mut lost, mut came) = (Lost::default(), Vec::new());
    for frame in 0..120 {
        let (image, taken_ns, before) = stamped(&mut camera);
        lost.add(before);
        assert!(distance_from(&image, &BARS, 3) <= 3);
        came.push((frame + lost.driver + lost.evicted, taken_ns as f64 / 1e9));
    }
    // The driver's clock and the loss counter must agree on the number of frames. A delayed driver is late with some
    // frames and never early, so the minimum delay of each half is compared.
    let late_s = |frames: &[(u64, f64)]| {
        frames.iter().map(|(number, taken_s)| taken_s - *number as f64 / 60.0).fold(f64::INFINITY, f64::min)
    };
    let due_s = (came[119].0 - came[0].0) as f64 / 60.0;
    let off_s = late_s(&came[60..]) - late_s(&came[..60]);
    assert!(off_s.abs() < 0.1 * due_s, "{off_s} s off where {due_s} were due: {lost:?}");
    // The driver drops more than requested if the program is late in returning buffers.
    let share = lost.driver as f64 / (120 + lost.driver + lost.evicted) as f64;
    println!("{share:.2} dropped: {lost:?}");
    assert!(share > 0.3, "{share} dropped: {lost:?}");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_buffer_that_is_refused_once_does_not_stop_the_stream() {
    let machine = Machine::new();
    let mut camera = camera();
    let timed = |camera: &mut V4l2Camera| {
        let began = Instant::now();
        read(camera, 60);
        began.elapsed()
    };
    let before = timed(&mut camera);
    // More refusals than buffers: if each lost its buffer, no more frames would arrive.
    for _ in 0..8 {
        machine.control("inject_vidioc_qbuf_error", "1");
        read(&mut camera, 5);
    }
    println!("60 frames took {before:?} before, and {:?} after", timed(&mut camera));
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_start_that_fails_once_is_tried_again_or_said() {
    let machine = Machine::new();
    for control in ["inject_vidioc_streamon_error", "inject_vidioc_reqbufs_error"] {
        machine.control(control, "1");
        let first = V4l2Camera::open(CAMERA, wish(SIZE, 60.0, None), Vec::new(), None);
        let mut camera = match first {
            Ok(camera) => camera,
            Err(error) => {
                let said = error.to_string();
                assert!(
                    said.contains(CAMERA) && said.contains("cannot be started") && said.lines().count() == 1,
                    "{said}"
                );
                camera()
            }
        };
        read(&mut camera, 10);
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_start_that_fails_after_a_fault_is_tried_again() {
    let machine = Machine::new();
    let mut camera = camera();
    read(&mut camera, 5);
    for control in ["inject_vidioc_streamon_error", "inject_vidioc_reqbufs_error"] {
        machine.control(control, "1");
        machine.control("inject_fatal_streaming_error", "1");
        let began = Instant::now();
        // Frames in flight are still intact.
        let lost = read(&mut camera, 30);
        println!("{control}: 30 frames after {:?}, {lost:?}", began.elapsed());
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_fatal_error_is_recovered_from() {
    let machine = Machine::new();
    let mut camera = camera();
    for _ in 0..3 {
        read(&mut camera, 5);
        machine.control("inject_fatal_streaming_error", "1");
        let began = Instant::now();
        let lost = read(&mut camera, 20);
        println!("20 frames after {:?}, {lost:?}", began.elapsed());
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_camera_that_was_disconnected_comes_back() {
    let machine = Machine::new();
    let mut camera = camera();
    for _ in 0..2 {
        read(&mut camera, 5);
        machine.control("disconnect", "1");
        let began = Instant::now();
        let lost = read(&mut camera, 20);
        println!("20 frames after {:?}, {lost:?}", began.elapsed());
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn the_output_goes_on_while_the_camera_is_unplugged() {
    let machine = Machine::new();
    machine.at_30_fps();
    let stream = Stream::show("0 --size 320x180 --fps 30 --effect none");
    let mut reader = open(VIRTUAL, wish(SIZE, 30.0, Some("YUYV".parse().unwrap())));
    until("the camera's picture", || distance_from(&frame(&mut reader).0, &BARS, 4) <= 5);
    for _ in 0..2 {
        sh("echo vivid.0 > /sys/bus/platform/drivers/vivid/unbind");
        until("the node is gone", || !std::path::Path::new(CAMERA).exists());
        for _ in 0..8 {
            assert!(distance_from(&frame(&mut reader).0, &BARS, 4) <= 5, "the last picture");
        }
        sh("echo vivid.0 > /sys/bus/platform/drivers/vivid/bind");
        // Different colours prove that the camera is back.
        until("the node is back", || std::path::Path::new(CAMERA).exists());
        machine.control("osd_text_mode", "None");
        machine.control("test_pattern", "100% White");
        let white = |image: &bokehcam::frame::ColorImage| image.rgb.iter().all(|code| *code > 240);
        until("the camera's new picture", || white(&frame(&mut reader).0));
        machine.control("test_pattern", "75% Colorbar");
        until("and the old one", || distance_from(&frame(&mut reader).0, &BARS, 4) <= 5);
    }
    let report = stream.report(true);
    assert!(report["repeats"].as_u64().unwrap() >= 8, "{report}");
}
