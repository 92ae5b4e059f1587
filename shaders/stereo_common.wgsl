// Shared by every pass of the matcher: the size of the work and the numbers that are defined once, in Rust.

override WIDTH: u32;        // of both pictures
override HEIGHT: u32;
override WORDS: u32;        // of four disparities each
override OUTSIDE: u32;      // cost of a partner beyond the border
override BONUS: u32;        // what a likely disparity costs less
override SLOPE: u32;        // penalty for a disparity that differs by one
override AGREE: u32;        // left and right may differ by this much
override ONE: u32;          // one pixel in fixed point
override UNKNOWN: u32;      // no disparity
override FILLED: u32;       // the bit of a disparity that was filled in
override NOISE: u32;        // sum of changes of 3x3 pixels that are none
override STEP: u32;         // neighbours of an island differ by no more
override ISLAND: u32;       // islands of up to so many pixels are dropped
override BACK: u32;         // of a path along a row: 1 from the right, after the one from the left

// Where the sums of all paths lie, for threads side by side: `[row][word][column]`.
fn total_at(x: u32, y: u32, word: u32) -> u32 {
    return (y * WORDS + word) * WIDTH + x;
}

fn difference(a: u32, b: u32) -> u32 {
    return max(a, b) - min(a, b);
}

fn least_of(values: vec4<u32>) -> u32 {
    return min(min(values.x, values.y), min(values.z, values.w));
}
