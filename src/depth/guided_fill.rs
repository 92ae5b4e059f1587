//! Hole filling guided by colour: holes beside the foreground that are foreground.
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
pub struct GuidedHoleFill {
    claims_m: Vec<f32>,
    /// The holes line by line.
    marks: Vec<bool>,
}

/// A row or a column: its pixels are `first`, `first + step`, and so on.
#[derive(Clone, Copy)]
struct Line {
    first: usize,
    step: usize,
    length: usize,
}

impl Line {
    fn at(self, k: usize) -> usize {
        self.first + k * self.step
    }
}

impl GuidedHoleFill {
    /// Moves holes (`hole`, one flag a pixel) of a map that was filled from behind to the near side that has their
    /// colour, along rows and then, for what is left, along columns; what was moved is no hole any more. Does nothing
    /// when the picture has another size than the map.
    pub fn claim(&mut self, map: &mut DepthMap, hole: &mut [bool], color: &ColorImage) {
        let (width, height) = (map.width as usize, map.height as usize);
        if color.size() != map.size() || map.metres.is_empty() {
            return;
        }
        let longest = ((width as f32 * LONGEST) as usize).max(4);
        let rows = (0..height).map(|y| Line { first: y * width, step: 1, length: width });
        self.marks.clear();
        self.marks.extend_from_slice(hole);
        self.along(rows, width, longest, map, hole, color);
        let columns = (0..width).map(|x| Line { first: x, step: width, length: height });
        turn(hole, width, &mut self.marks);
        self.along(columns, 1, longest, map, hole, color);
    }

    /// Claims along each line, then lets two of three neighbours across the lines (`across` apart) agree.
    fn along(
        &mut self,
        lines: impl Iterator<Item = Line>,
        across: usize,
        longest: usize,
        map: &mut DepthMap,
        hole: &mut [bool],
        color: &ColorImage,
    ) {
        self.claims_m.clear();
        self.claims_m.resize(map.metres.len(), 0.0);
        let mut marks = &self.marks[..];
        for line in lines {
            let hole;
            (hole, marks) = marks.split_at(line.length);
            claim_line(line, longest, &map.metres, hole, &color.rgb, &mut self.claims_m);
        }
        for (k, hole) in hole.iter_mut().enumerate().filter(|(_, hole)| **hole) {
            let claim_m = |k: Option<usize>| k.and_then(|k| self.claims_m.get(k)).copied().unwrap_or(0.0);
            let claims = [claim_m(k.checked_sub(across)), claim_m(Some(k)), claim_m(Some(k + across))];
            if claims.iter().filter(|&&claim_m| claim_m > 0.0).count() >= 2 {
                map.metres[k] = if claims[1] > 0.0 { claims[1] } else { claims[0].min(claims[2]) };
                *hole = false;
            }
        }
    }
}

/// Columns to rows, in square blocks that fit the cache.
fn turn(from: &[bool], width: usize, to: &mut [bool]) {
    const BLOCK: usize = 64;
    let height = from.len() / width;
    for top in (0..height).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            for x in left..(left + BLOCK).min(width) {
                let rows = top..(top + BLOCK).min(height);
                for (to, y) in to[x * height..][rows.clone()].iter_mut().zip(rows) {
                    *to = from[y * width + x];
                }
            }
        }
    }
}

/// Claims in one line, whose own holes are `hole`.
fn claim_line(line: Line, longest: usize, metres: &[f32], hole: &[bool], rgb: &[u8], claims: &mut [f32]) {
    const MANY: usize = 16;
    let none = |some: &[bool]| !some.iter().fold(false, |any, &hole| any | hole);
    let skip = |start: usize| start + MANY * hole[start..].chunks_exact(MANY).take_while(|some| none(some)).count();
    let mut start = skip(0);
    while let Some(first) = hole[start..].iter().position(|&hole| hole).map(|k| start + k) {
        let end = hole[first..].iter().position(|&hole| !hole).map_or(line.length, |k| first + k);
        start = skip(end);
        if first == 0 || end == line.length || end - first > longest {
            continue;
        }
        let (before_m, after_m) = (metres[line.at(first - 1)], metres[line.at(end)]);
        let before = mean_color(rgb, line, first.saturating_sub(SAMPLE_PX)..first);
        let after = mean_color(rgb, line, end..(end + SAMPLE_PX).min(line.length));
        if before_m * SAME_SURFACE < after_m {
            grow(line, first..end, before_m, (before, after), rgb, claims);
        } else if after_m * SAME_SURFACE < before_m {
            grow(line, (first..end).rev(), after_m, (after, before), rgb, claims);
        }
    }
}

/// Takes pixels in order for the near side while they have its colour rather than the far side's.
fn grow(
    line: Line,
    pixels: impl Iterator<Item = usize>,
    near_m: f32,
    (mut near, far): ([f32; 3], [f32; 3]),
    rgb: &[u8],
    claims: &mut [f32],
) {
    for k in pixels {
        let own = mean_color(rgb, line, k..k + 1);
        if distance(own, near) * PREFERENCE >= distance(own, far) {
            break;
        }
        claims[line.at(k)] = near_m;
        near = std::array::from_fn(|p| near[p] + FOLLOW * (own[p] - near[p]));
    }
}

fn mean_color(rgb: &[u8], line: Line, pixels: std::ops::Range<usize>) -> [f32; 3] {
    let count = pixels.len().max(1) as f32;
    std::array::from_fn(|p| pixels.clone().map(|k| f32::from(rgb[3 * line.at(k) + p])).sum::<f32>() / count)
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
        let mut hole: Vec<bool> = (0..(width * height) as usize).map(|k| (40..48).contains(&(k % 80))).collect();
        GuidedHoleFill::default().claim(&mut map, &mut hole, &color);
        for (k, &metres) in map.metres.iter().enumerate() {
            assert_eq!(metres, if k % 80 < 45 { 1.0 } else { 3.0 }, "column {}", k % 80);
        }
    }

    #[test]
    fn like_colours_stay_filled_from_behind() {
        let mut map = DepthMap {
            width: 9,
            height: 3,
            metres: [1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0, 3.0, 3.0].repeat(3),
            ..DepthMap::default()
        };
        let before = map.clone();
        let mut hole = [false, false, false, true, true, true, false, false, false].repeat(3);
        let mut guided = GuidedHoleFill::default();
        guided.claim(&mut map, &mut hole, &ColorImage::new(9, 3));
        assert_eq!(map, before);
        guided.claim(&mut map, &mut hole, &ColorImage::new(3, 1));
        assert_eq!(map, before);
    }
}
