//! Pictures of a blur's intermediates: light encoded as sRGB, CoC in two colours, coverage and radii in grey.

use bokehcam::bokeh::cpu::{compression_factor, expansion_factor};
use bokehcam::color::{encode_srgb, luminance};
use bokehcam::frame::ColorImage;

/// Colours of CoC in front of the focal plane, in it, and behind it (ColorBrewer's RdBu, safe for colour-blind
/// readers).
const NEAR: [f32; 3] = [178.0, 24.0, 43.0];
const FOCUS: [f32; 3] = [247.0, 247.0, 247.0];
const FAR: [f32; 3] = [33.0, 102.0, 172.0];
/// Two greys of the checkerboard that shows through transparent pixels, in linear light.
const SQUARES: [f32; 2] = [0.18, 0.25];
/// Side of a checkerboard square, in pixels of the picture.
const SQUARE_PX: usize = 16;

/// Builds a picture of `width` columns from one colour per pixel.
fn build_picture(width: usize, pixels: impl ExactSizeIterator<Item = [u8; 3]>) -> ColorImage {
    let height = pixels.len().checked_div(width).unwrap_or(0);
    ColorImage { width: width as u32, height: height as u32, rgb: pixels.flatten().collect() }
}

/// Draws signed CoC: red in front, white in focus, blue behind; saturated at `full_px`.
pub fn draw_coc(width: usize, coc_px: impl ExactSizeIterator<Item = f32>, full_px: f32) -> ColorImage {
    let color = |coc_px: f32| {
        let full = if coc_px < 0.0 { NEAR } else { FAR };
        let strength = if full_px > 0.0 { (coc_px.abs() / full_px).min(1.0) } else { 0.0 };
        std::array::from_fn(|p| (FOCUS[p] + (full[p] - FOCUS[p]) * strength).round() as u8)
    };
    build_picture(width, coc_px.map(color))
}

/// Draws values from 0 (black) to `white` (white), without gamma encoding: data, not light.
pub fn draw_grey(width: usize, values: impl ExactSizeIterator<Item = f32>, white: f32) -> ColorImage {
    let code = |value: f32| if white > 0.0 { (value / white * 255.0).clamp(0.0, 255.0).round() as u8 } else { 0 };
    build_picture(width, values.map(|value| [code(value); 3]))
}

/// Draws premultiplied linear light and coverage over a checkerboard, encoded as sRGB; highlights expanded by
/// `expansion` are compressed again. A pixel covers `scale` x `scale` pixels of the picture.
pub fn draw_light(width: usize, pixels: &[[f32; 4]], expansion: f32, scale: usize) -> ColorImage {
    let side = (SQUARE_PX / scale).max(1);
    let expands = expansion.is_finite();
    let color = |(k, &[r, g, b, coverage]): (usize, &[f32; 4])| {
        let square = SQUARES[(k % width / side + k / width / side) % 2];
        let square = if expands { square * expansion_factor(square, expansion) } else { square };
        let over = [r, g, b].map(|light| (light + square * (1.0 - coverage)).max(0.0));
        let factor = if expands { compression_factor(luminance(over[0], over[1], over[2]), expansion) } else { 1.0 };
        over.map(|light| encode_srgb(light * factor))
    };
    build_picture(width, pixels.iter().enumerate().map(color))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_the_coc_is_a_colour_and_focus_is_white() {
        let image = draw_coc(3, [-4.0, 0.0, 9.0].into_iter(), 4.0);
        assert_eq!(image.size(), (3, 1));
        assert_eq!(image.rgb, [178, 24, 43, 247, 247, 247, 33, 102, 172]);
        assert_eq!(draw_coc(1, [0.0].into_iter(), 0.0).rgb, [247; 3]);
    }

    #[test]
    fn light_is_encoded_and_nothing_shows_the_checkerboard() {
        let nothing = [[0.0; 4]; 17];
        for expansion in [f32::INFINITY, 1.1] {
            let image = draw_light(17, &nothing, expansion, 1);
            let squares = SQUARES.map(encode_srgb);
            assert_eq!((image.rgb[0], image.rgb[16 * 3]), squares.into());
        }
        // Half of the linear light is sRGB code 188, and full coverage hides the board.
        assert_eq!(draw_light(1, &[[0.5, 0.5, 0.5, 1.0]], f32::INFINITY, 1).rgb, [188; 3]);
        assert_eq!(draw_grey(2, [0.5, 2.0].into_iter(), 1.0).rgb, [128, 128, 128, 255, 255, 255]);
    }
}
