//! A square before a wall, both textured with dots, as a rectified pair of pictures.

use bokehcam::frame::{ColorImage, GrayImage};

pub const SIZE: (u32, u32) = (160, 120);
/// Disparities of the wall and of the square, in pixels.
pub const FAR_PX: usize = 3;
pub const NEAR_PX: usize = 12;

const WIDTH: usize = SIZE.0 as usize;
const HEIGHT: usize = SIZE.1 as usize;

fn is_near(x: usize, y: usize) -> bool {
    (50..110).contains(&x) && (30..90).contains(&y)
}

/// Returns whether a pixel lies within the square, or beside it, away from the edges.
pub fn is_well_inside(x: usize, y: usize) -> bool {
    (60..100).contains(&x) && (40..80).contains(&y)
}
pub fn is_well_outside(x: usize, y: usize) -> bool {
    (115..150).contains(&x) && (10..110).contains(&y)
}

/// Returns a texture of 2-pixel dots that depends on the position alone.
fn texture(x: usize, y: usize, plane: usize) -> u8 {
    let mut hash = ((x / 2) * 7919 + (y / 2) * 104_729 + plane * 1_299_709) as u64;
    hash = (hash ^ (hash >> 7)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    40 + ((hash >> 40) % 176) as u8
}

/// Returns the pictures of both cameras.
pub fn seen() -> (ColorImage, GrayImage) {
    let mut left = ColorImage::new(SIZE.0, SIZE.1);
    let mut right = GrayImage::default();
    right.resize(SIZE.0, SIZE.1);
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let at_left = texture(x, y, usize::from(is_near(x, y)));
            left.rgb[3 * (y * WIDTH + x)..][..3].fill(at_left);
            right.luma[y * WIDTH + x] = match (x + NEAR_PX, x + FAR_PX) {
                (near_x, _) if is_near(near_x, y) => texture(near_x, y, 1),
                (_, far_x) => texture(far_x, y, 0),
            };
        }
    }
    (left, right)
}

/// Returns the mean difference of a region from the sharp picture, in codes.
pub fn difference(blurred: &[u8], sharp: &[u8], inside: fn(usize, usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 0..HEIGHT {
        for x in (0..WIDTH).filter(|&x| inside(x, y)) {
            sum += f64::from(blurred[3 * (y * WIDTH + x)].abs_diff(sharp[3 * (y * WIDTH + x)]));
            count += 1.0;
        }
    }
    sum / count
}
