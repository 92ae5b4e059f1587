//! Picture files, and side-by-side crops for visual comparison.

use std::io;
use std::path::Path;

use bokehcam::frame::ColorImage;
use image::RgbImage;

/// Columns and rows of a crop, and its magnification.
const CROP: (usize, usize) = (160, 120);
const ZOOM: usize = 2;
/// Columns between two crops.
const GAP: usize = 4;
/// Step of the search for the worst crop, in pixels.
const STEP: usize = 20;

/// Reads a PNG file; `None` if it is missing or unreadable.
pub fn read_png(file: &Path) -> Option<ColorImage> {
    let image = image::open(file).ok()?.into_rgb8();
    Some(ColorImage { width: image.width(), height: image.height(), rgb: image.into_raw() })
}

/// Writes a PNG file.
///
/// # Errors
/// Fails if the file cannot be written.
pub fn write_png(file: &Path, image: &ColorImage) -> io::Result<()> {
    let picture = RgbImage::from_raw(image.width, image.height, image.rgb.clone());
    picture
        .ok_or(io::ErrorKind::InvalidData)?
        .save(file)
        .map_err(|error| io::Error::other(format!("{}: {error}", file.display())))
}

/// Returns column and row of the crop where `ours` differs most from the truth.
fn find_worst_crop(ours: &ColorImage, truth: &ColorImage) -> (usize, usize) {
    let (width, height) = (ours.width as usize, ours.height as usize);
    let error = |(left, top): (usize, usize)| -> u64 {
        let rows = (top..(top + CROP.1).min(height)).map(|y| {
            let row = (y * width + left) * 3..(y * width + (left + CROP.0).min(width)) * 3;
            let squares =
                ours.rgb[row.clone()].iter().zip(&truth.rgb[row]).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2));
            squares.sum::<u64>()
        });
        rows.sum()
    };
    let starts = |length: usize, crop: usize| (0..=length.saturating_sub(crop)).step_by(STEP);
    let places = starts(height, CROP.1).flat_map(|top| starts(width, CROP.0).map(move |left| (left, top)));
    places.max_by_key(|&place| error(place)).unwrap_or_default()
}

/// Returns the crop where `ours` is worst, enlarged: ours, the truth, the rival.
pub fn draw_crops(ours: &ColorImage, truth: &ColorImage, rival: &ColorImage) -> ColorImage {
    let (left, top) = find_worst_crop(ours, truth);
    let column = CROP.0 * ZOOM + GAP;
    let mut sheet = ColorImage::new((3 * column - GAP) as u32, (CROP.1 * ZOOM) as u32);
    let wide = sheet.width as usize;
    for (index, image) in [ours, truth, rival].into_iter().enumerate() {
        for (x, y) in (0..CROP.1 * ZOOM).flat_map(|y| (0..CROP.0 * ZOOM).map(move |x| (x, y))) {
            let from_x = (left + x / ZOOM).min(image.width as usize - 1);
            let from = ((top + y / ZOOM).min(image.height as usize - 1) * image.width as usize + from_x) * 3;
            let to = (y * wide + index * column + x) * 3;
            sheet.rgb[to..to + 3].copy_from_slice(&image.rgb[from..from + 3]);
        }
    }
    sheet
}

/// Stacks pictures of one width vertically.
pub fn stack_vertically(pictures: &[ColorImage]) -> ColorImage {
    let width = pictures.iter().map(|picture| picture.width).max().unwrap_or(0);
    let rgb: Vec<u8> = pictures
        .iter()
        .flat_map(|picture| [&picture.rgb[..], &vec![0; width as usize * 3 * GAP][..]].concat())
        .collect();
    ColorImage { width, height: (rgb.len() / (width.max(1) as usize * 3)) as u32, rgb }
}
