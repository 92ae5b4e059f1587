//! Letterboxing: scales a whole picture to another size without distortion; the remaining two sides are black bars.

use super::ColorImage;
use super::scale::RowScaler;

/// Scales pictures; caches scratch memory and weights.
#[derive(Debug, Default)]
pub struct Letterbox {
    scale: RowScaler,
    row: Vec<u16>,
}

/// Position of the scaled picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LetterboxRect {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Letterbox {
    /// Scales `from` to the largest size that fits `into`, centred, with black bars on two sides. Enlarges bilinearly;
    /// shrinks with a triangle filter twice as wide as a new pixel, which avoids aliasing. Pictures of equal size are
    /// copied. Allocates only when either size changes.
    pub fn fit(&mut self, from: &ColorImage, into: &mut ColorImage) {
        if from.size() == into.size() {
            into.rgb.copy_from_slice(&from.rgb);
            return;
        }
        let [from_width, from_height, width, height] =
            [from.width, from.height, into.width, into.height].map(|side| side as usize);
        let Some(rect) = letterbox_rect((from_width, from_height), (width, height)) else {
            into.rgb.fill(0);
            return;
        };
        self.scale.set_sizes((from_width, from_height), (rect.width, rect.height));

        let (above, rest) = into.rgb.split_at_mut(3 * width * rect.top);
        let (rows, below) = rest.split_at_mut(3 * width * rect.height);
        above.fill(0);
        below.fill(0);
        for (y, line) in rows.chunks_exact_mut(3 * width).enumerate() {
            let (left, rest) = line.split_at_mut(3 * rect.left);
            let (scaled, right) = rest.split_at_mut(3 * rect.width);
            left.fill(0);
            right.fill(0);
            self.scale.scale_row(&from.rgb, y, 0..rect.width, &mut self.row, scaled);
        }
    }

    /// Returns `from` if it has the size of `target`, else its [`fit`](Self::fit) in `target`.
    pub fn fit_if_needed<'a>(&mut self, from: &'a ColorImage, target: &'a mut ColorImage) -> &'a ColorImage {
        if from.size() == target.size() {
            return from;
        }
        self.fit(from, target);
        target
    }
}

/// Returns the position of the scaled picture; `None` if either picture has no pixels.
fn letterbox_rect(from: (usize, usize), into: (usize, usize)) -> Option<LetterboxRect> {
    if from.0 == 0 || from.1 == 0 || into.0 == 0 || into.1 == 0 {
        return None;
    }
    // One side fills its own exactly; the other follows, rounded.
    let scaled = |side: usize, to: usize, of: usize| ((side * to + of / 2) / of).max(1);
    let (width, height) = if from.0 * into.1 >= from.1 * into.0 {
        (into.0, scaled(from.1, into.0, from.0).min(into.1))
    } else {
        (scaled(from.0, into.1, from.1).min(into.0), into.1)
    };
    // Even, because chroma subsampling shares colour between pairs of pixels.
    Some(LetterboxRect { left: ((into.0 - width) / 2) & !1, top: ((into.1 - height) / 2) & !1, width, height })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, paint: impl Fn(u32, u32) -> [u8; 3]) -> ColorImage {
        let rgb = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| paint(x, y)).collect();
        ColorImage { width, height, rgb }
    }

    fn fitted(from: &ColorImage, (width, height): (u32, u32)) -> ColorImage {
        // Old content must not be visible.
        let mut into = picture(width, height, |_, _| [77; 3]);
        Letterbox::default().fit(from, &mut into);
        into
    }

    fn at(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
        image.rgb.as_chunks::<3>().0[(y * image.width + x) as usize]
    }

    #[test]
    fn equal_sizes_are_copied() {
        let from = picture(7, 5, |x, y| [x as u8 * 9, y as u8 * 30, 3]);
        assert_eq!(fitted(&from, (7, 5)), from);
    }

    #[test]
    fn a_constant_picture_stays_constant_and_its_bars_are_black() {
        let color = [200, 3, 255];
        for (from, into, rect) in [
            ((640, 480), (1280, 720), LetterboxRect { left: 160, top: 0, width: 960, height: 720 }),
            ((1920, 1080), (640, 480), LetterboxRect { left: 0, top: 60, width: 640, height: 360 }),
            ((640, 480), (640, 360), LetterboxRect { left: 80, top: 0, width: 480, height: 360 }),
            ((1, 1), (9, 4), LetterboxRect { left: 2, top: 0, width: 4, height: 4 }),
            ((3, 1000), (20, 10), LetterboxRect { left: 8, top: 0, width: 1, height: 10 }),
            ((1280, 720), (320, 180), LetterboxRect { left: 0, top: 0, width: 320, height: 180 }),
        ] {
            let scaled = fitted(&picture(from.0, from.1, |_, _| color), into);
            let inside = |x: u32, y: u32| {
                (rect.left..rect.left + rect.width).contains(&(x as usize))
                    && (rect.top..rect.top + rect.height).contains(&(y as usize))
            };
            let expected = picture(into.0, into.1, |x, y| if inside(x, y) { color } else { [0; 3] });
            assert_eq!(scaled, expected, "{from:?} into {into:?}");
        }
    }

    #[test]
    fn a_ramp_stays_where_it_is() {
        for (from, into) in [((64, 36), (256, 144)), ((256, 144), (64, 36)), ((240, 135), (160, 90))] {
            let ramp = |size: (u32, u32)| {
                move |x: u32, y: u32| {
                    let part = |at: u32, of: u32| (255.0 * (f64::from(at) + 0.5) / f64::from(of)).round() as u8;
                    [part(x, size.0), part(y, size.1), 128]
                }
            };
            let (scaled, expected) =
                (fitted(&picture(from.0, from.1, ramp(from)), into), picture(into.0, into.1, ramp(into)));
            // Excludes the edges, where half a filter is missing.
            for (x, y) in (8..into.1 - 8).flat_map(|y| (8..into.0 - 8).map(move |x| (x, y))) {
                for (got, wanted) in at(&scaled, x, y).into_iter().zip(at(&expected, x, y)) {
                    assert!(got.abs_diff(wanted) <= 1, "{from:?} into {into:?} at {x}, {y}: {got} not {wanted}");
                }
            }
        }
    }

    #[test]
    fn shrinking_does_not_alias() {
        let stripes = picture(1280, 720, |x, _| [255 * (x % 2) as u8; 3]);
        let scaled = fitted(&stripes, (426, 240));
        for x in 2..424 {
            assert!(at(&scaled, x, 100)[0].abs_diff(127) < 16, "{x}: {:?}", at(&scaled, x, 100));
        }
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert!(fitted(&ColorImage::new(0, 0), (4, 4)).rgb.iter().all(|&value| value == 0));
        assert!(fitted(&ColorImage::new(4, 4), (0, 3)).rgb.is_empty());
    }
}
