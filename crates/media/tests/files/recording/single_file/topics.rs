//! What topics hold by their names and formats.

use bokehcam_media::recording::{Options, Recording, RecordingError};

use super::super::{Scene, assert_says, depth_of};
use super::{CAMERA, TestTopic, open, unchunked, with_topics};

/// Opens a recording of colour, and of other topics: their names, formats, and millimetres / 256 or metres.
fn open_with(others: &[(&str, &str, u8)], options: &Options) -> Result<Recording, RecordingError> {
    let times_ms = &[1, 34, 67][..];
    let others = others.iter().map(|&(name, format, value)| (name, format, value, times_ms));
    let topics: Vec<TestTopic> = [CAMERA[1]].into_iter().chain(others).collect();
    open(&Scene::new(), "take.mcap", &unchunked(&topics, false), options)
}

/// Returns the depth that is chosen, in metres; `None` if none is.
fn chosen_m(others: &[(&str, &str, u8)], names: &[&str]) -> Option<f32> {
    let recording = open_with(others, &with_topics(names)).unwrap();
    recording.has_depth().then(|| depth_of(&recording, 0).unwrap().metres[0])
}

#[test]
fn what_is_no_depth_by_its_name_is_taken_only_if_it_is_named() {
    for name in
        ["/zed/zed_node/confidence/confidence_map", "/kinect2/sd/image_ir_rect", "/camera/infra1/image_rect_raw"]
    {
        for (format, value) in [("16UC1", 8), ("32FC1", 2)] {
            assert_eq!(chosen_m(&[(name, format, value)], &[]), None, "{name}");
            let depth_m = if format == "16UC1" { 2.048 } else { 2.0 };
            assert_eq!(chosen_m(&[(name, format, value)], &[name]), Some(depth_m), "{name}");
        }
    }
    let (depth, confidence) = (("/camera/depth/image_rect_raw", "16UC1", 4), ("/camera/depth/confidence", "16UC1", 8));
    assert_eq!(chosen_m(&[confidence, depth], &[]), Some(1.024));
    // The name of a camera or a program says nothing.
    assert_eq!(chosen_m(&[("/mask_rcnn/depth", "32FC1", 3)], &[]), Some(3.0));
    assert_says(open_with(&[depth, ("/other", "16UC1", 8)], &Options::default()), &["several topics have depth"]);
}

#[test]
fn disparity_is_not_taken_as_metres() {
    for name in ["/stereo/disparity", "/stereo/disparity/image", "/camera/inverse_depth"] {
        let disparity = (name, "32FC1", 40);
        for options in [Options::default(), with_topics(&[name])] {
            assert_says(open_with(&[disparity], &options), &[name, "holds disparity", "--topic"]);
        }
        assert_eq!(chosen_m(&[disparity], &[CAMERA[1].0]), None);
        assert_eq!(chosen_m(&[disparity, ("/stereo/depth", "32FC1", 3)], &[]), Some(3.0));
    }
}
