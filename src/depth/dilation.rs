//! Dilation of binary masks.

/// Dilates `plane` by a square of `2 * radius_px + 1` pixels: rows first, then columns. `line` is scratch memory.
pub fn dilate(plane: &mut [bool], line: &mut Vec<bool>, width: usize, radius_px: usize) {
    let height = plane.len() / width.max(1);
    let mut along = |first: usize, step: usize, count: usize| {
        line.clear();
        line.extend((0..count).map(|k| plane[first + k * step]));
        for reversed in [false, true] {
            let mut remaining = 0;
            for k in (0..count).map(|k| if reversed { count - 1 - k } else { k }) {
                remaining = if line[k] { radius_px + 1 } else { remaining };
                plane[first + k * step] |= remaining > 0;
                remaining = remaining.saturating_sub(1);
            }
        }
    };
    (0..height).for_each(|y| along(y * width, 1, width));
    (0..width).for_each(|x| along(x, width, height));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_widened_by_so_many_pixels_each_way() {
        let mut plane = vec![false; 11 * 9];
        plane[4 * 11 + 5] = true;
        dilate(&mut plane, &mut Vec::new(), 11, 2);
        let marked = |at: usize| (at % 11).abs_diff(5) <= 2 && (at / 11).abs_diff(4) <= 2;
        assert!((0..99).all(|at| plane[at] == marked(at)));
    }
}
