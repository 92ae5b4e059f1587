//! Morphology of depth maps: grows or shrinks near objects.

/// Moves outlines; owns its buffers.
#[derive(Debug, Default)]
pub struct Outlines {
    before: Vec<f32>,
    line: Vec<f32>,
    scratch: Vec<f32>,
}

impl Outlines {
    /// Moves all outlines of a map of inverse depth by `distance_px` of its pixels: outwards, seen from the nearer
    /// surface; inwards if negative. A greyscale dilation or erosion with a square, one axis after the other. Changes
    /// up to `depth_step` are undone, as one surface or noise. Pixels that are `unknown` stay unchanged and do not
    /// affect others.
    pub fn shift(&mut self, inverse: &mut [f32], unknown: &[bool], width: usize, distance_px: i32, depth_step: f32) {
        if distance_px == 0 || width == 0 {
            return;
        }
        let height = inverse.len() / width;
        self.before.clear();
        self.before.extend_from_slice(inverse);
        for y in 0..height {
            self.filter_line(inverse, unknown, y * width, 1, width, distance_px);
        }
        for x in 0..width {
            self.filter_line(inverse, unknown, x, width, height, distance_px);
        }
        for (value, &before) in inverse.iter_mut().zip(&self.before) {
            if (*value - before).abs() <= depth_step {
                *value = before;
            }
        }
    }

    /// Replaces each of `len` values, `step` apart, by the maximum (outwards) or minimum within the distance; skips
    /// unknown ones.
    fn filter_line(
        &mut self,
        inverse: &mut [f32],
        unknown: &[bool],
        first: usize,
        step: usize,
        len: usize,
        distance_px: i32,
    ) {
        let (radius, outwards) = (distance_px.unsigned_abs() as usize, distance_px > 0);
        let neutral = if outwards { f32::NEG_INFINITY } else { f32::INFINITY };
        let pick = |a: f32, b: f32| if outwards { a.max(b) } else { a.min(b) };
        let values = &mut self.line;
        values.clear();
        values.resize(radius, neutral);
        let unknown = || unknown[first..].iter().step_by(step);
        let known = |(&value, &unknown): (&f32, &bool)| if unknown { neutral } else { value };
        values.extend(inverse[first..].iter().step_by(step).zip(unknown()).take(len).map(known));
        values.resize(len + 2 * radius, neutral);
        // Doubles the windows until two overlapping ones cover the whole window, as in a sparse table.
        let (window, mut size) = (2 * radius + 1, 1);
        while 2 * size <= window {
            self.scratch.clone_from(values);
            for (k, value) in values.iter_mut().enumerate() {
                *value = pick(*value, self.scratch.get(k + size).copied().unwrap_or(neutral));
            }
            size *= 2;
        }
        for (k, (value, unknown)) in inverse[first..].iter_mut().step_by(step).zip(unknown()).take(len).enumerate() {
            if !unknown {
                *value = pick(values[k], values[k + window - size]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_things_grow_and_shrink_and_holes_and_small_steps_stay() {
        let row = |text: &str| text.bytes().map(|b| f32::from(b - b'0')).collect::<Vec<f32>>();
        for (distance_px, from, to) in [
            (1, "1118811101111", "1188881101111"),
            (-1, "1188881101111", "1118811101111"),
            (2, "1111118111110", "1111888881110"),
            (-2, "1111888881110", "1111118111110"),
            (3, "8111111111117", "8888111117777"),
            (2, "1112111811111", "1112188888111"),
            (0, "8118110", "8118110"),
        ] {
            let mut map = row(from);
            let unknown: Vec<bool> = map.iter().map(|&value| value == 0.0).collect();
            Outlines::default().shift(&mut map, &unknown, from.len(), distance_px, 1.5);
            assert_eq!(map, row(to), "{distance_px} of {from}");
        }
    }
}
