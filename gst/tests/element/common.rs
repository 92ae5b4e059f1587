//! A harness for the element, and pictures and maps to push into it.

use std::sync::Once;

use gst::prelude::*;
use gst_check::Harness;

pub const FPS: u64 = 25;
pub const PERIOD: gst::ClockTime = gst::ClockTime::from_mseconds(1000 / FPS);

pub fn init() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        gst::init().unwrap();
        gstbokehcam::plugin_register_static().unwrap();
    });
}

pub fn caps(format: &str, (width, height): (u32, u32)) -> gst::Caps {
    let text = format!("video/x-raw,format={format},width={width},height={height},framerate={FPS}/1");
    text.parse().unwrap()
}

/// Creates the element with a picture pad, whose source blocks as long as needed.
pub fn harness() -> Harness {
    init();
    let mut harness = Harness::with_padnames("bokeh", Some("sink"), Some("src"));
    harness.set_live(false);
    harness
}

/// Adds a depth pad of the same element.
pub fn depth_of(harness: &Harness, size: (u32, u32)) -> Harness {
    let mut depth = Harness::with_element(&harness.element().unwrap(), Some("depth"), None);
    depth.set_live(false);
    depth.set_src_caps(caps("GRAY16_LE", size));
    depth
}

/// Creates a buffer at the time of frame `index`, which lasts `frames` frame periods.
pub fn timed(bytes: Vec<u8>, index: u64, frames: u64) -> gst::Buffer {
    let mut buffer = gst::Buffer::from_slice(bytes);
    let inside = buffer.get_mut().unwrap();
    inside.set_pts(index * PERIOD);
    inside.set_duration(frames * PERIOD);
    buffer
}

/// Returns moving stripes in RGB, with rows that are multiples of 4 bytes.
pub fn stripes((width, height): (u32, u32), index: u64) -> Vec<u8> {
    assert_eq!(width % 4, 0);
    let pixel = |at: u32| {
        let (x, y) = (u64::from(at % width), u64::from(at / width));
        [if ((x + index) / 3).is_multiple_of(2) { 230 } else { 20 }, (x * 5) as u8, (y * 4) as u8]
    };
    (0..width * height).flat_map(pixel).collect()
}

/// Returns a depth map in millimetres: a near object in the middle, before a wall.
pub fn map((width, height): (u32, u32)) -> Vec<u8> {
    assert_eq!(width % 2, 0);
    let number = |at: u32| -> u16 {
        let (x, y) = (at % width, at / width);
        if (width / 3..2 * width / 3).contains(&x) && y > height / 4 { 900 } else { 4000 }
    };
    (0..width * height).flat_map(|at| number(at).to_le_bytes()).collect()
}

pub fn bytes(buffer: &gst::BufferRef) -> Vec<u8> {
    buffer.map_readable().unwrap().to_vec()
}

/// Returns a number of the element's statistics.
pub fn stat(element: &gst::Element, name: &str) -> u64 {
    element.property::<gst::Structure>("stats").get(name).unwrap()
}
