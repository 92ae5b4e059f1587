//! Blurs a recording into a custom sink.
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

use bokehcam::frame::ColorImage;
use bokehcam::look::Look;
use bokehcam_live::sink::{Sink, SinkError};
use bokehcam_live::{
    pipeline,
    source::{Options, Source},
};

struct Brightness;

impl Sink for Brightness {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let sum: u64 = frame.rgb.iter().map(|&value| u64::from(value)).sum();
        println!("{:6.3} s: {}", time_ns as f64 / 1e9, sum / frame.rgb.len() as u64);
        Ok(ControlFlow::Continue(()))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (look, stop) = (Look::default(), AtomicBool::new(false));
    let source = Source::open(&"recordings/portrait".parse()?, &Options::default(), Some(&look))?;
    let run = pipeline::Run::new(source.camera, source.depth, look, Box::new(Brightness), &stop)?;
    println!("{}", pipeline::run(run)?);
    Ok(())
}
