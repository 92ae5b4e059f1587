//! Sinks: their output, and that it appears whole or not at all.
#![allow(missing_docs)]

mod folder;
mod names;
mod streams;
mod video;
mod whole;

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_live::sink::{Options, Sink, SinkError, Target};

pub const PERIOD_NS: u64 = 40_000_000;

pub fn options(size: (u32, u32)) -> Options {
    Options::new(size, PERIOD_NS)
}

pub fn flat(width: u32, height: u32, rgb: [u8; 3]) -> ColorImage {
    let mut image = ColorImage::new(width, height);
    image.rgb.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&rgb));
    image
}

/// Returns smooth colours that change from frame to frame.
pub fn picture(width: u32, height: u32, frame: u32) -> ColorImage {
    let mut image = ColorImage::new(width, height);
    for (index, pixel) in image.rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let ramp = |at: u32, of: u32| (30 + 190 * at / of.max(1)) as u8;
        pixel.copy_from_slice(&[ramp(x, width), ramp(y, height), (60 + 20 * (frame % 8)) as u8]);
    }
    image
}

pub fn open(name: &Path, options: &Options) -> Result<Box<dyn Sink>, SinkError> {
    name.to_str().unwrap().parse::<Target>()?.open(options)
}

/// Puts frames at exactly the announced period.
pub fn put_all(sink: &mut dyn Sink, frames: &[ColorImage]) {
    for (frame, at) in frames.iter().zip(0..) {
        assert_eq!(sink.write_frame(frame, at * PERIOD_NS).unwrap(), ControlFlow::Continue(()));
    }
}

pub fn forced(size: (u32, u32)) -> Options {
    Options { force: true, ..options(size) }
}

/// Returns the names in a folder, hidden ones included, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
