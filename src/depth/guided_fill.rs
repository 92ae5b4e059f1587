//! Colour-guided hole filling: finds the holes beside the foreground that belong to it.
//!
//! A stereo or structured-light sensor loses a strip beside near objects. Filled from the background, that strip would
//! include hair and shoulders. Where the near and the far side of a hole differ in colour, the near side grows into the
//! hole as long as the pixels' colour is closer to its own (seeded region growing).
//!
//! twin: shaders/refine/claim.wgsl, shaders/refine/agree.wgsl

use std::ops::Range;

use crate::frame::{ColorImage, DepthMap, resize_buffer};

/// Depths within this ratio are one surface, whose holes need no decision.
pub const SAME_SURFACE: f32 = 1.15;
/// Known pixels beside a hole in the mean colour of that side.
pub const SAMPLE_PX: usize = 4;
/// A pixel belongs to the near side if its colour is closer to it by this factor than to the far side's.
pub const COLOR_PREFERENCE: f32 = 1.3;
/// Rate at which the near side's colour follows the claimed pixels.
pub const COLOR_UPDATE_RATE: f32 = 0.2;
/// Largest width of a sensor's occlusion shadow, as a fraction of the picture's width.
const MAX_SHADOW_FRACTION: f32 = 0.12;

/// Finds the holes that belong to the nearer side by colour; owns its buffers.
#[derive(Debug, Default)]
pub struct GuidedHoleFill {
    /// Per pixel the depth of the near side that claims it, and whether it is still a hole. Cleared after each frame.
    claims_m: Vec<f32>,
    is_hole: Vec<bool>,
    /// Lines with claims, and the first pixels of holes in columns.
    claimed: Vec<Line>,
    entries: Vec<usize>,
}

/// Consecutive pixels of a row.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Index of the row.
    pub line: u32,
    pub start: u32,
    pub end: u32,
}

impl Run {
    /// Returns the columns.
    #[inline(always)]
    pub fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    /// Returns the pixel indices in a map of `width` columns.
    #[inline(always)]
    pub fn pixels(self, width: usize) -> Range<usize> {
        let first = self.line as usize * width;
        first + self.start as usize..first + self.end as usize
    }
}

/// A row or a column, or a segment of one: its pixels are `first`, `first + step`, and so on.
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

    fn segment(self, Range { start, end }: Range<usize>) -> Self {
        Self { first: self.at(start), length: end - start, ..self }
    }

    fn indices(self) -> impl Iterator<Item = usize> {
        (0..self.length).map(move |k| self.at(k))
    }
}

impl GuidedHoleFill {
    /// Assigns `holes`, row by row, of a map filled from the background to the near side if they have its colour, along
    /// rows and then, for the rest, along columns. Does nothing if picture and map differ in size.
    pub fn assign_to_foreground(&mut self, map: &mut DepthMap, holes: &[Run], color: &ColorImage) {
        let (width, height) = (map.width as usize, map.height as usize);
        if color.size() != map.size() || holes.is_empty() {
            return;
        }
        resize_buffer(&mut self.claims_m, width * height);
        resize_buffer(&mut self.is_hole, width * height);
        holes.iter().for_each(|hole| self.is_hole[hole.pixels(width)].fill(true));
        let max_hole_px = max_hole_px(width);
        for &hole in holes {
            let line = Line { first: hole.line as usize * width, step: 1, length: width };
            let claimed = claim_hole(line, hole.range(), max_hole_px, &map.metres, &color.rgb, &mut self.claims_m);
            self.claimed.extend(claimed);
        }
        self.accept_claims(width, map);
        self.find_entries(holes, width);
        for entry in self.entries.drain(..) {
            let (column, start) = (entry % width, entry / width);
            let is_hole = |&y: &usize| self.is_hole[y * width + column];
            // Searches one row more than the limit, to detect holes that are too long.
            let end = (start..height.min(start + max_hole_px + 1)).take_while(is_hole).count() + start;
            let line = Line { first: column, step: width, length: height };
            let claimed = claim_hole(line, start..end, max_hole_px, &map.metres, &color.rgb, &mut self.claims_m);
            self.claimed.extend(claimed);
        }
        self.accept_claims(1, map);
        holes.iter().for_each(|hole| self.is_hole[hole.pixels(width)].fill(false));
    }

