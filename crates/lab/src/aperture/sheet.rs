//! Draws the analysis of one aperture: kernel and approximations above, signed differences below.

use super::analysis::Analysis;
use bokehcam::color::encode_srgb;
use bokehcam::frame::ColorImage;

/// Space around and between the panels, in pixels.
const MARGIN_PX: usize = 12;
/// Height of the line with the ranks, in pixels.
const LABEL_PX: usize = 26;
/// Approximate side of a magnified panel, in pixels.
const PANEL_PX: usize = 200;
/// A difference of this fraction of the plateau gets the full colour.
const FULL_DIFFERENCE: f64 = 0.5;

const PAPER: [u8; 3] = [228, 228, 228];
const INK: [u8; 3] = [40, 40, 40];
const BLUE: [f64; 3] = [33.0, 102.0, 172.0];
const RED: [f64; 3] = [178.0, 24.0, 43.0];

/// Digits on a 3 x 5 grid, one row per three bits, the top row first.
const DIGITS: [u16; 10] = [
    0b111_101_101_101_111,
    0b010_110_010_010_111,
    0b111_001_111_100_111,
    0b111_001_111_001_111,
    0b101_101_111_001_001,
    0b111_100_111_001_111,
    0b111_100_111_101_111,
    0b111_001_010_010_010,
    0b111_101_111_101_111,
    0b111_101_111_001_111,
];
/// Pixels per cell of a digit.
const DIGIT_CELL_PX: usize = 3;

/// Draws the sheet: the kernel, then one column per rank under its number. Negative taps of an approximation are blue;
/// a difference is red where the approximation is too large, and blue where it is too small.
pub fn draw_sheet(analysis: &Analysis) -> ColorImage {
    let zoom = (PANEL_PX / analysis.size).max(1);
    let panel = analysis.size * zoom;
    let columns = 1 + analysis.approximations.len();
    let width = MARGIN_PX + columns * (panel + MARGIN_PX);
    let height = LABEL_PX + 2 * (panel + MARGIN_PX) + MARGIN_PX;
    let mut sheet = Sheet { image: ColorImage::new(width as u32, height as u32), zoom, size: analysis.size };
    sheet.image.rgb.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&PAPER));

    let left = |column: usize| MARGIN_PX + column * (panel + MARGIN_PX);
    let (upper, lower) = (LABEL_PX + MARGIN_PX / 2, LABEL_PX + MARGIN_PX / 2 + panel + MARGIN_PX);
    let tap_color = |tap: f64| tap_color(tap / analysis.plateau);
    sheet.draw_panel(left(0), upper, analysis.kernel.iter().map(|&tap| tap_color(tap)));
    for (column, approximation) in (1..).zip(&analysis.approximations) {
        sheet.draw_number(left(column), panel, approximation.rank);
        sheet.draw_panel(left(column), upper, approximation.taps.iter().map(|&tap| tap_color(tap)));
        let differences = approximation.taps.iter().zip(&analysis.kernel).map(|(tap, exact)| tap - exact);
        sheet.draw_panel(left(column), lower, differences.map(|d| difference_color(d / analysis.plateau)));
    }
    sheet.image
}

/// Returns the colour of a tap relative to the plateau: black to white for 0 to 1, blue below 0.
fn tap_color(tap: f64) -> [u8; 3] {
    if tap < 0.0 {
        // The square root makes faint negative lobes visible.
        let strength = (-tap / FULL_DIFFERENCE).min(1.0).sqrt();
        return BLUE.map(|channel| (channel * strength) as u8);
    }
    [encode_srgb(tap as f32); 3]
}

fn difference_color(difference: f64) -> [u8; 3] {
    let strength = (difference.abs() / FULL_DIFFERENCE).min(1.0);
    let full = if difference < 0.0 { BLUE } else { RED };
    full.map(|channel| (255.0 + (channel - 255.0) * strength).round() as u8)
}

struct Sheet {
    image: ColorImage,
    /// Pixels per tap, each way.
    zoom: usize,
    /// Taps per row and column of a kernel.
    size: usize,
}

impl Sheet {
    /// Draws `size * size` colours in row-major order as a panel with its corner at (`left`, `top`).
    fn draw_panel(&mut self, left: usize, top: usize, colors: impl Iterator<Item = [u8; 3]>) {
        for (cell, color) in colors.enumerate() {
            let (column, row) = (cell % self.size, cell / self.size);
            self.fill_square(left + column * self.zoom, top + row * self.zoom, self.zoom, color);
        }
    }

    /// Draws a number in the label line, centred over the panel at `left` that is `panel` pixels wide.
    fn draw_number(&mut self, left: usize, panel: usize, number: usize) {
        let digits = number.to_string();
        // Three cells for a digit and one for space.
        let advance = 4 * DIGIT_CELL_PX;
        let mut x = left + panel.saturating_sub(digits.len() * advance) / 2;
        let top = LABEL_PX.saturating_sub(5 * DIGIT_CELL_PX);
        for digit in digits.bytes().map(|digit| usize::from(digit - b'0')) {
            for cell in (0..15).filter(|cell| DIGITS[digit] >> (14 - cell) & 1 == 1) {
                self.fill_square(x + cell % 3 * DIGIT_CELL_PX, top + cell / 3 * DIGIT_CELL_PX, DIGIT_CELL_PX, INK);
            }
            x += advance;
        }
    }

    fn fill_square(&mut self, left: usize, top: usize, side: usize, color: [u8; 3]) {
        let stride = self.image.width as usize * 3;
        for y in top..top + side {
            let row = &mut self.image.rgb[y * stride + left * 3..][..side * 3];
            row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&color));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::bokeh::aperture::Aperture;

    #[test]
    fn the_sheet_shows_the_kernel_white_and_equal_approximations_without_difference() {
        let analysis = Analysis::new("disc".into(), &Aperture::default().to_mask(9, 0.0), &[1, 9]);
        let sheet = draw_sheet(&analysis);
        let panel = 9 * (PANEL_PX / 9);
        let at = |x: usize, y: usize| {
            let pixel = (y * sheet.width as usize + x) * 3;
            [sheet.rgb[pixel], sheet.rgb[pixel + 1], sheet.rgb[pixel + 2]]
        };
        let top = LABEL_PX + MARGIN_PX / 2;
        let column = |n: usize| MARGIN_PX + n * (panel + MARGIN_PX);
        assert_eq!(at(column(0) + panel / 2, top + panel / 2), [255; 3]);
        assert_eq!(at(column(0) + 1, top + 1), [0; 3]);
        let below = top + panel + MARGIN_PX;
        assert!((0..panel).all(|i| at(column(2) + i, below + i) == [255; 3]), "rank 9 of 9 is exact");
        assert!((0..panel).any(|i| at(column(1) + i, below + i) != [255; 3]), "rank 1 is not");
        assert_eq!(at(0, 0), PAPER);
    }

    #[test]
    fn colours_tell_the_sign() {
        let [r, _, b] = difference_color(0.5);
        assert!(r > b);
        let [r, _, b] = difference_color(-0.5);
        assert!(b > r);
        assert_eq!(difference_color(0.0), [255; 3]);
    }
}
