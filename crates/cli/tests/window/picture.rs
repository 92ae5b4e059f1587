//! Measurements on pictures of the screen.

use std::collections::HashSet;
use std::path::Path;

use bokehcam::frame::ColorImage;

/// Saves a picture for the diagnosis of a failed test; returns a note with its path.
pub fn keep(image: &ColorImage, name: &str) -> String {
    let name: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.png"));
    let saved = image::save_buffer(&path, &image.rgb, image.width, image.height, image::ColorType::Rgb8);
    match saved {
        Ok(()) => format!("see {}", path.display()),
        Err(error) => format!("{}: {error}", path.display()),
    }
}

/// Crops a picture to a rectangle: upper left corner and size, in pixels.
pub fn part(image: &ColorImage, (left, top): (u32, u32), (width, height): (u32, u32)) -> ColorImage {
    let mut cut = ColorImage::new(width, height);
    let row_bytes = 3 * width as usize;
    for (row, out) in (top..).zip(cut.rgb.chunks_exact_mut(row_bytes)) {
        let from = 3 * (row * image.width + left) as usize;
        out.copy_from_slice(&image.rgb[from..from + row_bytes]);
    }
    cut
}

/// Crops a picture to its middle quarter, which no control covers.
pub fn middle(image: &ColorImage) -> ColorImage {
    let (width, height) = image.size();
    part(image, (width / 4, height / 4), (width / 2, height / 2))
}

/// Whether the middle shows a photograph, judged by its number of colours; an empty window and text have fewer.
pub fn is_photograph(image: &ColorImage) -> bool {
    const MIN_COLOURS: usize = 150;
    let middle = middle(image);
    let colours: HashSet<[u8; 3]> = middle.rgb.as_chunks::<3>().0.iter().map(|rgb| rgb.map(|byte| byte / 8)).collect();
    colours.len() > MIN_COLOURS
}

/// Returns the mean absolute difference of two pictures of one size, 0 to 255.
pub fn distance(a: &ColorImage, b: &ColorImage) -> f64 {
    assert_eq!(a.size(), b.size());
    let sum: u64 = a.rgb.iter().zip(&b.rgb).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.rgb.len().max(1) as f64
}
