#![allow(missing_docs)]
use bokehcam::computing::ComputeOptions;
use bokehcam::engine::still::{self, Depth};
use bokehcam::look::Look;
use bokehcam::recording::still::{read_color, read_depth, write_color};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let color = read_color("recordings/portrait/rgb/000000.png".as_ref())?;
    // 16-bit grey, 5000 units per metre; 0 is unknown.
    let depth = read_depth("recordings/portrait/depth/000000.png".as_ref(), 5000.0, Some(0))?;
    let (blurred, by) =
        still::blur_picture(&Look::default(), color, Some(Depth::Measured(depth)), &ComputeOptions::default())?;
    write_color(&std::env::temp_dir().join("bokehcam-example.png"), &blurred, true)?;
    println!("blurred by {by}");
    Ok(())
}
