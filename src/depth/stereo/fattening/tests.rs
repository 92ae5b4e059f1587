use super::*;
use crate::depth::stereo::fixed::ONE;
use crate::frame::ColorImage;

const SIZE: (usize, usize) = (96, 64);
const NEAR: u16 = 20 * ONE;
const FAR: u16 = 4 * ONE;
const SKIN: [u8; 3] = [200, 140, 110];
const WALL: [u8; 3] = [60, 90, 120];
/// Radius of the matching window.
const FAT_PX: isize = 4;

/// Whether a pixel is in a near rectangle, enlarged by `more` px on every side.
fn is_near(x: usize, y: usize, more: isize) -> bool {
    let (x, y) = (x as isize, y as isize);
    (30 - more..60 + more).contains(&x) && (20 - more..44 + more).contains(&y)
}

/// Returns a picture of the rectangle with slightly varying colours, and its disparities, `fat` px too wide.
fn scene([near, far]: [[u8; 3]; 2], fat: isize) -> (ColorImage, Vec<u16>) {
    let (width, height) = SIZE;
    let mut image = ColorImage::new(width as u32, height as u32);
    for (k, rgb) in image.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let color = if is_near(k % width, k / width, 0) { near } else { far };
        *rgb = color.map(|channel| channel + (k * 7 % 11) as u8);
    }
    let map = (0..width * height).map(|k| if is_near(k % width, k / width, fat) { NEAR } else { FAR }).collect();
    (image, map)
}

fn corrected(image: &ColorImage, map: &[u16], has_color: bool, threads: usize) -> Vec<u16> {
    let luma: Vec<u8> = image.rgb.as_chunks::<3>().0.iter().map(|rgb| rgb[1]).collect();
    let colors = has_color.then_some(Colors { image, stride: 1 });
    let mut into = vec![0; map.len()];
    FatteningCorrection::new(SIZE).correct(map, &mut into, &luma, colors, &mut ThreadPool::new("test", threads));
    into
}

/// Counts the pixels with a wrong disparity.
fn wrong(map: &[u16]) -> usize {
    map.iter().enumerate().filter(|&(k, &d)| (d == NEAR) != is_near(k % SIZE.0, k / SIZE.0, 0)).count()
}

#[test]
fn a_fat_thing_gets_the_outline_of_its_colour() {
    let (image, map) = scene([SKIN, WALL], FAT_PX);
    assert!(wrong(&map) > 400);
    assert_eq!(wrong(&corrected(&image, &map, true, 1)), 0);
    // Grey is less distinctive, and must do no harm.
    assert!(wrong(&corrected(&image, &map, false, 1)) <= wrong(&map));
}

#[test]
fn a_thin_thing_grows_to_the_outline_of_its_colour() {
    let (image, map) = scene([SKIN, WALL], -2);
    assert!(wrong(&map) > 180);
    for has_color in [true, false] {
        // The 2x2 pixels of its corners are beside no discontinuity in their row or column.
        assert!(wrong(&corrected(&image, &map, has_color, 1)) <= 16, "color: {has_color}");
    }
}

#[test]
fn a_right_outline_and_one_that_no_colour_shows_stay() {
    let (image, map) = scene([SKIN, WALL], 0);
    assert_eq!(corrected(&image, &map, true, 1), map);
    for fat in [0, FAT_PX] {
        let (image, map) = scene([WALL, WALL], fat);
        assert_eq!(corrected(&image, &map, true, 1), map);
        assert_eq!(corrected(&image, &map, false, 1), map);
    }
}

#[test]
fn a_rim_of_a_colour_of_its_own_stays() {
    let (mut image, map) = scene([SKIN, WALL], 0);
    for (k, rgb) in image.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let (x, y) = (k % SIZE.0, k / SIZE.0);
        if is_near(x, y, 0) && !(32..58).contains(&x) {
            *rgb = [20, 200, 20];
        }
    }
    assert_eq!(corrected(&image, &map, true, 1), map);
}

#[test]
fn a_slope_is_no_jump() {
    let (image, _) = scene([SKIN, WALL], 0);
    let map: Vec<u16> = (0..SIZE.0 * SIZE.1).map(|k| (k % SIZE.0) as u16 * ONE).collect();
    assert_eq!(corrected(&image, &map, true, 1), map);
}

#[test]
fn any_number_of_threads_decides_alike_and_pictures_may_be_tiny() {
    let (image, mut map) = scene([SKIN, WALL], FAT_PX);
    let mut state = 1u32;
    for d in &mut map {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *d += (state >> 24) as u16 * 2;
    }
    let one = corrected(&image, &map, true, 1);
    assert_ne!(one, map);
    for threads in [2, 3, 8] {
        assert_eq!(corrected(&image, &map, true, threads), one);
    }
    for size in [(1, 1), (3, 2), (LANES - 1, 4), (LANES, 1), (LANES + 1, 2)] {
        let map: Vec<u16> = (0..size.0 * size.1).map(|k| if k % 2 == 0 { NEAR } else { FAR }).collect();
        let (mut into, luma) = (vec![0; map.len()], vec![90; map.len()]);
        FatteningCorrection::new(size).correct(&map, &mut into, &luma, None, &mut ThreadPool::new("test", 2));
        assert_eq!(into, map);
    }
}
