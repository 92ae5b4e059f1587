//! Connection of pixels to the near surface: a mere likeness in colour is not enough to be near.

use crate::depth::bitmap::{Bitmap, WORD};

/// Finds which pixels are connected to the near surface, 64 pixels of a row at a time; owns the memory for it.
#[derive(Debug, Default)]
pub struct Connection {
    /// Pixels that may belong to the near surface, and those of them that do.
    candidates: Bitmap,
    connected: Bitmap,
    front: Vec<usize>,
}

impl Connection {
    /// Starts without any pixels.
    pub fn clear(&mut self, size: (usize, usize)) {
        self.candidates.clear(size);
        self.connected.clear(size);
    }

    /// Adds candidates, and the seeds among them, as bits of the pixels from (`x`, `y`) on to the right.
    #[inline(always)]
    pub fn add(&mut self, (x, y): (usize, usize), candidates: u64, seeds: u64) {
        self.candidates.set_word(x, y, candidates);
        self.connected.set_word(x, y, seeds);
    }

    /// Finds the candidates that a path over others connects to a seed, along sides or corners.
    pub fn connect(&mut self) {
        let Self { candidates, connected, front } = self;
        let ((candidates, across), (connected, _)) = (candidates.words(), connected.words());
        front.clear();
        front.extend((0..connected.len()).filter(|&at| connected[at] != 0));
        while let Some(at) = front.pop() {
            let own = fill_runs(connected[at], candidates[at]);
            connected[at] = own;
            // Each row ends with a word without candidates, which separates it from the next one.
            let reached = [own << (WORD - 1), own | own << 1 | own >> 1, own >> (WORD - 1)];
            for middle in [at.wrapping_sub(across), at, at + across] {
                for (reached, place) in reached.into_iter().zip([middle.wrapping_sub(1), middle, middle + 1]) {
                    let Some(candidates) = candidates.get(place) else { continue };
                    let new = reached & candidates & !connected[place];
                    if new != 0 {
                        connected[place] |= new;
                        front.push(place);
                    }
                }
            }
        }
    }

    /// Returns the unconnected candidates as bits of the pixels from (`x`, `y`) on to the right.
    #[inline(always)]
    pub fn unconnected_at(&self, (x, y): (usize, usize)) -> u64 {
        self.candidates.word_at(x, y) & !self.connected.word_at(x, y)
    }
}

/// Returns the whole runs of set bits in `candidates` that contain one of the `seeds` among them.
fn fill_runs(seeds: u64, candidates: u64) -> u64 {
    // A seed carries through all higher bits of its run.
    let fill_up = |seeds: u64, candidates: u64| seeds | candidates & !candidates.wrapping_add(seeds);
    let down = fill_up(seeds.reverse_bits(), candidates.reverse_bits()).reverse_bits();
    fill_up(seeds, candidates) | down
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_filled_from_each_seed_both_ways() {
        for (seeds, candidates, expected) in [
            (0b0100_0000, 0b0111_0110, 0b0111_0000),
            (0b0101, 0b1111, 0b1111),
            (0, u64::MAX, 0),
            (1 << 63, u64::MAX, u64::MAX),
            (1 | 1 << 40, u64::MAX ^ 1 << 20, u64::MAX ^ 1 << 20),
        ] {
            assert_eq!(fill_runs(seeds, candidates), expected, "{seeds:b} in {candidates:b}");
        }
    }

    #[test]
    fn what_a_path_of_sides_and_corners_leads_to_stays() {
        let (width, height) = (200, 40);
        // A diagonal over word limits, a column that it meets, and an island beyond a gap.
        let is_path = |x: usize, y: usize| x == 50 + y || x == 80 && y > 20;
        let is_island = |x: usize, y: usize| x > 150 && y < 5;
        let mut connection = Connection::default();
        connection.clear((width, height));
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let is_candidate = is_path(x, y) || is_island(x, y);
            connection.add((x, y), u64::from(is_candidate), u64::from((x, y) == (50, 0)));
        }
        connection.connect();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let is_unconnected = connection.unconnected_at((x, y)) & 1 != 0;
            assert_eq!(is_unconnected, is_island(x, y) && !is_path(x, y), "{x}, {y}");
        }
    }
}
