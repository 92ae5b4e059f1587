//! The shaders, and the constants that they share with Rust.

use bytemuck::{Pod, Zeroable};

use super::super::align::{EDGE_FRACTION, FILLED, ROUNDS, UNCERTAIN};
use super::super::band::BAND_PX;
use super::super::noise::{self, LAG_PX, NO_NOISE, SMOOTH_FRACTION, SMOOTH_QUANTILE};
use super::super::planes::LANES;
use super::super::smooth::{self, PAIRS_PX};
use super::super::temporal::{self, HOLD_FRAMES, MAX_FRAMES, MOVED, MOVED_BOUNDS};
use super::super::votes::{
    HYSTERESIS, LOW_CONTRAST_HYSTERESIS, MIN_SIMILARITY, QUARTER_T, RELATIVE_DEPTH_STEP, Weights,
};
use super::super::{CHANGE_SIGMAS, DEPTH_STEP_SIGMAS, MIN_CHANGE, MIN_DEPTH_STEP, upsample};
use crate::compute::device::{Shader, shader};
use crate::depth::guided_fill::{self, COLOR_PREFERENCE, COLOR_UPDATE_RATE, SAMPLE_PX};
use crate::frame::DepthMap;

/// Resampling of the map, and packing of the picture.
pub const PREPARE: Shader = shader!(refine: "common"; "prepare");
/// Hole filling: known depths beside holes, and then above and below.
pub const BESIDE: Shader = shader!(refine: "common"; "beside", "ends");
pub const FILL: Shader = shader!(refine: "common"; "fill", "ends");
/// Colour-guided hole filling: holes that belong to the near side.
pub const CLAIM: Shader = shader!(refine: "common"; "claim");
pub const AGREE: Shader = shader!(refine: "common"; "agree");
/// Noise measurement, and the sigma filter.
pub const NOISE: Shader = shader!(refine: "common"; "noise", "select");
pub const SMOOTH: Shader = shader!(refine: "common"; "smooth");
/// Edge detection, and edge alignment.
pub const BAND: Shader = shader!(refine: "common"; "band");
pub const VOTE: Shader = shader!(refine: "common"; "vote", "lanes", "window");
/// Colour change since the last frame, and the temporal filter.
pub const CHANGE: Shader = shader!(refine: "common"; "change");
pub const MEDIAN: Shader = shader!(refine: "common"; "median", "select");
pub const STEADY: Shader = shader!(refine: "common"; "steady");

pub const ALL: [Shader; 12] = [PREPARE, BESIDE, FILL, CLAIM, AGREE, NOISE, SMOOTH, BAND, VOTE, CHANGE, MEDIAN, STEADY];

/// Workgroup sizes: of tiles, of strips along rows, and columns per workgroup of `refine/fill`.
pub const TILE: [u32; 2] = [16, 16];
pub const STRIP: [u32; 2] = [64, 4];
pub const COLUMNS: u32 = 16;
/// Returns the number of workgroups that share the worklist of a picture of `pixels` pixels, in the first wave and in
/// the others, which are short: no more than any device runs at once.
pub fn vote_workgroups(pixels: usize) -> [u32; 2] {
    [pixels.div_ceil(64).clamp(1, 2048), pixels.div_ceil(512).clamp(1, 256)].map(|count| count as u32)
}
/// Parallel waves per round; one workgroup processes the rest. A wave advances by a pixel, and the band beside edges is
/// three pixels wide, so that few are left; along an edge, waves may go on.
pub const WAVES: usize = 24;
/// Numbers in `counts`: whether a hole is left, and for each round the worklist's length in each wave, and the total
/// after those.
pub const COUNTS: usize = 1 + ROUNDS * (WAVES + 2);
/// Numbers in `measures`.
pub const MEASURES: usize = 4;
/// Maximum number of samples.
pub const SAMPLES: usize = if noise::GRID > temporal::GRID { noise::GRID.pow(2) } else { temporal::GRID.pow(2) };
/// Flag of the pixels that were processed in the first round.
pub const PROCESSED: u32 = 8;

