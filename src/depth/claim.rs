//! Holes beside the subject that are the subject.
//!
//! A sensor that sees with two eyes loses a strip beside whatever is near. Filled from behind, that strip takes hair
//! and shoulders along. Where the colours of the near and the far side of a hole differ, the colour of each pixel
//! tells which side it belongs to; the near side grows into the hole until the colour is no longer its own.

use crate::frame::{ColorImage, DepthMap};

/// Depths within this ratio are one surface: nothing to decide.
const SAME_SURFACE: f32 = 1.15;
/// Known pixels beside a hole whose mean colour stands for that side.
const SAMPLE_PX: usize = 4;
/// A pixel is the near side's if it is this much closer to its colour than to the far side's.
const PREFERENCE: f32 = 1.3;
/// How fast the near side's colour follows the pixels it takes.
const FOLLOW: f32 = 0.2;
/// A sensor's shadow is at most this share of the picture's width.
const LONGEST: f32 = 0.12;

/// Decides by colour which holes belong to the nearer side; owns the memory for it.
#[derive(Debug, Default)]
pub struct Claimer {
    claims_m: Vec<f32>,
}

impl Claimer {
    /// Moves holes (`hole`, one flag a pixel) of a map that was filled from behind to the near side that has their
    /// colour. Does nothing when the picture has another size than the map.
    pub fn claim(&mut self, map: &mut DepthMap, hole: &[bool], color: &ColorImage) {
        let width = map.width as usize;
        if color.size() != map.size() || width == 0 {
            return;
        }
        self.claims_m.clear();
        self.claims_m.resize(map.metres.len(), 0.0);
        let rows = map.metres.chunks_exact(width).zip(hole.chunks_exact(width));
        for ((row, hole), (claims, rgb)) in
            rows.zip(self.claims_m.chunks_exact_mut(width).zip(color.rgb.chunks_exact(3 * width)))
        {
            claim_row(row, hole, rgb, claims);
        }
        // One row alone may be mistaken: two of three must agree.
        for (y, row) in map.metres.chunks_exact_mut(width).enumerate() {
            for (x, metres) in row.iter_mut().enumerate() {
                let at = |y: usize| self.claims_m.get(y * width + x).copied().unwrap_or(0.0);
                let beside = [y.checked_sub(1).map_or(0.0, at), at(y + 1)];
                let votes = beside.iter().filter(|&&claim_m| claim_m > 0.0).count() + usize::from(at(y) > 0.0);
                if hole[y * width + x] && votes >= 2 {
                    *metres = metres.min(if at(y) > 0.0 { at(y) } else { beside[0].max(beside[1]) });
                }
            }
        }
    }
}

fn claim_row(row: &[f32], hole: &[bool], rgb: &[u8], claims: &mut [f32]) {
    let longest = ((row.len() as f32 * LONGEST) as usize).max(4);
    let mut start = 0;
    while let Some(first) = (start..row.len()).find(|&x| hole[x]) {
        let end = (first..row.len()).find(|&x| !hole[x]).unwrap_or(row.len());
        start = end;
        if first == 0 || end == row.len() || end - first > longest {
            continue;
        }
        let (left_m, right_m) = (row[first - 1], row[end]);
        let left = mean_color(rgb, first.saturating_sub(SAMPLE_PX)..first);
        let right = mean_color(rgb, end..(end + SAMPLE_PX).min(row.len()));
        if left_m * SAME_SURFACE < right_m {
            grow(first..end, left_m, left, right, rgb, claims);
        } else if right_m * SAME_SURFACE < left_m {
            grow((first..end).rev(), right_m, right, left, rgb, claims);
        }
    }
}

/// Takes pixels in order for the near side while they have its colour.
fn grow(
    pixels: impl Iterator<Item = usize>,
    near_m: f32,
    mut near: [f32; 3],
    far: [f32; 3],
    rgb: &[u8],
    claims: &mut [f32],
) {
    for x in pixels {
        let own = mean_color(rgb, x..x + 1);
        if distance(own, near) * PREFERENCE >= distance(own, far) {
            break;
        }
        claims[x] = near_m;
        near = std::array::from_fn(|p| near[p] + FOLLOW * (own[p] - near[p]));
    }
}

fn mean_color(rgb: &[u8], columns: std::ops::Range<usize>) -> [f32; 3] {
    let count = columns.len().max(1) as f32;
    std::array::from_fn(|p| columns.clone().map(|x| f32::from(rgb[3 * x + p])).sum::<f32>() / count)
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|p| (a[p] - b[p]).powi(2)).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shadow_is_divided_where_the_colour_changes() {
        let (width, height) = (80u32, 10u32);
        // Known person to 40, unknown to 48, wall beyond; the person's colour goes on to 45.
        let mut map = DepthMap::new(width, height);
        let mut color = ColorImage::new(width, height);
        for k in 0..(width * height) as usize {
            let x = k % width as usize;
            map.metres[k] = if x < 40 { 1.0 } else { 3.0 };
            color.rgb[3 * k..3 * k + 3].copy_from_slice(if x < 45 { &[40, 30, 25] } else { &[180, 190, 185] });
        }
        let hole: Vec<bool> = (0..(width * height) as usize).map(|k| (40..48).contains(&(k % 80))).collect();
        Claimer::default().claim(&mut map, &hole, &color);
        for (k, &metres) in map.metres.iter().enumerate() {
            assert_eq!(metres, if k % 80 < 45 { 1.0 } else { 3.0 }, "column {}", k % 80);
        }
    }

    #[test]
    fn like_colours_stay_filled_from_behind() {
        let mut map = DepthMap { width: 9, height: 3, metres: [1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0, 3.0, 3.0].repeat(3) };
        let before = map.clone();
        let hole = [false, false, false, true, true, true, false, false, false].repeat(3);
        let mut claimer = Claimer::default();
        claimer.claim(&mut map, &hole, &ColorImage::new(9, 3));
        assert_eq!(map, before);
        claimer.claim(&mut map, &hole, &ColorImage::new(3, 1));
        assert_eq!(map, before);
    }
}
