//! Half the columns and rows: pictures down, and disparities up again.

use crate::frame::GrayImage;

/// Columns and rows of half a picture.
pub fn size((width, height): (usize, usize)) -> (usize, usize) {
    (width.div_ceil(2), height.div_ceil(2))
}

/// The means of 2x2 pixels; a last odd column or row is its own neighbour.
pub fn shrink(from: &GrayImage, into: &mut GrayImage) {
    into.resize(from.width.div_ceil(2), from.height.div_ceil(2));
    let (width, height) = (from.width as usize, from.height as usize);
    for (y, out) in into.luma.chunks_exact_mut(width.div_ceil(2)).enumerate() {
        let upper = &from.luma[2 * y * width..][..width];
        let lower = &from.luma[(2 * y + 1).min(height - 1) * width..][..width];
        let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
        for (out, (upper, lower)) in out.iter_mut().zip(pairs) {
            let sum = upper.iter().chain(lower).map(|&luma| u16::from(luma)).sum::<u16>();
            *out = ((sum + 2) / 4) as u8;
        }
        if width % 2 == 1 {
            out[width / 2] = (u16::from(upper[width - 1]) + u16::from(lower[width - 1])).div_ceil(2) as u8;
        }
    }
}

/// Disparities of a whole picture from those of its half: of the four that are near, a pixel takes that of the one which
/// is as bright as itself, so that the edges follow the picture. `small` is the half of `whole`, and `px` its
/// disparities.
pub fn grow(whole: &GrayImage, small: &GrayImage, px: &[f32], into: &mut [f32]) {
    let (width, height) = (whole.width as usize, whole.height as usize);
    let (columns, rows) = (small.width as usize, small.height as usize);
    for (y, (out, luma)) in into.chunks_exact_mut(width).zip(whole.luma.chunks_exact(width)).enumerate().take(height) {
        // Even rows and columns lie nearer to the one before, odd ones nearer to the one after.
        let near = y / 2;
        let other = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(rows - 1) };
        for (x, (out, &luma)) in out.iter_mut().zip(luma).enumerate() {
            let at = x / 2;
            let beside = if x % 2 == 0 { at.saturating_sub(1) } else { (at + 1).min(columns - 1) };
            let mut best = (u8::MAX, 0.0);
            for place in [near * columns + at, near * columns + beside, other * columns + at, other * columns + beside]
            {
                let apart = small.luma[place].abs_diff(luma);
                if apart < best.0 || place == near * columns + at {
                    best = (apart, px[place]);
                }
            }
            *out = 2.0 * best.1;
        }
    }
}
