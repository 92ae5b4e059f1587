//! Fills occlusions at the border by colour similarity: a pixel with the colour of a surface that both cameras see
//! belongs to that surface.
//!
//! The left border is filled along the picture ([`super::mismatches`]), which misses objects that stand in front of it and
//! touch nothing that the right camera sees: leaves before a wall become wall. If nearly all known pixels of a colour
//! lie on one surface, border pixels of that colour do, too, and take its disparity where theirs differs.

use std::ops::AddAssign;

use super::Settings;
use super::fixed::{ONE, UNKNOWN, is_known};
use crate::frame::ColorImage;

/// Disparities this far apart, in fixed point, belong to different surfaces.
const MIN_GAP: u16 = 8 * ONE;
/// Number of disparity bins, each [`MIN_GAP`] wide.
const BINS: usize = Settings::MAX_DISPARITIES as usize * ONE as usize / MIN_GAP as usize + 1;
/// Number of colour bins.
const COLORS: usize = 1 << 12;
/// Colours are learned from this many times as many columns as the border has at its widest.
const LEARNED_WIDTHS: usize = 4;
/// Known pixels that a colour needs to identify a surface.
const MIN_PIXELS: u32 = 16;
/// A colour identifies a surface with at least this many eighths of its pixels.
const MIN_EIGHTHS: u32 = 7;
/// Spacing in pixels of the 3x3 samples around a pixel, of which more than half must be on its surface.
const SPACING_PX: usize = 2;

/// The colours of a map's pixels.
#[derive(Clone, Copy)]
pub struct Colors<'a> {
    /// The picture, as large as the map times `stride`.
    pub image: &'a ColorImage,
    /// Step in columns and rows of the picture from one pixel of the map to the next.
    pub stride: usize,
}

impl Colors<'_> {
    /// Returns the colour bin of a pixel: 5 bits for each of two channel differences, which shading changes little, and
    /// 2 for the brightness.
    fn color_bin_at(&self, x: usize, y: usize) -> usize {
        let at = 3 * self.stride * (y * self.image.width as usize + x);
        let [red, green, blue] = [0, 1, 2].map(|channel| usize::from(self.image.rgb[at + channel]));
        (red + 256 - green) >> 4 << 7 | (blue + 256 - green) >> 4 << 2 | (red + 2 * green + blue) >> 8
    }
}

/// Whether a colour bin is grey, with all channels about equal. Greys are everywhere, above all in grey pictures, and
/// identify no surface.
fn is_grey(color: usize) -> bool {
    // Differences are shifted to be positive: bins 15 and 16 are those around 0.
    [color >> 7, color >> 2 & 31].iter().all(|difference| [15, 16].contains(difference))
}

/// A number of pixels and the sum of their disparities in 1/8 px, which fits for pictures of 8 million pixels.
#[derive(Clone, Copy, Debug, Default)]
struct DisparitySum {
    count: u32,
    sum: u32,
}

impl DisparitySum {
    const UNIT: u16 = ONE / 8;

    fn mean(self) -> u16 {
        (self.sum / self.count) as u16 * Self::UNIT
    }
}

impl AddAssign for DisparitySum {
    fn add_assign(&mut self, other: Self) {
        self.count += other.count;
        self.sum += other.sum;
    }
}

/// Fills by colour; owns its buffers.
#[derive(Debug, Default)]
pub struct ColorSimilarity {
    /// Known pixels by colour and disparity bin.
    sums: Vec<[DisparitySum; BINS]>,
    /// Number of known pixels by colour.
    counts: Vec<u32>,
    /// Disparity of the surface that each colour identifies, or unknown.
    surfaces: Vec<u16>,
    /// Disparity of the surface that each border pixel's colour identifies, `[row][column]`.
    border_surfaces: Vec<u16>,
}

impl ColorSimilarity {
    /// Corrects the filled pixels of `map`: those left of column `first` of their row.
    pub fn correct(&mut self, map: &mut [u16], width: usize, first: &[usize], colors: Colors) {
        self.clear_and_reserve(map.len());
        let columns = first.iter().max().map_or(0, |&most| (most + 1).min(width));
        if columns < 2 {
            return;
        }
        self.learn_surfaces(map, width, first, (LEARNED_WIDTHS * columns).min(width), colors);
        for y in 0..first.len() {
            self.border_surfaces.extend((0..columns).map(|x| self.surfaces[colors.color_bin_at(x, y)]));
        }
        for (y, (row, &first)) in map.chunks_exact_mut(width).zip(first).enumerate() {
            for (x, d) in row[..first].iter_mut().enumerate() {
                let surface = self.border_surfaces[y * columns + x];
                if surface != UNKNOWN && surface.abs_diff(*d) >= MIN_GAP && self.has_support(surface, x, y, columns) {
                    *d = surface;
                }
            }
        }
    }

    /// Clears the results and reserves the memory for maps of `pixels` pixels, so that a wider border later allocates
    /// nothing.
    fn clear_and_reserve(&mut self, pixels: usize) {
        self.sums.resize(COLORS, [DisparitySum::default(); BINS]);
        self.counts.resize(COLORS, 0);
        self.surfaces.clear();
        self.surfaces.reserve(COLORS);
        self.border_surfaces.clear();
        self.border_surfaces.reserve(pixels);
    }

