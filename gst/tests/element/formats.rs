//! Formats and their colours: the output equals the library's conversions of the input, to the bit.

use bokehcam::color::YcbcrMatrix;
use bokehcam::engine::FrameProcessor;
use bokehcam::frame::ColorImage;
use bokehcam::look::{Effect, Look};
use bokehcam_live::capture::pixels::Decoder;
use bokehcam_live::layout::{FourCc, Layout, Plane, Range, Transfer};
use bokehcam_live::sink::raw::Encoder;
use gst::prelude::*;
use gst_video::VideoInfo;

use crate::common::*;

const SIZE: (u32, u32) = (50, 38);

fn noise(count: usize) -> Vec<u8> {
    let mut state = 3_u64;
    let mut byte = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as u8
    };
    (0..count).map(|_| byte()).collect()
}

/// Passes a picture through the element with the effect `blur`.
fn through(caps: &gst::Caps, picture: Vec<u8>) -> Vec<u8> {
    let mut harness = harness();
    harness.element().unwrap().set_property_from_str("effect", "blur");
    harness.set_src_caps(caps.clone());
    harness.push(timed(picture, 0, 1)).unwrap();
    let blurred = harness.pull().unwrap();
    assert_eq!(harness.sinkpad().unwrap().current_caps().unwrap(), *caps);
    bytes(&blurred)
}

fn blurred(picture: &ColorImage) -> ColorImage {
    let mut processor =
        FrameProcessor::new(&Look::with_effect(Effect::Blur), picture.size(), false, true, Default::default()).unwrap();
    processor.frame_buffers().0.clone_from(picture);
    processor.process(0).unwrap().clone()
}

#[test]
fn every_format_and_colorimetry_is_converted_as_the_library_does() {
    init();
    let cases = [
        ("I420", "YM12", "2:4:5:1", YcbcrMatrix::Bt601, Range::Limited),
        ("I420", "YM12", "bt709", YcbcrMatrix::Bt709, Range::Limited),
        ("NV12", "NM12", "bt709", YcbcrMatrix::Bt709, Range::Limited),
        ("NV12", "NM12", "1:4:0:0", YcbcrMatrix::Bt601, Range::Full),
        ("YUY2", "YUYV", "bt601", YcbcrMatrix::Bt601, Range::Limited),
        ("YUY2", "YUYV", "bt2020", YcbcrMatrix::Bt2020, Range::Limited),
        ("RGB", "RGB3", "sRGB", YcbcrMatrix::Bt601, Range::Full),
    ];
    for (format, fourcc, colorimetry, matrix, range) in cases {
        let mut caps = caps(format, SIZE);
        caps.make_mut().set("colorimetry", colorimetry);
        let info = VideoInfo::from_caps(&caps).unwrap();
        let picture = noise(info.size());
        // Plane offsets as GStreamer gives them, and in the library's layouts.
        let planes = info.n_planes() as usize;
        let given: Vec<Plane> =
            (0..planes).map(|at| Plane { stride_bytes: info.stride()[at] as usize, size_bytes: 0 }).collect();
        let colors = Some((matrix, range, Transfer::Display));
        let layout = Layout::new(fourcc.parse::<FourCc>().unwrap(), SIZE, &given, colors).unwrap();
        let mut color = ColorImage::default();
        let slices: Vec<&[u8]> = (0..planes).map(|at| &picture[info.offset()[at]..]).collect();
        Decoder::new(&layout).unwrap().decode(&slices, &mut color).unwrap();
        let blurred = blurred(&color);
        assert!(blurred != color);
        let found = through(&caps, picture.clone());
        let mut wanted: Vec<Vec<u8>> = (0..planes).map(|at| found[info.offset()[at]..].to_vec()).collect();
        let mut slices: Vec<&mut [u8]> = wanted.iter_mut().map(Vec::as_mut_slice).collect();
        // The padding between rows is undefined, so only the pixels are compared.
        Encoder::new(&layout).unwrap().encode(&blurred, &mut slices);
        for (at, wanted) in wanted.iter().enumerate() {
            assert!(found[info.offset()[at]..] == **wanted, "{format} {colorimetry} plane {at}");
        }
    }
}

#[test]
fn the_fourth_byte_of_a_pixel_is_none_of_its_colours() {
    init();
    let rgb = stripes((48, 36), 0);
    let rgbx: Vec<u8> = rgb.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 7]).collect();
    let (with, without) = (through(&caps("RGBx", (48, 36)), rgbx), through(&caps("RGB", (48, 36)), rgb));
    let without: Vec<u8> = without.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
    assert!(with == without);
}

#[test]
fn with_the_effect_none_buffers_go_through_as_they_are() {
    let mut harness = harness();
    harness.element().unwrap().set_property_from_str("effect", "none");
    harness.set_src_caps(caps("RGB", (48, 36)));
    let picture = timed(stripes((48, 36), 0), 0, 1);
    let memory = picture.as_ptr();
    harness.push(picture).unwrap();
    assert_eq!(harness.pull().unwrap().as_ptr(), memory);
}

#[test]
fn a_format_that_is_not_known_is_not_taken() {
    let harness = harness();
    let takes =
        |text: &str| harness.element().unwrap().static_pad("sink").unwrap().query_accept_caps(&text.parse().unwrap());
    assert!(takes("video/x-raw,format=NV12,width=64,height=48,framerate=25/1"));
    assert!(!takes("video/x-raw,format=BGRA,width=64,height=48,framerate=25/1"));
    assert!(!takes("video/x-raw,format=YUY2,width=63,height=48,framerate=25/1"));
}
