//! A picture of a disparity map.

use bokehcam::frame::{ColorImage, DepthMap, DisparityMap};

/// Fraction of disparities clipped at either end of the colour scale, so that outliers do not compress the contrast.
const OUTLIER_FRACTION: f32 = 0.01;

/// Coefficients of red, green and blue in powers of the value, 0 to 1: A. Mikhailov's polynomial for his colour map
/// Turbo, from dark blue by green and yellow to dark red (Google AI blog, 2019).
const TURBO: [[f32; 6]; 3] = [
    [0.135_721_4, 4.615_392_6, -42.660_324, 132.131_08, -152.942_4, 59.286_38],
    [0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_6, 2.829_566],
    [0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25],
];

/// Colours a disparity map: near is red, far is blue, unknown is black.
pub fn colorize_disparity(disparity: &DisparityMap) -> ColorImage {
    let mut known: Vec<f32> = disparity.px.iter().copied().filter(|&px| DepthMap::is_known(px)).collect();
    known.sort_unstable_by(f32::total_cmp);
    let quantile = |fraction: f32| known.get((fraction * known.len() as f32) as usize).copied().unwrap_or(0.0);
    let (far_px, near_px) = (quantile(OUTLIER_FRACTION), quantile(1.0 - OUTLIER_FRACTION));
    let span_px = (near_px - far_px).max(f32::MIN_POSITIVE);
    let mut image = ColorImage::new(disparity.width, disparity.height);
    for (pixel, &px) in image.rgb.as_chunks_mut::<3>().0.iter_mut().zip(&disparity.px) {
        *pixel = if DepthMap::is_known(px) { turbo_color(((px - far_px) / span_px).clamp(0.0, 1.0)) } else { [0; 3] };
    }
    image
}

fn turbo_color(value: f32) -> [u8; 3] {
    let channel = |powers: [f32; 6]| powers.iter().rev().fold(0.0, |sum, power| sum * value + power);
    TURBO.map(|powers| (channel(powers).clamp(0.0, 1.0) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_warm_far_is_cold_and_unknown_is_black() {
        let mut px: Vec<f32> = (1..=300).map(|step| step as f32 / 10.0).collect();
        px[7] = 0.0;
        px[8] = f32::INFINITY;
        let image = colorize_disparity(&DisparityMap { width: 30, height: 10, px });
        let [far, unknown, infinite, middle, near] =
            [0, 7, 8, 150, 299].map(|at| <[u8; 3]>::try_from(&image.rgb[at * 3..][..3]).unwrap());
        assert_eq!([unknown, infinite], [[0; 3]; 2]);
        assert!(near[0] > 100 && near[2] == 0, "{near:?}");
        assert!(far[2] > far[0].max(20) - 20 && far[1] < 60, "{far:?}");
        assert!(middle[1] > 240, "{middle:?}");
        // Only known disparities count, even if there are none or one.
        for px in [vec![], vec![0.0; 4], vec![3.0; 4]] {
            colorize_disparity(&DisparityMap { width: 2, height: px.len() as u32 / 2, px });
        }
    }
}
