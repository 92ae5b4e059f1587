//! The portable float map (PFM): one float per pixel, bottom row first, common for disparity and depth.

use std::io::Write;

use super::decoders::check_size;
use super::fault::PictureFault;
use super::unit::MapUnit;

/// Parses a PFM into `values` as stored, top row first. Returns width and height, and the meaning if the file states it.
/// Colours are accepted if they are grey.
pub(super) fn parse(bytes: &[u8], values: &mut Vec<f32>) -> Result<((u32, u32), Option<MapUnit>), PictureFault> {
    let mut rest = bytes;
    let channels = match parse_word(&mut rest)?.0 {
        "Pf" => 1,
        "PF" => 3,
        _ => return Err(PictureFault::Format("grey PFM")),
    };
    let (width, after_width) = parse_word(&mut rest)?;
    let width = parse_number(width)?;
    let height = parse_number(parse_word(&mut rest)?.0)?;
    check_size(width, height)?;
    // Only the sign is used: negative is little-endian.
    let scale_text = parse_word(&mut rest)?.0;
    let scale: f32 = parse_number(scale_text)?;
    let row_bytes = width as usize * 4 * channels;
    let data = rest.get(..row_bytes * height as usize).ok_or(PictureFault::Truncated)?;

    let from_bytes = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let numbers = |row: &[u8]| row.as_chunks().0.iter().map(|&bytes| from_bytes(bytes)).collect::<Vec<f32>>();
    values.clear();
    values.reserve(width as usize * height as usize);
    for row in 0..height as usize {
        // Photoshop writes width and height on a line each, and the top row first.
        let stored = if after_width == b'\n' { row } else { height as usize - 1 - row };
        let numbers = numbers(&data[stored * row_bytes..][..row_bytes]);
        if channels == 1 {
            values.extend(numbers);
            continue;
        }
        let is_grey =
            |pixel: &[f32; 3]| pixel[0].to_bits() == pixel[1].to_bits() && pixel[1].to_bits() == pixel[2].to_bits();
        let pixels = numbers.as_chunks::<3>().0;
        if !pixels.iter().all(is_grey) {
            return Err(PictureFault::NotDepth("a colour PFM"));
        }
        values.extend(pixels.iter().map(|pixel| pixel[0]));
    }
    Ok(((width, height), MapUnit::from_pfm_scale(scale_text)))
}

/// Reads the next word of the header, and the one white space that ends it, since pixels may follow.
fn parse_word<'a>(rest: &mut &'a [u8]) -> Result<(&'a str, u8), PictureFault> {
    let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).ok_or(PictureFault::Truncated)?;
    let length = rest[start..].iter().position(u8::is_ascii_whitespace).ok_or(PictureFault::Truncated)?;
    let (word, end) = (&rest[start..start + length], rest[start + length]);
    *rest = &rest[start + length + 1..];
    let word = std::str::from_utf8(word).map_err(|_| PictureFault::Damaged("its header is not text".into()))?;
    Ok((word, end))
}

fn parse_number<T: std::str::FromStr>(word: &str) -> Result<T, PictureFault> {
    let short: String = word.chars().take(20).collect();
    word.parse().map_err(|_| PictureFault::Damaged(format!("{short:?} in its header is not a number")))
}

/// Appends `values` (`height` x `width`, row-major) to `file` as a little-endian PFM that states their `meaning`.
pub(super) fn encode_pfm((width, height): (u32, u32), values: &[f32], map_unit: MapUnit, file: &mut Vec<u8>) {
    // Writing to memory cannot fail.
    let _ = write!(file, "Pf\n{width} {height}\n{}\n", map_unit.pfm_scale());
    for row in values.chunks_exact(width.max(1) as usize).rev() {
        file.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
}
