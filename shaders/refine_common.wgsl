// Shared by every pass of refinement: the frame, and the numbers that are defined once, in Rust.

struct Frame {
    size: vec2<u32>,        // of the picture, in pixels
    map_size: vec2<u32>,    // of the map as it came
    focus_m: f32,           // inverse depth is this over the depth
    times: f32,             // what is remembered is multiplied by this, as its unit has changed
    longest: u32,           // pixels of a hole that may be the near side's
    empty: u32,             // 1 where nothing is known: the last map that was filled stands
    fresh: u32,             // 1 where no frame before counts
}

@group(0) @binding(0) var<uniform> frame: Frame;

override DOWN: u32;             // of a pass that runs twice: 0 at first, along rows; 1 then, down columns
override LEAST_BITS: u32;       // of the least depth that is known, and of the largest
override MOST_BITS: u32;
override MAP_SURFACE: f32;      // samples of a map are one surface within this share
override HOLE_SURFACE: f32;     // both sides of a hole are one within this ratio
override SAMPLE_PX: u32;        // pixels whose mean colour stands for a side of a hole
override PREFERENCE: f32;
override FOLLOW: f32;
override LAG_PX: u32;           // between the three depths that tell noise from slope
override NOISE_LOOKS: u32;      // samples along rows and along columns, at most
override SMOOTH_SHARE: f32;
override SMOOTH_QUANTILE: f32;
override NO_NOISE: f32;
override SURFACE_SIGMAS: f32;
override PAIR_STEP_PX: u32;     // from one pair of the sigma filter to the next
override PAIRS: u32;
override JUMP: f32;
override JUMP_SIGMAS: f32;
override JUMP_SHARE: f32;
override EDGE_SHARE: f32;
override LEAST_CHANGE: f32;
override CHANGE_SIGMAS: f32;
override UNSURE: f32;           // weights of votes
override MADE_UP: f32;
override QUARTER_T: f32;
override UNLIKE: f32;
override LOYALTY: f32;
override CONTRAST_LOYALTY: f32;
override PIXELS: u32;           // that a workgroup asks at once
override WAVES: u32;            // of pixels to ask in a round, before what is left
override CHANGE_LOOKS: u32;     // samples for the median change, along rows and along columns, at most
override MOVED: f32;
override MOVED_LEAST: f32;
override MOVED_MOST: f32;
override LONGEST: f32;          // frames of the mean
override HOLD: u32;             // frames for which a jump is held back

// What is known of a pixel, in `flags`.
const UNKNOWN = 1u;     // nobody measured its depth
const HOLE = 2u;        // the same, until a near side has claimed it
const BAND = 4u;        // may change: it is near an edge, and was not asked yet
const ASKED = 8u;       // in the first round
const MOVED_NOW = 16u;  // in the present round

// Places in `measures`.
const SURFACE = 0u;     // ends of a pair within this lie on the middle's surface; 0 where there is no noise
const STILL = 1u;       // a change in time up to this is noise
const STEP = 2u;        // a step from this on is an edge
const CHANGED = 3u;     // up to this change of colour a pixel rests

// The step of inverse depth that is an edge near the inverse depth `v`.
fn jump_at(jump: f32, v: f32) -> f32 {
    return max(jump, JUMP_SHARE * v);
}

// Red, green and blue, 0 to 255, of a word.
fn color_of(word: u32) -> vec3<f32> {
    return vec3<f32>(vec3(word, word >> 8u, word >> 16u) & vec3(255u));
}
