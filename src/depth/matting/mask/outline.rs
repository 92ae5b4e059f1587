//! The outline of a mask that a person or another program made: moved, softened, and fitted to the picture's colours.

use super::MaskMatting;
use crate::frame::{ColorImage, DepthMap, Mask};

/// Largest error of a sharp outline that colours correct, in pixels, about.
const REACH_PX: usize = 8;
/// Mask values between these are undecided.
const UNDECIDED: std::ops::Range<f32> = 0.05..0.95;
/// Largest width of the undecided edge of a sharp mask, in pixels, about.
const SHARP_PX: usize = 4;
/// Separation of both surfaces' colours, in standard deviations: up to the first the mask decides, from the second on
/// the colours do.
const UNCLEAR: f32 = 2.0;
const CLEAR: f32 = 4.0;

/// How the outline of a mask is used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outline {
    /// Distance by which it is moved outwards first, in pixels of the picture; inwards if negative.
    pub grow_px: i32,
    /// Half the width of the soft transition that it becomes last, in pixels.
    pub feather_px: usize,
    /// Whether it is taken as it is. Otherwise, it is fitted to the picture's colours: where the mask is undecided, and
    /// within a few pixels of the outline of a sharp mask.
    pub is_exact: bool,
}

/// Returns a depth map in which `mask` is the subject, and all else is far.
pub fn depth_from_mask(mask: &Mask, outline: Outline, color: &ColorImage) -> DepthMap {
    let mut map = DepthMap { subject_m: Some(DepthMap::SUBJECT_M), ..DepthMap::new(color.width, color.height) };
    let mut compute = |mask: &Mask, given: Option<&Mask>, follows_color: bool| {
        map.metres.fill(DepthMap::FAR_M);
        MaskMatting::default().compute_outlined(mask, (given, follows_color), color, None, &mut map);
        alpha_of(&map)
    };
    let mut mask = mask.clone();
    if outline.grow_px != 0 {
        // A square mask of another picture has other scales across and down.
        let sides = [(mask.width, color.width), (mask.height, color.height)];
        let scales = sides.map(|(side, of_picture)| side as f32 / of_picture.max(1) as f32);
        move_outline(&mut mask, scales.map(|scale| (outline.grow_px as f32 * scale).round() as i32));
    }
    let is_loosened = !outline.is_exact && (mask.width, mask.height) == color.size() && is_sharp(&mask);
    let mut fitted = match is_loosened {
        true => compute(&reduce(&mask, REACH_PX), Some(&mask), true),
        false => compute(&mask, None, !outline.is_exact),
    };
    if outline.feather_px > 0 {
        feather(&mut fitted, outline.feather_px);
        compute(&fitted, None, false);
    }
    map
}

/// Returns how much the colour decides, 0 to 1, if the variance along the line between both surfaces' colours is
/// 1 / `precision`.
pub(super) fn clarity(precision: f32) -> f32 {
    ((precision.sqrt() - UNCLEAR) / (CLEAR - UNCLEAR)).clamp(0.0, 1.0)
}

/// Whether the mask turns from black to white within a few pixels everywhere.
fn is_sharp(mask: &Mask) -> bool {
    let width = mask.width as usize;
    let undecided = mask.alpha.iter().filter(|alpha| UNDECIDED.contains(alpha)).count();
    let is_in = |at: usize| mask.alpha[at] > 0.5;
    let crosses = |at: usize| {
        (!at.is_multiple_of(width) && is_in(at) != is_in(at - 1)) || (at >= width && is_in(at) != is_in(at - width))
    };
    let outline = (0..mask.alpha.len()).filter(|&at| crosses(at)).count();
    outline > 0 && undecided <= SHARP_PX * outline
}

/// Returns the means of squares of about `side_px` pixels.
fn reduce(mask: &Mask, side_px: usize) -> Mask {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let [across, down] = [width, height].map(|side| (side + side_px / 2) / side_px).map(|side| side.max(1));
    let mut sums = vec![(0.0, 0.0); across * down];
    for (y, row) in mask.alpha.chunks_exact(width).enumerate() {
        for (x, alpha) in row.iter().enumerate() {
            let (sum, count) = &mut sums[y * down / height * across + x * across / width];
            (*sum, *count) = (*sum + alpha, *count + 1.0);
        }
    }
    let alpha = sums.into_iter().map(|(sum, count): (f32, f32)| sum / count).collect();
    Mask { width: across as u32, height: down as u32, alpha }
}

