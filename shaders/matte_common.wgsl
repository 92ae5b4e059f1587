// Shared by every pass of the matte: the frame, and the numbers that are defined once, in Rust.

struct Frame {
    size: vec2<u32>,        // of the picture, in pixels
    most: u32,              // entries, at most; where there are more edges, there is no matte
    known: u32,             // what lies behind is known where it was seen for so many rounds; 0 where nothing is
    jump: f32,              // inverse depths of one surface differ by no more, in 1/m
    other: f32,             // what is known lies behind by more than this, in 1/m
}

@group(0) @binding(0) var<uniform> frame: Frame;

override AGAIN: u32;            // 1 in the second run of a pass that runs twice
override LEAST_BITS: u32;       // of the least depth that is known, and of the largest
override MOST_BITS: u32;
override AT_EDGE_WEIGHT: f32;   // of pixels of a cluster
override CLOSE_WEIGHT: f32;
override REACH: u32;            // cells in every direction that are looked at, and if that is not enough
override REACH_FURTHER: u32;
override REACH_FARTHEST: u32;
override HALF_PX: f32;
override FRINGE_FEW: f32;       // pixels of the fringe that tell nothing, and that tell all
override FRINGE_ENOUGH: f32;
override FRINGE_SHARE: f32;
override FRINGE_OTHER: f32;     // shares
override FRINGE_SAME: f32;
override SHRINKAGE: f32;
override QUANTISATION: f32;
override MOST_DEVIATION: f32;
override MOST_CERTAINTY: f32;
override OUTLIER: f32;
override LEAST: f32;
override LEAST_OFF_LINE: f32;
override FIRST_MIXED: f32;      // the first guess of the prior, and its bounds
override FIRST_WRONG: f32;
override PRIOR_FLOOR: f32;
override MOST_MIXED: f32;
override MOST_WRONG: f32;
override PRIOR_ROUNDS: u32;
override TINY: f32;             // less is no likelihood
override NEARLY_PURE: f32;
override TRACED_FROM: f32;
override STEPS_TRACED: u32;

// Pixels a side of a cell, of a word of bits, which are all of one row, and words of a block.
const CELL = 8u;
const WORD = 32u;
const BLOCK = 256u;

// Places in `counts`: edges, 0 where there are too many; the next entry; all edges; for each step, of which the first is that
// of edges, pixels that were claimed for it, and its cells; before each block of words, the bits that are set.
const EDGES = 0u;
const NEXT = 1u;
const FOUND_EDGES = 2u;
const CLAIMED = 4u;
const LISTED = 24u;
const TOTALS = 64u;

// A pixel in `places` has an entry, whose place are the other bits; before that, it has the directions of those that claim it.
const ENTERED = 0x80000000u;
const DIRECTIONS = 9u;

// What is known of an entry, in `flags`.
const NEAR = 1u;        // the map says it is of the near surface
const BORDERS = 2u;     // it borders the other one
const THIN = 4u;        // it is part of something thin
const FOUND = 8u;       // of an answer: both surfaces have pixels
const LONE = 16u;       // its surfaces have none
const BEHIND = 32u;     // what is behind it is known
const MIXED = 64u;
const WIDE = 128u;      // it is part of something that is wide
const SEEN = 256u;      // traced, it shows something near, or is part of the outline of something wide
const GROWN = 512u;     // such an outline, found in this or the last of the steps with even numbers; the next bit, with odd ones
const OUTLINE = 2048u;  // times the row of `SHARES` that its sides and corners have; the last is of pixels beyond edges
const BEYOND = 6u;
const STEP = 65536u;    // times the step in which it was traced

// A pixel that may be mixed.
struct Entry {
    at: u32,                // row times columns plus column
    near: f32,              // inverse depth of both surfaces, in 1/m
    far: f32,
    answer: u32,            // the entry whose answer it shares: the colours of both surfaces are at twice its place
    flags: atomic<u32>,
    share: f32,             // of the near surface
    clean: f32,             // likelihoods: of a pure pixel, as the map says
    sided: vec2<f32>,       // the mean over shares of the map's side, and of the same times the share
    every: vec2<f32>,       // the same over all shares
}

struct Cell {
    answered: u32,          // the place of its last answer plus one
    listed: atomic<u32>,    // the last step that it is listed for
    list: vec2<u32>,        // not of this cell: a place of the list of cells of even, and of that of odd steps
}

// Inverse depth, in 1/m, of the bits of metres; 0 where it is unknown.
fn inverse_of(bits: u32) -> f32 {
    return select(0.0, 1.0 / bitcast<f32>(clamp(bits, LEAST_BITS, MOST_BITS)), bits >= LEAST_BITS && bits <= MOST_BITS);
}

fn words_across() -> u32 {
    return (frame.size.x + WORD - 1u) / WORD;
}

fn cells_across() -> u32 {
    return (frame.size.x + CELL - 1u) / CELL;
}