    /// Learns which surface each colour identifies, from every other column and row of the known pixels of the first
    /// `end` columns; `first` has the first known column of each row.
    fn learn_surfaces(&mut self, map: &[u16], width: usize, first: &[usize], end: usize, colors: Colors) {
        self.counts.fill(0);
        for (y, (row, &first)) in map.chunks_exact(width).zip(first).enumerate().step_by(2) {
            for (x, &d) in row[..end].iter().enumerate().skip(first).step_by(2) {
                if is_known(d) {
                    let color = colors.color_bin_at(x, y);
                    // Cleared on first use: most colours do not occur.
                    if self.counts[color] == 0 {
                        self.sums[color] = [DisparitySum::default(); BINS];
                    }
                    self.counts[color] += 1;
                    let bin = usize::from(d / MIN_GAP).min(BINS - 1);
                    self.sums[color][bin] += DisparitySum { count: 1, sum: u32::from(d / DisparitySum::UNIT) };
                }
            }
        }
        self.surfaces.extend(self.counts.iter().zip(&self.sums).enumerate().map(|(color, (&count, sums))| {
            if count < MIN_PIXELS || is_grey(color) {
                return UNKNOWN;
            }
            // A surface may extend over two adjacent bins.
            let mut best = DisparitySum::default();
            for pair in sums.windows(2) {
                let mut both = pair[0];
                both += pair[1];
                if both.count > best.count {
                    best = both;
                }
            }
            if 8 * best.count >= MIN_EIGHTHS * count { best.mean() } else { UNKNOWN }
        }));
    }

    /// Whether most pixels around a border pixel have colours of this surface.
    fn has_support(&self, surface: u16, x: usize, y: usize, columns: usize) -> bool {
        let rows = self.border_surfaces.len() / columns;
        let mut same = 0;
        for y in [y.saturating_sub(SPACING_PX), y, (y + SPACING_PX).min(rows - 1)] {
            for x in [x.saturating_sub(SPACING_PX), x, (x + SPACING_PX).min(columns - 1)] {
                let other = self.border_surfaces[y * columns + x];
                same += u32::from(other != UNKNOWN && other.abs_diff(surface) < MIN_GAP);
            }
        }
        same > 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREEN: [u8; 3] = [60, 140, 50];
    const WALL: [u8; 3] = [170, 150, 120];
    const RED: [u8; 3] = [190, 30, 40];
    const SIZE: (usize, usize) = (80, 40);
    const UNSEEN: usize = 16;
    const NEAR: u16 = 60 * ONE;
    const FAR: u16 = 10 * ONE;

    fn is_patch(x: usize, y: usize) -> bool {
        (4..12).contains(&x) && (10..20).contains(&y)
    }

    fn is_near(x: usize) -> bool {
        (50..70).contains(&x)
    }

    /// Corrects a scene with a near green surface before a far wall, and a patch of this colour in the border, filled
    /// as wall.
    fn corrected(patch: [u8; 3], stride: usize) -> Vec<u16> {
        let (width, height) = SIZE;
        let mut image = ColorImage::new((width * stride) as u32, (height * stride) as u32);
        for (k, rgb) in image.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let (x, y) = (k % (width * stride) / stride, k / (width * stride) / stride);
            *rgb = if is_patch(x, y) {
                patch
            } else if is_near(x) {
                GREEN
            } else {
                WALL
            };
        }
        let mut map: Vec<u16> = (0..width * height).map(|k| if is_near(k % width) { NEAR } else { FAR }).collect();
        ColorSimilarity::default().correct(&mut map, width, &vec![UNSEEN; height], Colors { image: &image, stride });
        map
    }

    #[test]
    fn a_patch_of_the_near_surfaces_colour_is_near() {
        for stride in [1, 2] {
            for (k, d) in corrected(GREEN, stride).into_iter().enumerate() {
                let (x, y) = (k % SIZE.0, k / SIZE.0);
                // Its corners have too few pixels of their colour around them.
                let corner = [4, 5, 10, 11].contains(&x) && [10, 11, 18, 19].contains(&y);
                if !corner {
                    assert_eq!(d, if is_near(x) || is_patch(x, y) { NEAR } else { FAR }, "{x}, {y}");
                }
            }
        }
    }

    #[test]
    fn an_unknown_colour_and_one_of_many_surfaces_and_grey_say_nothing() {
        for row in corrected(RED, 1).chunks_exact(SIZE.0) {
            assert_eq!(row[..UNSEEN], [FAR; UNSEEN]);
        }
        let (width, height) = SIZE;
        let mut image = ColorImage::new(width as u32, height as u32);
        image.rgb = GREEN.repeat(width * height);
        let half: Vec<u16> = (0..width * height).map(|k| if k % width < 40 { FAR } else { NEAR }).collect();
        let mut map = half.clone();
        let colors = Colors { image: &image, stride: 1 };
        ColorSimilarity::default().correct(&mut map, width, &vec![UNSEEN; height], colors);
        assert_eq!(map, half);
        image.rgb.fill(100);
        let mut map: Vec<u16> = (0..width * height).map(|k| if k % width < UNSEEN { FAR } else { NEAR }).collect();
        let before = map.clone();
        let colors = Colors { image: &image, stride: 1 };
        ColorSimilarity::default().correct(&mut map, width, &vec![UNSEEN; height], colors);
        assert_eq!(map, before);
    }

    #[test]
    fn what_was_learned_before_is_forgotten() {
        let (width, height) = SIZE;
        let image = ColorImage { width: 80, height: 40, rgb: GREEN.repeat(width * height) };
        let first = vec![UNSEEN; height];
        let mut similarity = ColorSimilarity::default();
        for surface in [NEAR, FAR] {
            let mut map: Vec<u16> =
                (0..width * height).map(|k| if k % width < UNSEEN { 30 * ONE } else { surface }).collect();
            similarity.correct(&mut map, width, &first, Colors { image: &image, stride: 1 });
            assert_eq!(map, vec![surface; width * height]);
        }
    }
}
