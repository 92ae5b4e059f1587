//! The nearest large subject of a depth map.

use crate::frame::DepthMap;

/// Cells of the histogram over disparity (dioptres), and the disparity that its last cell ends at: 0.2 m.
const CELLS: usize = 256;
const NEAREST: f32 = 5.0;
/// A subject spans this many cells to either side of its peak: a head is some 0.25 m deep at 1 m.
const REACH: usize = 6;
/// Share of the weight of all known pixels that makes a subject large enough, and of that of all pixels where few are known:
/// holes make nothing large.
const LARGE: f32 = 0.10;
const LEAST_KNOWN: f32 = 0.5;
/// What is so far off the middle, in halves of the width, stands beside what is so much larger and so much nearer to the middle:
/// leaves that somebody is seen past, not the subject.
const BESIDE: f32 = 0.3;
const LARGER: f32 = 1.6;
const MORE_CENTRAL: f32 = 0.6;
/// Rows and columns looked at, at most; more would only cost time.
const LOOKS: usize = 160;

/// Finds the nearest large subject in a histogram over disparity, in which the middle of the picture weighs most.
#[derive(Debug)]
pub struct Subject {
    cells: [Cell; CELLS],
    /// The weight of all pixels that count.
    total: f32,
    columns: Vec<f32>,
}

/// Sums over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    weight: f32,
    /// Of weight x disparity, so that the distance is finer than the cells.
    disparity: f32,
    /// Of weight x column, from -1 to 1.
    column: f32,
}

impl Cell {
    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.disparity += other.disparity;
        self.column += other.column;
    }

    fn dioptres(&self) -> f32 {
        self.disparity / self.weight
    }

    /// How far off the middle it is, in halves of the width.
    fn off_middle(&self) -> f32 {
        (self.column / self.weight).abs()
    }
}

impl Default for Subject {
    fn default() -> Self {
        Self { cells: [Cell::default(); CELLS], total: 0.0, columns: Vec::new() }
    }
}

impl Subject {
    /// Distance of the subject in dioptres; the largest one's when none is large; `None` without any known depth.
    pub fn find(&mut self, map: &DepthMap) -> Option<f32> {
        self.weigh(map);
        if self.total == 0.0 {
            return None;
        }
        let bodies = self.bodies();
        let is_peak = |cell: &usize| is_peak(&bodies, *cell);
        let is_large = |&cell: &usize| bodies[cell].weight >= LARGE * self.total;
        let large = |below: usize| (0..below).rev().filter(is_peak).filter(is_large);
        // What is farthest is the background: it makes nothing before it small.
        let background = (0..CELLS).filter(is_peak).find(is_large);
        let is_beside = |&cell: &usize| {
            let own = bodies[cell];
            let outdoes = |other: Cell| {
                other.weight >= LARGER * own.weight && other.off_middle() <= MORE_CENTRAL * own.off_middle()
            };
            let is_apart =
                |other: &usize| other + 2 * REACH < cell && background.is_some_and(|far| far + 2 * REACH < *other);
            own.off_middle() >= BESIDE && large(cell).filter(is_apart).any(|other| outdoes(bodies[other]))
        };
        let nearest = large(CELLS).find(|cell| !is_beside(cell));
        let largest = || (0..CELLS).max_by(|&a, &b| bodies[a].weight.total_cmp(&bodies[b].weight));
        nearest.or_else(largest).map(|cell| bodies[cell].dioptres())
    }

    fn bodies(&self) -> [Cell; CELLS] {
        std::array::from_fn(|cell| self.body(cell))
    }

    /// Where something is left, near this distance, of a subject that was large enough, in the map that was looked at last.
    pub fn stays(&self, dioptres: f32) -> Option<f32> {
        let around = Self::window(Self::cell(dioptres)).map(|cell| self.body(cell));
        let most = around.max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        (self.total > 0.0 && most.weight >= 0.5 * LARGE * self.total).then(|| most.dioptres())
    }

    fn body(&self, cell: usize) -> Cell {
        let mut body = Cell::default();
        self.cells[Self::window(cell)].iter().for_each(|cell| body.add(cell));
        body
    }

