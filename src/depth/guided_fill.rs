//! Hole filling guided by colour: holes beside the foreground that are foreground.
//!
//! A sensor that sees with two eyes loses a strip beside whatever is near. Filled from behind, that strip takes hair
//! and shoulders along. Where the colours of the near and the far side of a hole differ, the colour of each pixel
//! tells which side it belongs to; the near side grows into the hole until the colour is no longer its own.

use std::ops::Range;

use crate::frame::{ColorImage, DepthMap};

/// Depths within this ratio are one surface: nothing to decide.
pub const SAME_SURFACE: f32 = 1.15;
/// Known pixels beside a hole whose mean colour stands for that side.
pub const SAMPLE_PX: usize = 4;
/// A pixel is the near side's if it is this much closer to its colour than to the far side's.
pub const PREFERENCE: f32 = 1.3;
/// How fast the near side's colour follows the pixels it takes.
pub const FOLLOW: f32 = 0.2;
/// A sensor's shadow is at most this share of the picture's width.
const LONGEST: f32 = 0.12;

/// Decides by colour which holes belong to the nearer side; owns the memory for it.
#[derive(Debug, Default)]
pub struct GuidedHoleFill {
    /// Per pixel the depth of the near side that claims it, and whether it is a hole still. Nothing between two frames.
    claims_m: Vec<f32>,
    is_hole: Vec<bool>,
    /// Where there are claims, and where columns enter a hole.
    claimed: Vec<Line>,
    entries: Vec<usize>,
}

/// Pixels of a row, one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// The number of the row.
    pub line: u32,
    pub start: u32,
    pub end: u32,
}

impl Run {
    /// Its columns.
    #[inline(always)]
    pub fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    /// Its pixels in a map of so many columns.
    #[inline(always)]
    pub fn of_row(self, width: usize) -> Range<usize> {
        let first = self.line as usize * width;
        first + self.start as usize..first + self.end as usize
    }
}

/// A row or a column, or a part of one: its pixels are `first`, `first + step`, and so on.
#[derive(Clone, Copy, Debug)]
struct Line {
    first: usize,
    step: usize,
    length: usize,
}

impl Line {
    fn at(self, k: usize) -> usize {
        self.first + k * self.step
    }

    fn part(self, Range { start, end }: Range<usize>) -> Self {
        Self { first: self.at(start), length: end - start, ..self }
    }

    fn places(self) -> impl Iterator<Item = usize> {
        (0..self.length).map(move |k| self.at(k))
    }
}

impl GuidedHoleFill {
    /// Moves `holes`, row by row, of a map that was filled from behind to the near side that has their colour, along rows and
    /// then, for what is left, along columns. Does nothing when the picture has another size than the map.
    pub fn claim(&mut self, map: &mut DepthMap, holes: &[Run], color: &ColorImage) {
        let (width, height) = (map.width as usize, map.height as usize);
        if color.size() != map.size() || holes.is_empty() {
            return;
        }
        self.claims_m.resize(width * height, 0.0);
        self.is_hole.resize(width * height, false);
        holes.iter().for_each(|hole| self.is_hole[hole.of_row(width)].fill(true));
        let longest = longest(width);
        for &hole in holes {
            let line = Line { first: hole.line as usize * width, step: 1, length: width };
            let claimed = claim_run(line, hole.range(), longest, &map.metres, &color.rgb, &mut self.claims_m);
            self.claimed.extend(claimed);
        }
        self.agree(width, map);
        self.find_entries(holes, width);
        for entry in self.entries.drain(..) {
            let (column, start) = (entry % width, entry / width);
            let is_hole = |&y: &usize| self.is_hole[y * width + column];
            // One row more than is looked at tells that it is too long.
            let end = (start..height.min(start + longest + 1)).take_while(is_hole).count() + start;
            let line = Line { first: column, step: width, length: height };
            let claimed = claim_run(line, start..end, longest, &map.metres, &color.rgb, &mut self.claims_m);
            self.claimed.extend(claimed);
        }
        self.agree(1, map);
        holes.iter().for_each(|hole| self.is_hole[hole.of_row(width)].fill(false));
    }