    /// Accepts claims on which two of three neighbours across the lines, `across` apart, agree; removes them from the
    /// holes, and clears all claims.
    fn accept_claims(&mut self, across: usize, map: &mut DepthMap) {
        let Self { claims_m, is_hole, claimed, .. } = self;
        // If two agree, the pixel itself or the one before it has a claim.
        for k in claimed.iter().flat_map(|line| line.indices()).flat_map(|k| [k, k + across]) {
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
        claimed.drain(..).flat_map(Line::indices).for_each(|k| claims_m[k] = 0.0);
    }

    /// Finds the pixels of holes below a pixel without a hole.
    fn find_entries(&mut self, holes: &[Run], width: usize) {
        let Self { is_hole, entries, .. } = self;
        for hole in holes.iter().filter(|hole| hole.line > 0) {
            let here = hole.pixels(width);
            let above = &is_hole[here.start - width..here.end - width];
            let enters = |k: usize| is_hole[here.start + k] & !above[k];
            for block in (0..here.len()).step_by(BLOCK) {
                let block = block..(block + BLOCK).min(here.len());
                // Most are inside: `|` instead of an early exit, so that the test becomes vector code.
                if block.clone().fold(false, |any, k| any | enters(k)) {
                    entries.extend(block.filter(|&k| enters(k)).map(|k| here.start + k));
                }
            }
        }
    }
}

/// Returns the longest hole that may be the near side's, in pixels of a picture with `width` columns.
pub fn max_hole_px(width: usize) -> usize {
    ((width as f32 * MAX_SHADOW_FRACTION) as usize).max(4)
}

/// Pixels tested at once.
const BLOCK: usize = 32;

/// Claims pixels of a hole in a line for the near side; returns the claimed segment.
fn claim_hole(
    line: Line,
    hole: Range<usize>,
    max_hole_px: usize,
    metres: &[f32],
    rgb: &[u8],
    claims_m: &mut [f32],
) -> Option<Line> {
    let Range { start, end } = hole;
    // Holes at the border have only one side; longer ones are not a shadow.
    if start == 0 || end == line.length || end - start > max_hole_px {
        return None;
    }
    let (before_m, after_m) = (metres[line.at(start - 1)], metres[line.at(end)]);
    let colors = || {
        let before = mean_color(rgb, line, start.saturating_sub(SAMPLE_PX)..start);
        (before, mean_color(rgb, line, end..(end + SAMPLE_PX).min(line.length)))
    };
    let claimed = if before_m * SAME_SURFACE < after_m {
        let count = grow_region(line, hole, before_m, colors(), rgb, claims_m);
        start..start + count
    } else if after_m * SAME_SURFACE < before_m {
        let (before, after) = colors();
        let count = grow_region(line, hole.rev(), after_m, (after, before), rgb, claims_m);
        end - count..end
    } else {
        return None;
    };
    Some(line.segment(claimed))
}

/// Claims pixels in order while their colour is closer to the near side's than to the far side's; returns their number.
fn grow_region(
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
        if color_distance(own, near) * COLOR_PREFERENCE >= color_distance(own, far) {
            break;
        }
        claims_m[line.at(k)] = near_m;
        near = std::array::from_fn(|p| near[p] + COLOR_UPDATE_RATE * (own[p] - near[p]));
        count += 1;
    }
    count
}

fn mean_color(rgb: &[u8], line: Line, pixels: Range<usize>) -> [f32; 3] {
    let count = pixels.len().max(1) as f32;
    std::array::from_fn(|p| pixels.clone().map(|k| f32::from(rgb[3 * line.at(k) + p])).sum::<f32>() / count)
}

fn color_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
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
        GuidedHoleFill::default().assign_to_foreground(&mut map, &holes, &color);
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
        guided.assign_to_foreground(&mut map, &holes, &ColorImage::new(9, 3));
        assert_eq!(map, before);
        guided.assign_to_foreground(&mut map, &holes, &ColorImage::new(3, 1));
        assert_eq!(map, before);
    }
}
