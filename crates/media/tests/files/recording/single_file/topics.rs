//! What topics hold by their names and formats.

use std::io::Cursor;

use bokehcam_media::recording::{Options, Recording, RecordingError};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, RgbImage};

use super::super::{Scene, assert_says, color_of, depth_of};
use super::{CAMERA, TestTopic, open, record, text, unchunked, with_topics};

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

/// Builds a file of one compressed picture in each topic, a PNG of 4x2 pixels: the name, the format, and its pixels.
fn compressed(topics: &[(&str, &str, DynamicImage)]) -> Vec<u8> {
    let mut file = unchunked(&[], true);
    file.extend(record(3, &[&8_u16.to_le_bytes(), &text("sensor_msgs/CompressedImage"), &text(""), &text("")]));
    for (id, (name, format, pixels)) in (1_u16..).zip(topics) {
        let ids = [id.to_le_bytes(), 8_u16.to_le_bytes()].concat();
        file.extend(record(4, &[&ids, &text(name), &text("ros1"), &0_u32.to_le_bytes()]));
        let mut png = Cursor::new(Vec::new());
        pixels.write_to(&mut png, ImageFormat::Png).unwrap();
        let png = png.into_inner();
        // Numbers and times of the record, and those of the message.
        let numbers = [&id.to_le_bytes()[..], &[0; 20], &[1; 12]].concat();
        file.extend(record(5, &[&numbers, &text("camera"), &text(format), &(png.len() as u32).to_le_bytes(), &png]));
    }
    file
}

#[test]
fn a_png_of_16_bits_is_depth_where_the_name_says_so() {
    let scene = Scene::new();
    let plain = |rgb: [u8; 3]| DynamicImage::from(RgbImage::from_pixel(4, 2, rgb.into()));
    let color = ("/camera/color/image_raw/compressed", "png", plain([90, 9, 9]));
    let grey16 = DynamicImage::from(ImageBuffer::<Luma<u16>, _>::from_pixel(4, 2, [2000_u16].into()));
    let depth_name = "/camera/depth/image_raw/compressed";
    for format in ["png", "image/png", "mono16; png compressed mono16", "16UC1; png compressed 16UC1"] {
        let file = compressed(&[color.clone(), (depth_name, format, grey16.clone())]);
        for options in [Options::default(), with_topics(&[color.0, depth_name])] {
            let recording = open(&scene, "take.mcap", &file, &options).unwrap();
            assert_eq!(depth_of(&recording, 0).unwrap().metres, [2.0; 8], "{format}");
            assert_eq!(color_of(&recording, 0).unwrap().rgb[0], 90, "{format}");
        }
    }
    // Infrared, and colours of depth.
    let colored = (depth_name, "png", plain([80, 9, 9]));
    for others in [vec![("/camera/infra1/image_raw/compressed", "png", grey16)], vec![]] {
        let file = compressed(&[&[colored.clone()][..], &others].concat());
        let recording = open(&scene, "take.mcap", &file, &Options::default()).unwrap();
        assert_eq!((recording.has_depth(), color_of(&recording, 0).unwrap().rgb[0]), (false, 80));
    }
}
