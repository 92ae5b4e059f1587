//! The shaders, and the numbers that Rust shares with them.

use bytemuck::{Pod, Zeroable};

use super::super::clusters::{
    AT_EDGE_WEIGHT, CELL_PX, CLOSE_PX, CLOSE_WEIGHT, FRINGE_PIXELS, FRINGE_SHARE, FRINGE_SHARES, HALF_PX, REACHES_CELLS,
};
use super::super::contrast::{MOST_DEVIATION, MOST_PRECISION, QUANTISATION, SHRINKAGE};
use super::super::share::{LEAST, LEAST_OFF_LINE, OUTLIER, PRIOR, PRIOR_FLOOR, PRIOR_MOST, PRIOR_ROUNDS, STEPS};
use super::super::trace::TRACED_FROM;
use super::super::{MOST_STEPS, NEARLY_PURE};
use crate::compute::device::{Shader, shader};
use crate::frame::DepthMap;

/// Where edges are, and how many bits of them before each word, and before each block of words.
pub const SURVEY: Shader = shader!("matte_common"; "matte_survey");
pub const COUNT: Shader = shader!("matte_common"; "matte_count", "matte_sum");
pub const TOTAL: Shader = shader!("matte_common"; "matte_total", "matte_sum");
/// The colours of surfaces.
pub const CLUSTERS: Shader = shader!("matte_common"; "matte_clusters", "matte_light");
/// The pixels at edges, how likely they are mixed, and how much.
pub const EDGES: Shader = shader!(
    "matte_common"; "matte_edges", "matte_light", "matte_behind", "matte_contrast", "matte_surfaces", "matte_compare",
    "matte_enter"
);
pub const EXPECT: Shader = shader!("matte_common"; "matte_expect", "matte_turn", "matte_prior", "matte_weights");
pub const WEIGH: Shader = shader!("matte_common"; "matte_weigh", "matte_prior", "matte_weights", "matte_claim");
/// Thin things beyond the edges of the map, and wide ones, which are none.
pub const TRACE: Shader = shader!(
    "matte_common"; "matte_trace", "matte_turn", "matte_light", "matte_behind", "matte_contrast", "matte_surfaces",
    "matte_compare", "matte_enter", "matte_prior", "matte_weights", "matte_claim"
);
pub const SPREAD: Shader = shader!("matte_common"; "matte_wide", "matte_turn");
/// What is mixed, and both of its colours.
pub const MARK: Shader = shader!("matte_common"; "matte_mark");
pub const MIX: Shader = shader!("matte_common"; "matte_mix", "matte_light", "matte_behind", "matte_contrast");

pub const ALL: [Shader; 11] = [SURVEY, COUNT, TOTAL, CLUSTERS, EDGES, EXPECT, WEIGH, TRACE, SPREAD, MARK, MIX];

/// Pixels of a word of bits, rows of a workgroup of `matte_survey`, and words of a block.
pub const WORD: u32 = 32;
pub const ROWS: u32 = 8;
pub const BLOCK: u32 = 256;
/// Workgroups of `matte_expect`, and threads of each; threads of all others that do entries.
pub const LANES: u32 = 64;
/// Numbers in `counts` before those of blocks.
pub const COUNTS: usize = 64;
/// Times that a pass runs, at most, and one.
pub const TURNS: usize = MOST_STEPS + 1;
/// Storage buffers of the pass that has most of them.
pub const MOST_BUFFERS: u32 = 10;
/// How many workgroups take turns with so many entries, or cells: no more than any device runs at once.
pub fn turns(count: usize) -> u32 {
    count.clamp(1, 512) as u32
}

// As `matte_common`, `matte_clusters` and `matte_compare` have them, where they are lengths of arrays, or places of bits.
const _: () = assert!(CELL_PX == 8 && CLOSE_PX == 3 && STEPS == 9 && MOST_STEPS < 20);

/// The `override` constants of `matte_common.wgsl`; `again` for the second run of a pass.
pub fn constants(again: bool) -> [(&'static str, f64); 31] {
    [
        ("AGAIN", u8::from(again).into()),
        ("LEAST_BITS", DepthMap::LEAST_M.to_bits().into()),
        ("MOST_BITS", DepthMap::MOST_M.to_bits().into()),
        ("AT_EDGE_WEIGHT", AT_EDGE_WEIGHT.into()),
        ("CLOSE_WEIGHT", CLOSE_WEIGHT.into()),
        ("REACH", REACHES_CELLS[0] as f64),
        ("REACH_FURTHER", REACHES_CELLS[1] as f64),
        ("REACH_FARTHEST", REACHES_CELLS[2] as f64),
        ("HALF_PX", HALF_PX.into()),
        ("FRINGE_FEW", FRINGE_PIXELS[0].into()),
        ("FRINGE_ENOUGH", FRINGE_PIXELS[1].into()),
        ("FRINGE_SHARE", FRINGE_SHARE.into()),
        ("FRINGE_OTHER", FRINGE_SHARES[0].into()),
        ("FRINGE_SAME", FRINGE_SHARES[1].into()),
        ("SHRINKAGE", SHRINKAGE.into()),
        ("QUANTISATION", QUANTISATION.into()),
        ("MOST_DEVIATION", MOST_DEVIATION.into()),
        ("MOST_CERTAINTY", MOST_PRECISION.into()),
        ("OUTLIER", OUTLIER.into()),
        ("LEAST", LEAST.into()),
        ("LEAST_OFF_LINE", LEAST_OFF_LINE.into()),
        ("FIRST_MIXED", PRIOR.mixed.into()),
        ("FIRST_WRONG", PRIOR.wrong.into()),
        ("PRIOR_FLOOR", PRIOR_FLOOR.into()),
        ("MOST_MIXED", PRIOR_MOST.mixed.into()),
        ("MOST_WRONG", PRIOR_MOST.wrong.into()),
        ("PRIOR_ROUNDS", PRIOR_ROUNDS as f64),
        ("TINY", f32::MIN_POSITIVE.into()),
        ("NEARLY_PURE", NEARLY_PURE.into()),
        ("TRACED_FROM", TRACED_FROM.into()),
        ("STEPS_TRACED", MOST_STEPS as f64),
    ]
}

/// `Frame` of `matte_common.wgsl`, where each field is explained.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Frame {
    pub size: [u32; 2],
    pub most: u32,
    pub known: u32,
    pub jump: f32,
    pub other: f32,
}

/// `Turn` of `matte_turn.wgsl`, where its field is explained.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Turn {
    pub at: u32,
}

/// Bytes of an `Entry`, a `Cell` and two `Color`s of the shaders.
pub const ENTRY: usize = 48;
pub const CELL: usize = 16;
pub const COLORS: usize = 96;
