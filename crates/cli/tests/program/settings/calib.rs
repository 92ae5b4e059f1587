//! `--calib` has the same meaning in every command.

use std::fs;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::{read_disparity, write_color};

use crate::common::{color, grain};
use crate::program::Home;

const SIZE: (u32, u32) = (160, 96);

/// Writes OpenCV stereo calibration: 0.1 m baseline, 200 px focal length, the right camera `lower_px` pixels lower.
fn opencv(lower_px: f64) -> String {
    let matrix = |name: &str, rows: usize, columns: usize, data: &str| {
        format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
    };
    let camera = |row_px: f64| format!("200., 0., 79.5, 0., 200., {row_px},\n       0., 0., 1.");
    [
        "%YAML:1.0\n---\nimage_width: 160\nimage_height: 96\n".to_owned(),
        matrix("M1", 3, 3, &camera(47.5)),
        matrix("D1", 1, 5, "0., 0., 0., 0., 0."),
        matrix("M2", 3, 3, &camera(47.5 - lower_px)),
        matrix("D2", 1, 5, "0., 0., 0., 0., 0."),
        matrix("R", 3, 3, "1., 0., 0.,\n       0., 1., 0.,\n       0., 0., 1."),
        matrix("T", 3, 1, "-0.1, 0., 0."),
    ]
    .concat()
}

/// Draws a wall that the right camera sees `shift` columns to the left and `lower` rows higher.
fn eye(shift: u32, lower: u32) -> ColorImage {
    color(SIZE.0, SIZE.1, |x, y| [grain(x + shift, y + lower); 3])
}

#[test]
fn raw_pictures_are_rectified_by_the_calibration_that_says_how() {
    let home = Home::new();
    write_color(&home.path("left.png"), &eye(0, 0), false).unwrap();
    write_color(&home.path("right.png"), &eye(8, 4), false).unwrap();
    fs::write(home.path("stereo.yml"), opencv(4.0)).unwrap();
    let args = ["depth", "left.png", "right.png", "--backend", "cpu", "--max-disparity", "16", "--calib", "stereo.yml"];
    let ran = home.run(&[&args[..], &["--out", "new/disparity.pfm"]].concat());
    assert!(ran.done().contains("rectified by the calibration"), "{}", ran.stderr);
    assert!(!ran.stderr.contains("not rectified"), "{}", ran.stderr);
    let map = read_disparity(&home.path("new/disparity.pfm")).unwrap();
    let right = map.px.iter().filter(|&&px| (px - 8.0).abs() < 0.75).count();
    assert!(right * 10 > map.px.len() * 6, "{right} of {}", map.px.len());
    assert!(ran.stderr.contains("the cameras are 100.0 mm apart (by the calibration)"), "{}", ran.stderr);
    // Depth in metres from the same file: 200 px * 0.1 m / 8 px.
    home.run(&[&args[..], &["--metres", "--out", "depth.pfm"]].concat()).done();
}

#[test]
fn a_rectified_pair_of_streams_takes_the_same_calibration_as_one_of_pictures() {
    let home = Home::new();
    let (left, right) = (eye(0, 0), eye(8, 0));
    write_color(&home.path("left.png"), &left, false).unwrap();
    write_color(&home.path("right.png"), &right, false).unwrap();
    let calib = "P2: 200 0 79.5 0 0 200 47.5 0 0 0 1 0\nP3: 200 0 79.5 -20 0 200 47.5 0 0 0 1 0\n";
    fs::write(home.path("calib.txt"), calib).unwrap();
    fs::create_dir_all(home.path("pair/image_2")).unwrap();
    fs::create_dir_all(home.path("pair/image_3")).unwrap();
    write_color(&home.path("pair/image_2/000000.png"), &left, false).unwrap();
    write_color(&home.path("pair/image_3/000000.png"), &right, false).unwrap();
    home.run(&["depth", "left.png", "right.png", "--calib", "calib.txt", "--out", "d.pfm", "--backend", "cpu"]).done();
    let stream = ["stream", "pair", "--calib", "calib.txt", "--to", "null", "--backend", "cpu", "--focus", "2.5"];
    assert_eq!(home.run(&stream).warning(), "");
    let stated = [&stream[..], &["--baseline-m", "0.2", "-v"]].concat();
    let ran = home.run(&stated);
    assert!(ran.done().contains("cameras 200.0 mm apart"), "{}", ran.stderr);
}

#[test]
fn a_calibration_of_neither_kind_is_named() {
    let home = Home::new();
    write_color(&home.path("left.png"), &eye(0, 0), false).unwrap();
    write_color(&home.path("right.png"), &eye(8, 0), false).unwrap();
    fs::write(home.path("bad.yml"), "M1: [\n").unwrap();
    fs::write(home.path("notes.txt"), "hello\n").unwrap();
    let depth = |calib: &str| {
        home.run(&["depth", "left.png", "right.png", "--calib", calib, "--out", "d.pfm", "--backend", "cpu"])
    };
    depth("bad.yml").refused(1, &["bad.yml", "YAML"]);
    depth("notes.txt").refused(1, &["notes.txt: not a stereo calibration"]);
    depth("gone.yml").refused(1, &["gone.yml"]);
    assert!(!home.path("d.pfm").exists());
}
