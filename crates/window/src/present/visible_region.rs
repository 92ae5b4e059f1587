//! Geometry of a zoomed picture, of which only a part is visible, and of a fitted one.

use super::Area;

/// The visible part of a picture that is zoomed by an integer factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VisibleRegion {
    /// Window pixels per picture pixel, > 0.
    pub factor: u32,
    /// Column and row of the zoomed picture, in display orientation (mirrored), at the area's top left.
    pub origin: (u32, u32),
}

/// Computes where a picture of `size`, zoomed by an integer `factor`, lies in a window, and which part is visible.
/// `center` is the point to centre, as fractions of the picture in display orientation, clamped so that no space is
/// wasted.
pub fn zoomed_area(size: (u32, u32), window: (u32, u32), factor: u32, center: [f32; 2]) -> (Area, VisibleRegion) {
    let side = |side: u32, window: u32, center: f32| {
        let whole = side.saturating_mul(factor);
        let hidden = whole.saturating_sub(window);
        let at = (center * whole as f32 - window as f32 / 2.0).round().clamp(0.0, hidden as f32) as u32;
        // Offset and length of the area, and the hidden pixels before it.
        (window.saturating_sub(whole) / 2, whole.min(window), at.min(hidden))
    };
    let (x, width, left) = side(size.0, window.0, center[0]);
    let (y, height, above) = side(size.1, window.1, center[1]);
    (Area { x, y, width, height }, VisibleRegion { factor, origin: (left, above) })
}

/// Returns the largest area with the aspect ratio of `size` within `window`, centred.
pub fn fitted_area(size: (u32, u32), window: (u32, u32)) -> Area {
    let [width, height, all_width, all_height] = [size.0, size.1, window.0, window.1].map(u64::from);
    if width == 0 || height == 0 || all_width == 0 || all_height == 0 {
        return Area::default();
    }
    // One side limits; the other one is rounded to whole pixels.
    let fills_width = all_width * height <= all_height * width;
    let (fit_width, fit_height) = match fills_width {
        true => (all_width, (all_width * height + width / 2) / width),
        false => ((all_height * width + height / 2) / height, all_height),
    };
    let (fit_width, fit_height) = (fit_width.clamp(1, all_width), fit_height.clamp(1, all_height));
    // All four are at most the window's sides.
    let px = |side: u64| u32::try_from(side).unwrap_or(u32::MAX);
    let (x, y) = (px((all_width - fit_width) / 2), px((all_height - fit_height) / 2));
    Area { x, y, width: px(fit_width), height: px(fit_height) }
}

impl VisibleRegion {
    /// Fills `line` (RGB) with the columns `from` of row `y` of the zoomed picture; `width` is the picture's unzoomed
    /// width.
    pub fn copy_row(self, rgb: &[u8], width: u32, y: usize, from: std::ops::Range<usize>, line: &mut [u8]) {
        let factor = self.factor.max(1) as usize;
        let row = &rgb.as_chunks::<3>().0[y / factor * width as usize..];
        for (pixel, column) in line.as_chunks_mut::<3>().0.iter_mut().zip(from) {
            *pixel = row[column / factor];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_what_was_asked_for_and_nothing_is_left_empty() {
        let seen = |factor, center| zoomed_area((100, 50), (160, 120), factor, center);
        let area = |x, y, width, height| Area { x, y, width, height };
        assert_eq!(seen(1, [0.5, 0.5]), (area(30, 35, 100, 50), VisibleRegion { factor: 1, origin: (0, 0) }));
        assert_eq!(seen(2, [0.5, 0.5]), (area(0, 10, 160, 100), VisibleRegion { factor: 2, origin: (20, 0) }));
        assert_eq!(seen(4, [0.5, 0.25]), (area(0, 0, 160, 120), VisibleRegion { factor: 4, origin: (120, 0) }));
        assert_eq!(seen(4, [1.0, 1.0]), (area(0, 0, 160, 120), VisibleRegion { factor: 4, origin: (240, 80) }));
        assert_eq!(seen(4, [f32::NAN, -3.0]).1.origin, (0, 0));
        assert_eq!(zoomed_area((100, 50), (0, 0), 2, [0.5; 2]).0, area(0, 0, 0, 0));
    }

    #[test]
    fn the_picture_is_as_large_as_it_fits_and_keeps_its_shape() {
        let area = |x, y, width, height| Area { x, y, width, height };
        assert_eq!(fitted_area((640, 360), (1280, 720)), area(0, 0, 1280, 720));
        assert_eq!(fitted_area((640, 480), (1280, 720)), area(160, 0, 960, 720));
        assert_eq!(fitted_area((640, 360), (300, 720)), area(0, 275, 300, 169));
        assert_eq!(fitted_area((1, 5000), (300, 200)), area(149, 0, 1, 200));
        assert_eq!(fitted_area((640, 360), (0, 720)), Area::default());
        assert_eq!(fitted_area((0, 0), (300, 200)), Area::default());
    }
}
