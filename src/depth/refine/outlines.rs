//! Morphology of a depth map: near things grow or shrink all around, holes stay as they are.

use crate::frame::DepthMap;

/// Moves all outlines by `distance_px` pixels of the map: outwards, seen from the nearer surface, or inwards where that is
/// negative. A square dilation or erosion of nearness, one axis after the other.
pub fn move_outlines(map: &mut DepthMap, distance_px: i32) {
    let (width, height, reach) = (map.width as usize, map.height as usize, distance_px.unsigned_abs() as usize);
    let mut line = Line { reach, outwards: distance_px > 0, known: Vec::new(), scratch: Vec::new() };
    for y in 0..height {
        line.run(&mut map.metres, y * width, 1, width);
    }
    for x in 0..width {
        line.run(&mut map.metres, x, width, height);
    }
}

struct Line {
    reach: usize,
    outwards: bool,
    known: Vec<f32>,
    scratch: Vec<f32>,
}

impl Line {
    /// Replaces each known depth of `len`, `step` apart, by the least (outwards) or largest one within reach.
    fn run(&mut self, metres: &mut [f32], first: usize, step: usize, len: usize) {
        let at = |k: usize| first + k * step;
        let nothing = if self.outwards { f32::INFINITY } else { f32::NEG_INFINITY };
        let pick = |a: f32, b: f32| if self.outwards { a.min(b) } else { a.max(b) };
        let values = &mut self.known;
        values.clear();
        values.resize(self.reach, nothing);
        values.extend((0..len).map(|k| if DepthMap::is_known(metres[at(k)]) { metres[at(k)] } else { nothing }));
        values.resize(len + 2 * self.reach, nothing);
        // Windows of twice the size, until they are as large as two of them that overlap have to be.
        let (window, mut size) = (2 * self.reach + 1, 1);
        while 2 * size <= window {
            self.scratch.clone_from(values);
            for (k, value) in values.iter_mut().enumerate() {
                *value = pick(*value, self.scratch.get(k + size).copied().unwrap_or(nothing));
            }
            size *= 2;
        }
        for k in 0..len {
            if DepthMap::is_known(metres[at(k)]) {
                metres[at(k)] = pick(values[k], values[k + window - size]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_things_grow_and_shrink_and_holes_stay() {
        let row = |text: &str| DepthMap {
            width: text.len() as u32,
            height: 1,
            metres: text.bytes().map(|b| f32::from(b - b'0')).collect(),
            ..DepthMap::default()
        };
        for (distance_px, from, to) in [
            (1, "9992299990999", "9922229990999"),
            (-1, "9922229990999", "9992299990999"),
            (2, "9999991999990", "9999111119990"),
            (-2, "9999111119990", "9999991999990"),
            (3, "1999999999992", "1111999992222"),
            (0, "1992990", "1992990"),
        ] {
            let mut map = row(from);
            move_outlines(&mut map, distance_px);
            assert_eq!(map, row(to), "{distance_px} of {from}");
        }
    }
}
