//! Depth drawn in the colours of a known colour map: the numbers are recovered, if every colour is one of the map's.

use std::collections::HashMap;
use std::path::Path;

use super::values::{Samples, Values};
use crate::recording::decode;
use crate::recording::fault::PictureFault;

/// 256 colours of each map, from 0 to 255, as R, G, B: matplotlib's `colormaps[NAME](range(256), bytes=True)`. The first four
/// are in the public domain (CC0), turbo is by Google and Spectral by ColorBrewer (both Apache-2.0).
const COLORS: &[u8] = include_bytes!("color_maps.rgb");
/// Names and ends of the maps in [`COLORS`]; the last field is whether the first colour is the usual one of near surfaces, as
/// depth tools draw them (Depth Anything, Marigold: Spectral; MiDaS: inferno; Depth Pro: turbo).
const MAPS: [(&str, [&str; 2], bool); 7] = [
    ("magma", ["black", "light yellow"], false),
    ("inferno", ["black", "light yellow"], false),
    ("plasma", ["blue", "yellow"], false),
    ("viridis", ["dark violet", "yellow"], false),
    ("turbo", ["dark violet", "dark red"], false),
    ("Spectral", ["dark red", "blue violet"], true),
    ("jet", ["dark blue", "dark red"], false),
];
/// Number of colours of a map.
const STEPS: usize = 256;
/// Largest difference of a channel: programs round or truncate.
const TOLERANCE: u8 = 1;
/// Fewer different colours may be found in any drawing.
const MIN_COLORS: usize = 32;

/// The colours of a map that a picture consists of.
pub(super) struct ColorMapped {
    /// The numbers, of which the largest are usually near.
    pub values: Values,
    /// The map's name.
    pub name: &'static str,
    /// The colours of the largest and the smallest number.
    pub ends: [&'static str; 2],
}

/// Reads the picture `path`, which has colours, upright by its orientation tag, as numbers that are drawn in the colours
/// of a map.
///
/// # Errors
/// It has other colours.
pub(super) fn read(path: &Path) -> Result<ColorMapped, PictureFault> {
    // What is no picture, but has colours, has none of these.
    let (picture, _) = decode::read_photo(path).map_err(|_| PictureFault::ColoredDepth)?;
    let pixels = picture.rgb.as_chunks::<3>().0;
    let numbers_of = |map: &[[u8; 3]]| {
        let mut numbers = HashMap::new();
        // Ends at the first colour that is not the map's, so that only colours near those of the map are kept.
        let codes = pixels.iter().map(|color| match numbers.get(color) {
            Some(&number) => Some(number),
            None => {
                let number = find_nearest(map, *color)?;
                numbers.insert(*color, number);
                Some(number)
            }
        });
        let codes = codes.collect::<Option<Vec<u8>>>()?;
        (numbers.len() >= MIN_COLORS).then_some(codes)
    };
    let maps = COLORS.as_chunks::<3>().0.chunks_exact(STEPS);
    let found = maps.zip(MAPS).find_map(|(map, named)| Some((numbers_of(map)?, named)));
    let (codes, (name, [first, last], is_first_near)) = found.ok_or(PictureFault::ColoredDepth)?;
    let number = |code: u8| f32::from(if is_first_near { u8::MAX - code } else { code });
    let numbers = codes.into_iter().map(number).collect();
    let values = Values { size: picture.size(), numbers, samples: Samples::Eight, ..Values::default() };
    Ok(ColorMapped { values, name, ends: if is_first_near { [first, last] } else { [last, first] } })
}

/// Returns the number of the nearest colour of a map; `None` if none is within the tolerance.
fn find_nearest(map: &[[u8; 3]], color: [u8; 3]) -> Option<u8> {
    let distance = |entry: &[u8; 3]| (0..3).map(|channel| entry[channel].abs_diff(color[channel])).max().unwrap_or(0);
    let nearest = (0..=u8::MAX).min_by_key(|&number| distance(&map[usize::from(number)]))?;
    (distance(&map[usize::from(nearest)]) <= TOLERANCE).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::still;
    use bokehcam::frame::ColorImage;

    /// Writes a ramp in the colours of a map, each channel off by at most `off`, and reads it.
    fn ramp(at: usize, steps: usize, off: i16) -> Result<ColorMapped, PictureFault> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ramp.png");
        let mut picture = ColorImage::new(256, 2);
        for (pixel, rgb) in picture.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let number = (pixel % 256) / (256 / steps) * (256 / steps);
            *rgb = COLORS.as_chunks::<3>().0[at * STEPS + number];
            rgb[pixel % 3] = (i16::from(rgb[pixel % 3]) + off).clamp(0, 255) as u8;
        }
        still::write_color(&path, &picture, false).unwrap();
        read(&path)
    }

    #[test]
    fn numbers_are_recovered_from_exact_colours_only() {
        for (at, (name, ends, is_first_near)) in MAPS.into_iter().enumerate() {
            let found = ramp(at, 256, 0).unwrap();
            assert_eq!(found.name, name);
            assert_eq!(found.ends[1], ends[usize::from(is_first_near)]);
            for (k, number) in found.values.numbers.iter().enumerate() {
                let expected = if is_first_near { 255 - k % 256 } else { k % 256 } as f32;
                // viridis and jet have a few equal colours.
                assert!((number - expected).abs() <= 3.0, "{name}: {number} at {k}");
            }
            assert_eq!(ramp(at, 64, 1).unwrap().name, name, "as other programs round");
            assert!(matches!(ramp(at, 256, 9), Err(PictureFault::ColoredDepth)), "{name}, as a JPEG or enlarged");
            assert!(matches!(ramp(at, 16, 0), Err(PictureFault::ColoredDepth)), "{name}, a drawing");
        }
    }
}