/// Returns the alpha of a map's subject.
fn alpha_of(map: &DepthMap) -> Mask {
    let mut alpha: Vec<f32> = map.metres.iter().map(|&metres| f32::from(metres <= DepthMap::SUBJECT_M)).collect();
    map.matte.pixels.iter().for_each(|pixel| alpha[pixel.at as usize] = pixel.alpha);
    Mask { width: map.width, height: map.height, alpha }
}

/// Dilates the mask by an ellipse of `px` across and down, or erodes it if negative.
fn move_outline(mask: &mut Mask, px: [i32; 2]) {
    let invert = |mask: &mut Mask| mask.alpha.iter_mut().for_each(|alpha| *alpha = 1.0 - *alpha);
    let is_inwards = px.iter().any(|&px| px < 0);
    if is_inwards {
        invert(mask);
    }
    let (width, [across, radius]) = (mask.width as usize, px.map(|px| i64::from(px.unsigned_abs())));
    let height = mask.height as usize;
    let before = mask.alpha.clone();
    let mut widened = vec![0.0; width];
    for down in -radius..=radius {
        // The ellipse's half width in this row; half a pixel more makes it round.
        let at = (down * across) as f64 / radius.max(1) as f64;
        let half = ((across * (across + 1)) as f64 - at * at).max(0.0).sqrt() as usize;
        for y in (0..height).filter(|y| (0..height as i64).contains(&(*y as i64 + down))) {
            widen(&before[(y as i64 + down) as usize * width..][..width], half, &mut widened);
            let row = &mut mask.alpha[y * width..][..width];
            row.iter_mut().zip(&widened).for_each(|(alpha, widened)| *alpha = alpha.max(*widened));
        }
    }
    if is_inwards {
        invert(mask);
    }
}

/// Writes to `widened` the largest value within `half` columns of each.
fn widen(row: &[f32], half: usize, widened: &mut [f32]) {
    // Candidates in falling order (Lemire 2006).
    let mut falling: std::collections::VecDeque<usize> = std::collections::VecDeque::new();
    for at in 0..row.len() + half {
        if let Some(&value) = row.get(at) {
            while falling.back().is_some_and(|&last| row[last] <= value) {
                falling.pop_back();
            }
            falling.push_back(at);
        }
        let Some(middle) = at.checked_sub(half) else { continue };
        while falling.front().is_some_and(|&first| first + half < middle) {
            falling.pop_front();
        }
        widened[middle] = falling.front().map_or(0.0, |&first| row[first]);
    }
}