    /// Lets two of three neighbours across the lines, `across` apart, agree on the claims of holes; what was claimed is none any
    /// more, and no claim is left.
    fn agree(&mut self, across: usize, map: &mut DepthMap) {
        let Self { claims_m, is_hole, claimed, .. } = self;
        // Where two agree, the pixel itself claims or the one before it does.
        for k in claimed.iter().flat_map(|line| line.places()).flat_map(|k| [k, k + across]) {
            if !is_hole.get(k).is_some_and(|is_hole| *is_hole) {
                continue;
            }
            let claim_m = |k: Option<usize>| k.and_then(|k| claims_m.get(k)).copied().unwrap_or(0.0);
            let claims = [claim_m(k.checked_sub(across)), claim_m(Some(k)), claim_m(Some(k + across))];
            if claims.iter().filter(|&&claim_m| claim_m > 0.0).count() >= 2 {
                map.metres[k] = if claims[1] > 0.0 { claims[1] } else { claims[0].min(claims[2]) };
                is_hole[k] = false;
            }
        }
        claimed.drain(..).flat_map(Line::places).for_each(|k| claims_m[k] = 0.0);
    }

    /// Finds the pixels of holes below one that is none.
    fn find_entries(&mut self, holes: &[Run], width: usize) {
        let Self { is_hole, entries, .. } = self;
        for hole in holes.iter().filter(|hole| hole.line > 0) {
            let here = hole.of_row(width);
            let above = &is_hole[here.start - width..here.end - width];
            let enters = |k: usize| is_hole[here.start + k] & !above[k];
            for block in (0..here.len()).step_by(BLOCK) {
                let block = block..(block + BLOCK).min(here.len());
                // Most are inside: `|` instead of an early exit makes vector code of it.
                if block.clone().fold(false, |any, k| any | enters(k)) {
                    entries.extend(block.filter(|&k| enters(k)).map(|k| here.start + k));
                }
            }
        }
    }
}

/// The longest hole that may be the near side's, in pixels of a picture of so many columns.
pub fn longest(width: usize) -> usize {
    ((width as f32 * LONGEST) as usize).max(4)
}

/// Pixels that are looked at at once.
const BLOCK: usize = 32;

/// Claims for the near side in a hole of a line; returns the part that it claims.
fn claim_run(
    line: Line,
    hole: Range<usize>,
    longest: usize,
    metres: &[f32],
    rgb: &[u8],
    claims_m: &mut [f32],
) -> Option<Line> {
    let Range { start, end } = hole;
    if start == 0 || end == line.length || end - start > longest {
        return None;
    }
    let (before_m, after_m) = (metres[line.at(start - 1)], metres[line.at(end)]);
    let colors = || {
        let before = mean_color(rgb, line, start.saturating_sub(SAMPLE_PX)..start);
        (before, mean_color(rgb, line, end..(end + SAMPLE_PX).min(line.length)))
    };
    let claimed = if before_m * SAME_SURFACE < after_m {
        let count = grow(line, hole, before_m, colors(), rgb, claims_m);
        start..start + count
    } else if after_m * SAME_SURFACE < before_m {
        let (before, after) = colors();
        let count = grow(line, hole.rev(), after_m, (after, before), rgb, claims_m);
        end - count..end
    } else {
        return None;
    };
    Some(line.part(claimed))
}

/// Takes pixels in order for the near side while they have its colour rather than the far side's; returns how many.
fn grow(
    line: Line,
    pixels: impl Iterator<Item = usize>,
    near_m: f32,
    (mut near, far): ([f32; 3], [f32; 3]),
    rgb: &[u8],
    claims_m: &mut [f32],
) -> usize {
    let mut count = 0;
    for k in pixels {
        let own = mean_color(rgb, line, k..k + 1);
        if distance(own, near) * PREFERENCE >= distance(own, far) {
            break;
        }
        claims_m[line.at(k)] = near_m;
        near = std::array::from_fn(|p| near[p] + FOLLOW * (own[p] - near[p]));
        count += 1;
    }
    count
}

fn mean_color(rgb: &[u8], line: Line, pixels: Range<usize>) -> [f32; 3] {
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
        let holes: Vec<Run> = (0..height).map(|line| Run { line, start: 40, end: 48 }).collect();
        GuidedHoleFill::default().claim(&mut map, &holes, &color);
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
        let holes = [0, 1, 2].map(|line| Run { line, start: 3, end: 6 });
        let mut guided = GuidedHoleFill::default();
        guided.claim(&mut map, &holes, &ColorImage::new(9, 3));
        assert_eq!(map, before);
        guided.claim(&mut map, &holes, &ColorImage::new(3, 1));
        assert_eq!(map, before);
    }
}