// Array lengths in `refine/band`, `refine/lanes` and `refine/window`.
const _: () = assert!(BAND_PX == 4 && LANES == 16 && size_of::<Weights>() == 9 * LANES * 4);
// The shader computes the offsets as multiples of the first.
const _: () =
    assert!(PAIRS_PX[1] == 2 * PAIRS_PX[0] && PAIRS_PX[2] == 3 * PAIRS_PX[0] && PAIRS_PX[3] == 4 * PAIRS_PX[0]);

/// Returns the `override` constants of `refine/common.wgsl`; `again` for the second run of a pass.
pub fn constants(again: bool) -> [(&'static str, f64); 36] {
    [
        ("DOWN", u8::from(again).into()),
        ("MIN_BITS", DepthMap::MIN_M.to_bits().into()),
        ("MAX_BITS", DepthMap::MAX_M.to_bits().into()),
        ("MAP_SURFACE", upsample::SAME_SURFACE.into()),
        ("HOLE_SURFACE", guided_fill::SAME_SURFACE.into()),
        ("SAMPLE_PX", SAMPLE_PX as f64),
        ("COLOR_PREFERENCE", COLOR_PREFERENCE.into()),
        ("COLOR_UPDATE_RATE", COLOR_UPDATE_RATE.into()),
        ("LAG_PX", LAG_PX as f64),
        ("NOISE_GRID", noise::GRID as f64),
        ("SMOOTH_FRACTION", SMOOTH_FRACTION.into()),
        ("SMOOTH_QUANTILE", SMOOTH_QUANTILE.into()),
        ("NO_NOISE", NO_NOISE.into()),
        ("SURFACE_SIGMAS", smooth::SAME_SURFACE.into()),
        ("PAIR_STEP_PX", PAIRS_PX[0] as f64),
        ("PAIRS", PAIRS_PX.len() as f64),
        ("MIN_DEPTH_STEP", MIN_DEPTH_STEP.into()),
        ("DEPTH_STEP_SIGMAS", DEPTH_STEP_SIGMAS.into()),
        ("RELATIVE_DEPTH_STEP", RELATIVE_DEPTH_STEP.into()),
        ("EDGE_FRACTION", EDGE_FRACTION.into()),
        ("MIN_CHANGE", MIN_CHANGE.into()),
        ("CHANGE_SIGMAS", CHANGE_SIGMAS.into()),
        ("UNCERTAIN", UNCERTAIN.into()),
        ("FILLED", FILLED.into()),
        ("QUARTER_T", QUARTER_T.into()),
        ("MIN_SIMILARITY", MIN_SIMILARITY.into()),
        ("HYSTERESIS", HYSTERESIS.into()),
        ("LOW_CONTRAST_HYSTERESIS", LOW_CONTRAST_HYSTERESIS.into()),
        ("PIXELS", if again { 16.0 } else { 4.0 }),
        ("WAVES", WAVES as f64),
        ("CHANGE_GRID", temporal::GRID as f64),
        ("MOVED", MOVED.into()),
        ("MOVED_MIN", MOVED_BOUNDS.0.into()),
        ("MOVED_MAX", MOVED_BOUNDS.1.into()),
        ("MAX_FRAMES", MAX_FRAMES.into()),
        ("HOLD_FRAMES", HOLD_FRAMES.into()),
    ]
}

/// `Frame` of `refine/common.wgsl`, which documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Frame {
    pub size: [u32; 2],
    pub map_size: [u32; 2],
    pub focus_m: f32,
    pub rescale: f32,
    pub max_hole_px: u32,
    pub is_fresh: u32,
}

/// `Wave` of `refine/vote.wgsl`, which documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Wave {
    pub first: u32,
    pub at: u32,
    pub marks: u32,
}
