#![allow(missing_docs)]
use bokehcam::computing::ComputeOptions;
use bokehcam::engine::still::{self, Depth};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::Look;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let picture = image::open("recordings/portrait/rgb/000000.png")?.into_rgb8();
    let (width, height) = picture.dimensions();
    let color = ColorImage { width, height, rgb: picture.into_raw() };
    // 16-bit grey, 5000 units per metre; 0 is unknown.
    let units = image::open("recordings/portrait/depth/000000.png")?.into_luma16();
    let metres = units.pixels().map(|units| f32::from(units.0[0]) / 5000.0).collect();
    let depth = DepthMap { width, height, metres, ..DepthMap::default() };
    let (blurred, by) =
        still::blur_picture(&Look::default(), color, Some(Depth::Measured(depth)), &ComputeOptions::default())?;
    let file = std::env::temp_dir().join("bokehcam-example.png");
    image::save_buffer(file, &blurred.rgb, width, height, image::ColorType::Rgb8)?;
    println!("blurred by {by}");
    Ok(())
}
