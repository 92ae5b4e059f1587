//! Encodes large JPEGs on several threads: in bands of rows, each a restart interval, which depends on no other one (ITU-T
//! T.81, sections B.2.4.4 and F.1.1.5.1).
//!
//! Every band is encoded as a picture of its own; their coded data, joined by restart markers, is that of the whole.

use std::sync::atomic::AtomicBool;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};

use super::segments::{find_coded_data, set_height_and_restart_interval};
use bokehcam::compute::thread_pool::{DisjointParts, ThreadPool, core_count};

/// Smaller pictures are encoded as a whole, in a few milliseconds.
const MIN_PIXELS: usize = 2 << 20;
/// Side of a block: the encoder does not subsample colours.
const BLOCK_PX: usize = 8;
/// Rows of blocks in an interval; even the widest JPEG then has fewer blocks in it than a restart interval may have.
const ROWS_OF_BLOCKS: usize = 7;

/// Appends a picture to `file`, which must be empty, as JPEG with the given quality. `prepare` sets the metadata of the
/// encoder.
///
/// # Errors
/// The encoder refuses the picture or its metadata.
pub fn encode(
    rgb: &[u8],
    (width_px, height_px): (u32, u32),
    quality: u8,
    prepare: impl FnOnce(&mut JpegEncoder<&mut Vec<u8>>) -> ImageResult<()>,
    file: &mut Vec<u8>,
) -> ImageResult<()> {
    let (width, height) = (width_px as usize, height_px as usize);
    let rows = ROWS_OF_BLOCKS * BLOCK_PX;
    let is_large = width * height >= MIN_PIXELS && height > rows;
    let band_height = |index: usize| if is_large { rows.min(height - index * rows) } else { height };
    let encode_band = |encoder: JpegEncoder<&mut Vec<u8>>, index: usize| {
        let rgb = &rgb[index * rows * width * 3..][..band_height(index) * width * 3];
        encoder.write_image(rgb, width_px, band_height(index) as u32, ExtendedColorType::Rgb8)
    };
    let mut first = JpegEncoder::new_with_quality(&mut *file, quality);
    prepare(&mut first)?;
    encode_band(first, 0)?;
    if !is_large {
        return Ok(());
    }

    let mut others: Vec<ImageResult<Vec<u8>>> = (1..height.div_ceil(rows)).map(|_| Ok(Vec::new())).collect();
    let mut taken: Vec<AtomicBool> = others.iter().map(|_| AtomicBool::new(false)).collect();
    let count = others.len();
    let parts = DisjointParts::new(&mut others, 1, &mut taken);
    ThreadPool::new("encode", core_count()).run(count, &|part| {
        let mut coded = Vec::new();
        let encoded = encode_band(JpegEncoder::new_with_quality(&mut coded, quality), 1 + part);
        parts.part(part)[0] = encoded.map(|()| coded);
    });
    let blocks = (ROWS_OF_BLOCKS * width.div_ceil(BLOCK_PX)) as u16;
    set_height_and_restart_interval(file, height as u16, blocks);
    for (index, coded) in others.into_iter().enumerate() {
        // The end marker (EOI) makes room for a restart marker (RSTn).
        file.truncate(file.len() - 2);
        file.extend([0xFF, 0xD0 + (index % 8) as u8]);
        let coded = coded?;
        file.extend_from_slice(&coded[find_coded_data(&coded)..]);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use image::{ImageError, ImageReader};
    use std::io::Cursor;

    use super::*;
    use bokehcam::frame::ColorImage;

    fn decode(file: &[u8]) -> Vec<u8> {
        let reader = ImageReader::new(Cursor::new(file)).with_guessed_format().unwrap();
        reader.decode().unwrap().into_rgb8().into_raw()
    }

    #[test]
    fn intervals_hold_the_pixels_of_one_scan() {
        // Sides that end within a block; more intervals than restart markers.
        for (width, height) in [(3001, 701), (2048, 1024), (37_453, 60)] {
            let mut image = ColorImage::new(width, height);
            for (at, value) in image.rgb.iter_mut().enumerate() {
                *value = (at % 251) as u8 ^ (at / (3 * width as usize)) as u8;
            }
            let [mut whole, mut in_intervals] = [Vec::new(), Vec::new()];
            let encoder = JpegEncoder::new_with_quality(&mut whole, 95);
            encoder.write_image(&image.rgb, width, height, ExtendedColorType::Rgb8).unwrap();
            encode(
                &image.rgb,
                (width, height),
                95,
                |encoder| encoder.set_icc_profile(vec![7; 100]).map_err(ImageError::Unsupported),
                &mut in_intervals,
            )
            .unwrap();
            assert!(decode(&whole) == decode(&in_intervals), "{width}x{height}");
            assert!(crate::is_complete(&in_intervals) && in_intervals.len() < whole.len() * 101 / 100 + 200);
            assert!(in_intervals.windows(11).any(|name| name == b"ICC_PROFILE"), "metadata is kept");
        }
    }
}
