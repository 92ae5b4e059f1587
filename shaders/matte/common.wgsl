// Included by every matting pass: the frame's uniforms, and the constants that Rust defines.
// twin: src/depth/matting

struct Frame {
    size: vec2<u32>,        // picture size, in pixels
    max_entries: u32,       // maximum number of entries; three quarters of them may be edges
    min_rounds: u32,        // rounds from which on the background is known; 0: no background
    depth_step: f32,        // depth discontinuity: a larger step of inverse depth, in 1/m, separates two surfaces
    surface_step: f32,      // minimum step of inverse depth from a surface to the background behind it, in 1/m
}

@group(0) @binding(0) var<uniform> frame: Frame;

override AGAIN: u32;            // 1 in the second run of a pass that runs twice
override MIN_DEPTH_BITS: u32;   // bits of the smallest and the largest valid depth
override MAX_DEPTH_BITS: u32;
override AT_EDGE_WEIGHT: f32;   // weights of pixels in a cluster
override CLOSE_WEIGHT: f32;
override RADIUS: u32;           // search radii in cells: the next one if a surface has no pixels
override RADIUS_FURTHER: u32;
override RADIUS_FARTHEST: u32;
override FALLOFF_PX: f32;
override FRINGE_FEW: f32;       // weight of the fringe from which it starts to count, and from which it counts fully
override FRINGE_ENOUGH: f32;
override FRINGE_ALPHA: f32;
override FRINGE_OTHER: f32;     // alpha of a fringe of another colour, and of the same one
override FRINGE_SAME: f32;
override SHRINKAGE: f32;
override QUANTISATION: f32;
override MAX_DEVIATION: f32;
override ISOTROPY: f32;
override NOISE: f32;
override ALPHA_VARIANCE: f32;
override MIN_VARIANCE: f32;
override UNCERTAINTY: f32;
override UNCERTAIN_WEIGHT: f32;
override OUTLIER: f32;
override MIN_LIKELIHOOD: f32;
override FIRST_MIXED: f32;      // initial value of the prior, and its bounds
override FIRST_WRONG: f32;
override PRIOR_MIN: f32;
override MAX_MIXED: f32;
override MAX_WRONG: f32;
override PRIOR_ROUNDS: u32;
override TINY: f32;             // smaller likelihoods are zero
override NEARLY_PURE: f32;
override MIN_TRACED_ALPHA: f32;
override STEPS_TRACED: u32;

// Side of a cell in pixels; pixels in a word of bits, all of one row; words in a block.
const CELL = 8u;
const WORD = 32u;
const BLOCK = 256u;

// Indices into `counts`: number of edges; the next free entry; per step, the first being that of the edges, the number
// of claimed pixels, and of listed cells; the number of edges found of each size of step; the set bits before each block
// of words.
const EDGES = 0u;
const NEXT = 1u;
const CLAIMED = 4u;
const LISTED = 24u;
const STEP_SIZES = 64u;
const TOTALS = 96u;

// Number of sizes of step, and of bits of a float below those of its half octave.
const SIZES = 32u;
const BITS_BELOW_SIZE = 22u;

// A word of `places`: if `ENTERED` is set, the other bits are the pixel's entry; before that, they are the directions
// it was claimed from.
const ENTERED = 0x80000000u;
const DIRECTIONS = 9u;

// Bits of `flags` of an entry.
const NEAR = 1u;        // the map assigns it to the near surface
const BORDERS = 2u;     // it shares a side with the other surface
const THIN = 4u;        // it is part of something thin
const FOUND = 8u;       // of a model: both surfaces have pixels
const LONE = 16u;       // its model lacks pixels of a surface
const KNOWN_BACKGROUND = 32u;  // the background behind it is known
const MIXED = 64u;
const WIDE = 128u;      // it is part of something wide
const SEEN = 256u;      // a traced pixel with some alpha, or part of the outline of something wide
const GROWN = 512u;     // outline of something wide, found in this or the last even step; the next bit, in an odd step
const OUTLINE = 2048u;  // times the row of `ALPHA_PRIORS`; the last row is for pixels beyond edges
const BEYOND = 6u;
const STEP = 65536u;    // times the step in which it was traced

// A pixel that may be mixed.
struct Entry {
    at: u32,                // row * columns + column
    near: f32,              // inverse depths of both surfaces, in 1/m
    far: f32,
    model: u32,             // the entry whose colour model it shares; both colours are at twice that index
    flags: atomic<u32>,
    alpha: f32,             // coverage by the near surface, 0 to 1
    pure: f32,              // likelihood of a pure pixel, as the map says
    sided: vec2<f32>,       // mean of the likelihood over alphas on the map's side, and of likelihood times alpha
    any_alpha: vec2<f32>,   // the same over all alphas
}

struct Cell {
    latest_model: u32,      // index of its latest model's entry plus one; 0: none
    listed: atomic<u32>,    // the last step for which it was listed
    list: vec2<u32>,        // unrelated to this cell: an item of the cell lists of even and of odd steps
}

// Inverse depth, in 1/m, of the bits of a distance in metres; 0 if the distance is unknown.
fn inverse_depth(bits: u32) -> f32 {
    let is_known = bits >= MIN_DEPTH_BITS && bits <= MAX_DEPTH_BITS;
    return select(0.0, 1.0 / bitcast<f32>(clamp(bits, MIN_DEPTH_BITS, MAX_DEPTH_BITS)), is_known);
}

fn words_across() -> u32 {
    return (frame.size.x + WORD - 1u) / WORD;
}

fn cells_across() -> u32 {
    return (frame.size.x + CELL - 1u) / CELL;
}
