//! Runs of pixels in the order in which a file stores them.

/// The position of a run of pixels: index of the first one in row-major order, and distance to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelRun {
    pub(super) first: usize,
    pub(super) step: usize,
}

/// Returns the runs of a PNG's rows, in stored order, and the pixels of each.
pub(super) fn png_pixel_runs(
    width: usize,
    height: usize,
    is_interlaced: bool,
) -> impl Iterator<Item = (PixelRun, usize)> {
    /// First column, column step, first row, row step.
    const WHOLE: [[usize; 4]; 1] = [[0, 1, 0, 1]];
    const ADAM7: [[usize; 4]; 7] =
        [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2]];
    let passes: &[[usize; 4]] = if is_interlaced { &ADAM7 } else { &WHOLE };
    // A pass without columns has no rows.
    passes.iter().filter(move |pass| pass[0] < width).flat_map(move |&[column, step, row, row_step]| {
        let pixels = (width - column).div_ceil(step);
        (row..height).step_by(row_step).map(move |row| (PixelRun { first: row * width + column, step }, pixels))
    })
}
