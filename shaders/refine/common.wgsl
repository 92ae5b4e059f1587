// Included by every pass of refinement: the frame, and the constants that Rust defines.

struct Frame {
    size: vec2<u32>,        // of the picture, in pixels
    map_size: vec2<u32>,    // of the map as measured
    focus_m: f32,           // inverse depth is this over the depth
    rescale: f32,           // factor for the stored inverse depth, whose unit has changed
    max_hole_px: u32,       // largest hole that may be the near side's, in pixels
    is_fresh: u32,          // 1 without a last frame
}

@group(0) @binding(0) var<uniform> frame: Frame;

override DOWN: u32;                     // in passes that run twice: 0 along rows, then 1 down columns
override MIN_BITS: u32;                 // bits of the smallest and the largest known depth
override MAX_BITS: u32;
override MAP_SURFACE: f32;              // samples within this fraction are one surface
override HOLE_SURFACE: f32;             // sides of a hole within this ratio are one surface
override SAMPLE_PX: u32;                // pixels in the mean colour of a side of a hole
override COLOR_PREFERENCE: f32;         // weight of the distance to the near side's colour
override COLOR_UPDATE_RATE: f32;        // rate at which the near side's colour is updated
override LAG_PX: u32;                   // spacing of the samples of a second difference
override NOISE_GRID: u32;               // maximum number of samples along rows, and along columns
override SMOOTH_FRACTION: f32;          // fraction of the differences on smooth surfaces
override SMOOTH_QUANTILE: f32;          // that quantile of |x|, in standard deviations
override NO_NOISE: f32;                 // noise below this is ignored
override SURFACE_SIGMAS: f32;           // half-width of the sigma filter's range
override PAIR_STEP_PX: u32;             // offset from one pair of the sigma filter to the next
override PAIRS: u32;
override MIN_DEPTH_STEP: f32;           // minimum depth step of an edge
override DEPTH_STEP_SIGMAS: f32;        // the same in standard deviations of the noise
override RELATIVE_DEPTH_STEP: f32;      // the same relative to the inverse depth
override EDGE_FRACTION: f32;            // fraction of a depth step between neighbours at an edge
override MIN_CHANGE: f32;               // changes in time up to this are noise
override CHANGE_SIGMAS: f32;            // the same in standard deviations of the noise
override UNCERTAIN: f32;                // weights of votes that may be wrong, and of filled ones
override FILLED: f32;
override QUARTER_T: f32;                // see src/depth/refine/votes.rs
override MIN_SIMILARITY: f32;
override HYSTERESIS: f32;
override LOW_CONTRAST_HYSTERESIS: f32;
override PIXELS: u32;                   // processed by a workgroup at once
override WAVES: u32;                    // parallel waves in a round, before the rest
override CHANGE_GRID: u32;              // maximum number of samples along rows, and along columns
override MOVED: f32;
override MOVED_MIN: f32;
override MOVED_MAX: f32;
override MAX_FRAMES: f32;               // maximum number of frames in the mean
override HOLD_FRAMES: u32;              // frames for which a step is held back

// Bits of a pixel in `flags`.
const UNKNOWN = 1u;     // depth was not measured
const HOLE = 2u;        // not measured, and not claimed by a near side yet
const BAND = 4u;        // may change: near an edge, and not processed yet
const PROCESSED = 8u;   // processed in the first round
const MOVED_NOW = 16u;  // changed in the current round

// Indices in `measures`.
const SURFACE = 0u;     // pairs within this lie on the centre's surface; 0 without noise
const STILL = 1u;       // changes in time up to this are noise
const STEP = 2u;        // minimum depth step of an edge
const CHANGED = 3u;     // a pixel is static up to this change of colour

// Returns the depth step that is an edge near the inverse depth `v`.
fn depth_step_at(depth_step: f32, v: f32) -> f32 {
    return max(depth_step, RELATIVE_DEPTH_STEP * v);
}

// Unpacks red, green and blue, 0 to 255.
fn unpack_color(word: u32) -> vec3<f32> {
    return vec3<f32>(vec3(word, word >> 8u, word >> 16u) & vec3(255u));
}
