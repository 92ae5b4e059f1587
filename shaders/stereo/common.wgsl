// Included by every pass of the matcher: the size of the work and the constants that Rust defines.

override WIDTH: u32;                // columns of both pictures
override HEIGHT: u32;
override WORDS: u32;                // four disparities per word
override OUTSIDE_COST: u32;         // cost of a partner beyond the border
override PRIOR_BONUS: u32;          // reduction of the cost of a likely disparity
override P1: u32;                   // penalty P1 for a disparity that differs by one
override MAX_LR_DIFFERENCE: u32;    // largest difference of left and right disparity
override ONE: u32;                  // one pixel in fixed point
override UNKNOWN: u32;              // an unknown disparity
override FILLED: u32;               // the bit of a disparity that was filled in
override MAX_NOISE: u32;            // largest change of 3x3 pixels that counts as noise
override MAX_SPECKLE_STEP: u32;     // largest difference of neighbours in a speckle
override MAX_SPECKLE: u32;          // largest number of pixels of a removed speckle
override FROM_RIGHT: u32;           // 1 for the path along rows from the right, which is the second

// Returns the index of a total: `[row][word][column]`, so that neighbouring threads read neighbouring words.
fn total_index(x: u32, y: u32, word: u32) -> u32 {
    return (y * WORDS + word) * WIDTH + x;
}

fn abs_diff(a: u32, b: u32) -> u32 {
    return max(a, b) - min(a, b);
}

fn min_of(values: vec4<u32>) -> u32 {
    return min(min(values.x, values.y), min(values.z, values.w));
}