/// Softens the outline to a transition of `px` pixels on both sides: two box filters, as a tent.
fn feather(mask: &mut Mask, px: usize) {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let mut sums = Vec::new();
    let mut average = |alpha: &mut [f32], first: usize, step: usize, count: usize, radius: usize| {
        sums.clear();
        sums.push(0.0f64);
        sums.extend((0..count).scan(0.0, |sum, at| {
            *sum += f64::from(alpha[first + at * step]);
            Some(*sum)
        }));
        for at in 0..count {
            let (from, to) = (at.saturating_sub(radius), (at + radius + 1).min(count));
            alpha[first + at * step] = ((sums[to] - sums[from]) / (to - from) as f64) as f32;
        }
    };
    for radius in [px / 2, px.div_ceil(2)] {
        (0..height).for_each(|y| average(&mut mask.alpha, y * width, 1, width, radius));
        (0..width).for_each(|x| average(&mut mask.alpha, x, width, height, radius));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask that is white where `is_in`.
    fn mask(width: u32, height: u32, is_in: impl Fn(i32, i32) -> bool) -> Mask {
        let at = |k: u32| ((k % width) as i32, (k / width) as i32);
        let alpha = (0..width * height).map(|k| f32::from(is_in(at(k).0, at(k).1))).collect();
        Mask { width, height, alpha }
    }

    /// A red disc of radius 30 before a blue wall, with the mask's outline moved by `error_px`.
    fn disc(error_px: i32) -> (ColorImage, Mask) {
        let radius = |x: i32, y: i32| f64::from((x - 60).pow(2) + (y - 60).pow(2)).sqrt();
        let mut color = ColorImage::new(120, 120);
        for (k, pixel) in color.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let (x, y) = (k as i32 % 120, k as i32 / 120);
            let grain = ((x * 7 + y * 13) % 11) as u8;
            *pixel = if radius(x, y) < 30.0 { [190 + grain, 40, 40] } else { [40, 60, 170 + grain] };
        }
        (color, mask(120, 120, |x, y| radius(x, y) < 30.0 + f64::from(error_px)))
    }

    fn area(mask: &Mask) -> f32 {
        mask.alpha.iter().sum()
    }

    #[test]
    fn outlines_move_by_so_many_pixels_and_back() {
        for px in [1, 3, 10] {
            let (_, disc_mask) = disc(0);
            let mut moved = disc_mask.clone();
            move_outline(&mut moved, [px; 2]);
            let expected = std::f32::consts::PI * (30.0 + px as f32).powi(2);
            assert!((area(&moved) / expected - 1.0).abs() < 0.02, "{px}: {} {expected}", area(&moved));
            move_outline(&mut moved, [-px; 2]);
            assert!((area(&moved) / area(&disc_mask) - 1.0).abs() < 0.01, "{px}");
            // Half planes at the border stay half planes.
            let mut half = mask(40, 9, |x, _| x < 20);
            move_outline(&mut half, [-px; 2]);
            assert_eq!(half, mask(40, 9, |x, _| x < 20 - px));
        }
    }

    #[test]
    fn the_outline_of_a_square_mask_moves_by_pixels_of_its_picture() {
        let color = ColorImage::new(160, 80);
        let given = mask(80, 80, |x, y| (20..60).contains(&x) && (20..60).contains(&y));
        for px in [-6, 0, 6] {
            let outline = Outline { grow_px: px, is_exact: true, ..Outline::default() };
            let moved = alpha_of(&depth_from_mask(&given, outline, &color));
            let count = |from: usize, step: usize, count: usize| {
                (0..count).filter(|at| moved.alpha[from + at * step] > 0.5).count() as i32
            };
            // Across the middle row, and down the middle column.
            assert_eq!((count(40 * 160, 1, 160), count(80, 160, 80)), (80 + 2 * px, 40 + 2 * px), "{px}");
        }
    }

    #[test]
    fn feathered_outlines_are_ramps_of_that_width() {
        for px in [1, 4, 7] {
            let mut half = mask(60, 5, |x, _| x < 30);
            feather(&mut half, px);
            let row = &half.alpha[120..180];
            assert!(row.is_sorted_by(|a, b| a >= b) && (row[29] + row[30] - 1.0).abs() < 1e-5, "{row:?}");
            assert_eq!((row[29 - px], row[30 + px]), (1.0, 0.0));
            assert!(row[30 - px] < 1.0 && row[29 + px] > 0.0);
        }
    }

    #[test]
    fn a_sharp_outline_moves_to_the_colours_and_an_exact_one_does_not() {
        let (_, right) = disc(0);
        for error_px in [-4, -2, 0, 2, 4] {
            let (color, given) = disc(error_px);
            let wrong = |outline: Outline| {
                let found = alpha_of(&depth_from_mask(&given, outline, &color));
                found.alpha.iter().zip(&right.alpha).map(|(a, b)| (a - b).abs()).sum::<f32>() / area(&right)
            };
            assert!(wrong(Outline::default()) < 0.02, "{error_px}: {}", wrong(Outline::default()));
            let exact = Outline { is_exact: true, ..Outline::default() };
            assert_eq!(alpha_of(&depth_from_mask(&given, exact, &color)), given);
            let corrected = Outline { grow_px: -error_px, ..exact };
            assert!(wrong(corrected) < 0.03, "{error_px}: {}", wrong(corrected));
        }
    }

    #[test]
    fn colours_that_say_nothing_leave_a_sharp_mask_as_it_is() {
        let grey = ColorImage { width: 64, height: 64, rgb: vec![120; 3 * 64 * 64] };
        let grainy: Vec<u8> = (0..3 * 64 * 64).map(|k| 100 + (k * k % 37) as u8).collect();
        for color in [grey, ColorImage { width: 64, height: 64, rgb: grainy }] {
            // A half, and bars that are narrower than the reach.
            for given in [mask(64, 64, |x, _| x < 32), mask(64, 64, |x, y| y > 40 || x % 16 < 5)] {
                let found = alpha_of(&depth_from_mask(&given, Outline::default(), &color));
                let wrong: f32 = found.alpha.iter().zip(&given.alpha).map(|(a, b)| (a - b).abs()).sum();
                assert!(wrong / area(&given) < 0.02, "{wrong}");
            }
        }
    }

    #[test]
    fn masks_of_any_size_are_taken() {
        for (width, height) in [(1, 1), (1, 7), (3, 1), (16, 16)] {
            let color = ColorImage::new(width, height);
            for given in
                [mask(width, height, |_, _| true), mask(width, height, |x, _| x == 0), mask(2, 2, |x, y| x == y)]
            {
                let outline = Outline { grow_px: -2, feather_px: 5, is_exact: false };
                assert_eq!(depth_from_mask(&given, outline, &color).size(), (width, height));
            }
        }
    }
}