    fn cell(dioptres: f32) -> usize {
        ((dioptres * (CELLS as f32 / NEAREST)) as usize).min(CELLS - 1)
    }

    fn window(cell: usize) -> std::ops::Range<usize> {
        cell.saturating_sub(REACH)..(cell + REACH + 1).min(CELLS)
    }

    /// Fills the histogram.
    fn weigh(&mut self, map: &DepthMap) {
        self.cells.fill(Cell::default());
        let (width, height) = (map.width as usize, map.height as usize);
        let (mut known, mut all) = (0.0, 0.0);
        let step = width.div_ceil(LOOKS).max(1);
        self.columns.clear();
        self.columns.extend((0..width).step_by(step).map(|x| center_offset(x, width)));
        for y in (0..height).step_by(height.div_ceil(LOOKS).max(1)) {
            let row_weight = 1.0 - 0.9 * center_offset(y, height).powi(2);
            let row = map.metres[y * width..][..width].iter().step_by(step);
            for (&metres, &column) in row.zip(&self.columns) {
                // A person sits in the middle more surely than at a height.
                let weight = row_weight * (1.0 - 0.95 * column * column).powi(2);
                all += weight;
                if DepthMap::is_known(metres) {
                    let disparity = 1.0 / metres;
                    let one = Cell { weight, disparity: weight * disparity, column: weight * column };
                    self.cells[Self::cell(disparity)].add(&one);
                    known += weight;
                }
            }
        }
        self.total = if known > 0.0 { known.max(LEAST_KNOWN * all) } else { 0.0 };
    }
}

fn is_peak(bodies: &[Cell; CELLS], cell: usize) -> bool {
    Subject::window(cell).all(|other| bodies[other].weight <= bodies[cell].weight)
}

/// Where a pixel is, from -1 to 1.
fn center_offset(at_px: usize, size_px: usize) -> f32 {
    (at_px as f32 + 0.5) / size_px as f32 * 2.0 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of a room at 5 m, with somebody in the middle at 1.2 m, and leaves at 0.55 m on the left up to this column.
    fn leaves(until: f32, is_known: impl Fn(usize) -> bool) -> DepthMap {
        let (width, height) = (160, 90);
        let metres = |at: usize| {
            let (x, y) = ((at % width) as f32 / width as f32, (at / width) as f32 / height as f32);
            match () {
                () if !is_known(at) => 0.0,
                () if x < until && y > 0.5 => 0.55,
                () if (x - 0.5).abs() < 0.06 && (0.2..0.55).contains(&y) => 1.2,
                () if (x - 0.5).abs() < 0.18 && y >= 0.55 => 1.25,
                () => 5.0,
            }
        };
        DepthMap { metres: (0..width * height).map(metres).collect(), ..DepthMap::new(width as u32, height as u32) }
    }

    #[test]
    fn leaves_at_a_side_are_not_the_subject_however_much_of_the_room_is_unknown() {
        for until in [0.1, 0.2, 0.25, 0.3, 0.35] {
            for every in [1, 2, 3, 7] {
                // Only what is far is unknown, as where nothing can be matched.
                let whole = leaves(until, |_| true);
                let map = leaves(until, |at| whole.metres[at] < 2.0 || at % every == 0);
                let found_m = 1.0 / Subject::default().find(&map).unwrap();
                assert!((found_m - 1.22).abs() < 0.05, "{until} {every}: {found_m}");
            }
        }
    }

    #[test]
    fn who_comes_to_the_middle_is_the_subject_though_somebody_larger_is_behind() {
        let mut map = leaves(0.0, |_| true);
        for (at, metres) in map.metres.iter_mut().enumerate() {
            if (0.4..0.55).contains(&((at % 160) as f32 / 160.0)) && at / 160 > 30 {
                *metres = 0.6;
            }
        }
        let found_m = 1.0 / Subject::default().find(&map).unwrap();
        assert!((found_m - 0.6).abs() < 0.02, "{found_m}");
    }
}
