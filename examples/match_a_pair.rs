//! Computes the disparity of a rectified stereo pair.
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::stereo::{Effort, Pair};
use bokehcam::frame::{DisparityMap, GrayImage};
use bokehcam::recording::still::read_color;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [mut left, mut right] = [GrayImage::default(), GrayImage::default()];
    let color = read_color("recordings/stereo/image_2/000000.png".as_ref())?;
    left.set_luma_from(&color);
    right.set_luma_from(&read_color("recordings/stereo/image_3/000000.png".as_ref())?);
    let mut matcher = ComputeOptions::default().create_matcher(64, Effort::Full, color.size())?;
    let mut disparity = DisparityMap::default();
    matcher.compute_disparity(Pair { left: &left, color: Some(&color), right: &right }, &mut disparity)?;
    let nearest_px = disparity.px.iter().copied().fold(0.0, f32::max);
    println!("{}x{} pixels, the nearest {nearest_px:.1} px apart", disparity.width, disparity.height);
    Ok(())
}
