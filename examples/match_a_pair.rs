//! Computes the disparity of a rectified stereo pair.
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::stereo::{Effort, Pair};
use bokehcam::frame::{ColorImage, DisparityMap, GrayImage};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [mut left, mut right] = [GrayImage::default(), GrayImage::default()];
    let read = |eye: &str| -> Result<ColorImage, image::ImageError> {
        let picture = image::open(format!("recordings/stereo/{eye}/000000.png"))?.into_rgb8();
        Ok(ColorImage { width: picture.width(), height: picture.height(), rgb: picture.into_raw() })
    };
    let color = read("image_2")?;
    left.set_luma_from(&color);
    right.set_luma_from(&read("image_3")?);
    let mut matcher = ComputeOptions::default().create_matcher(64, Effort::Full, color.size())?;
    let mut disparity = DisparityMap::default();
    matcher.compute_disparity(Pair { left: &left, color: Some(&color), right: &right }, &mut disparity)?;
    let nearest_px = disparity.px.iter().copied().fold(0.0, f32::max);
    println!("{}x{} pixels, the nearest {nearest_px:.1} px apart", disparity.width, disparity.height);
    Ok(())
}
