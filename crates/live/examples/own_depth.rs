//! Uses a custom depth source in the pipeline: here the middle of the picture is near.
use std::sync::atomic::AtomicBool;

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::{frame::DepthMap, look::Look};
use bokehcam_live::{
    pipeline,
    sink::Null,
    source::{Options, Source},
};

struct Middle;

impl DepthSource for Middle {
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let (width, height) = seen.color.size();
        map.resize(width, height);
        let is_near = |k: usize| (k as u32 % width).abs_diff(width / 2) < width / 6;
        map.metres.iter_mut().enumerate().for_each(|(k, metres)| *metres = if is_near(k) { 1.0 } else { 4.0 });
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (look, stop) = (Look::default(), AtomicBool::new(false));
    let camera = Source::open(&"recordings/portrait".parse()?, &Options::default(), None)?.camera;
    let run = pipeline::Run::new(camera, Some(Box::new(Middle)), look, Box::new(Null), &stop)?;
    println!("{}", pipeline::run(run)?);
    Ok(())
}
