//! Transparent pixels: the colours of those with alpha 0 are not part of a picture.

/// Returns an 8-bit code as it is seen in front of white.
pub(super) fn over_white(code: u8, alpha: u8) -> u8 {
    let (code, alpha) = (u32::from(code), u32::from(alpha));
    ((code * alpha + 255 * (255 - alpha) + 127) / 255) as u8
}

/// Replaces the colours of pixels with alpha 0 in rows of `width` by those of the nearest visible ones, so that a blur
/// mixes no hidden colour into what is seen. Without a visible pixel, nothing changes.
pub(super) fn fill_hidden<T: Copy>(pixels: &mut [[T; 3]], alpha: &[u16], width: usize) {
    if !alpha.contains(&0) {
        return;
    }
    // Distances by chamfer steps of 3 and 4 (Borgefors 1986), in one sweep down and one up.
    let mut distance: Vec<u32> = alpha.iter().map(|&alpha| if alpha == 0 { u32::MAX / 2 } else { 0 }).collect();
    let mut take = |at: usize, from: usize, step: u32| {
        let through = distance[from].saturating_add(step);
        if through < distance[at] {
            (distance[at], pixels[at]) = (through, pixels[from]);
        }
    };
    let mut sweep = |at: usize, is_down: bool| {
        let (column, last) = (at % width, width - 1);
        let (before, above) = if is_down { (at.wrapping_sub(1), at.wrapping_sub(width)) } else { (at + 1, at + width) };
        let (starts, ends) = if is_down { (column == 0, column == last) } else { (column == last, column == 0) };
        if !starts {
            take(at, before, 3);
        }
        if above < alpha.len() {
            take(at, above, 3);
            let towards = |offset: usize| if is_down { above - offset } else { above + offset };
            if !starts {
                take(at, towards(1), 4);
            }
            if !ends {
                take(at, if is_down { above + 1 } else { above - 1 }, 4);
            }
        }
    };
    (0..alpha.len()).for_each(|at| sweep(at, true));
    (0..alpha.len()).rev().for_each(|at| sweep(at, false));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_colours_become_those_of_the_nearest_visible_pixel() {
        let width = 5;
        let mut pixels = [[9_u8; 3]; 20];
        let mut alpha = [0_u16; 20];
        for (at, color) in [(6, 1), (18, 2)] {
            (pixels[at], alpha[at]) = ([color; 3], 1);
        }
        fill_hidden(&mut pixels, &alpha, width);
        let nearest: [u8; 20] = [1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 1, 1, 1, 2, 2, 1, 1, 2, 2, 2];
        let filled: Vec<u8> = pixels.iter().map(|pixel| pixel[0]).collect();
        // Places as near to both may take either.
        let differing = filled.iter().zip(nearest).filter(|(a, b)| *a != b).count();
        assert!(differing <= 3 && !filled.contains(&9), "{filled:?}");
        let mut hidden = [[9_u8; 3]; 4];
        fill_hidden(&mut hidden, &[0; 4], 2);
        assert_eq!(hidden, [[9; 3]; 4]);
    }

    #[test]
    fn nothing_is_white_and_all_is_itself() {
        assert_eq!([over_white(7, 0), over_white(7, 255), over_white(0, 128)], [255, 7, 127]);
    }
}
