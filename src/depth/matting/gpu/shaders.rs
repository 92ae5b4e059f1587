//! The shaders, and the constants that Rust shares with them.

use bytemuck::{Pod, Zeroable};

use super::super::alpha::{MIN_LIKELIHOOD, OUTLIER, PRIOR, PRIOR_MAX, PRIOR_MIN, PRIOR_ROUNDS, STEPS};
use super::super::clusters::{
    AT_EDGE_WEIGHT, CELL_PX, CLOSE_PX, CLOSE_WEIGHT, FALLOFF_PX, FRINGE_ALPHA, FRINGE_ALPHAS, FRINGE_PIXELS,
    RADII_CELLS,
};
use super::super::contrast::{MAX_DEVIATION, QUANTISATION, SHRINKAGE, UNCERTAIN_WEIGHT, UNCERTAINTY};
use super::super::mixture::{ALPHA_VARIANCE, ISOTROPY, MIN_VARIANCE, NOISE};
use super::super::rank::{BITS_BELOW_SIZE, SIZES};
use super::super::trace::MIN_TRACED_ALPHA;
use super::super::{MAX_STEPS, NEARLY_PURE};
use crate::compute::device::{Shader, shader};
use crate::frame::DepthMap;

/// Edge detection, and the number of set bits before each word and each block of words.
pub const FIND_EDGES: Shader = shader!(matte: "common"; "find_edges", "rank");
pub const COUNT: Shader = shader!(matte: "common"; "count", "rank", "sum");
pub const TOTAL: Shader = shader!(matte: "common"; "total", "sum");
/// The colours of surfaces.
pub const CLUSTERS: Shader = shader!(matte: "common"; "clusters", "light");
/// The pixels at edges, their likelihoods, and alpha.
pub const EDGES: Shader = shader!(
    matte: "common"; "edges", "light", "background", "contrast", "surfaces", "compare",
    "enter"
);
pub const EXPECT: Shader = shader!(matte: "common"; "expect", "run", "prior", "weights");
pub const WEIGH: Shader = shader!(matte: "common"; "weigh", "prior", "weights", "claim");
/// Traces thin structures beyond the edges of the map, and discards wide regions.
pub const TRACE: Shader = shader!(
    matte: "common"; "trace", "run", "light", "background", "contrast", "surfaces",
    "compare", "enter", "prior", "weights", "claim"
);
pub const SPREAD: Shader = shader!(matte: "common"; "wide", "run");
/// The mixed pixels and their colours.
pub const MARK: Shader = shader!(matte: "common"; "mark");
pub const MIX: Shader = shader!(matte: "common"; "mix", "light", "background", "contrast");

pub const ALL: [Shader; 11] = [FIND_EDGES, COUNT, TOTAL, CLUSTERS, EDGES, EXPECT, WEIGH, TRACE, SPREAD, MARK, MIX];

/// Pixels in a word of bits, rows of a workgroup of `matte/find_edges`, and words in a block.
pub const WORD: u32 = 32;
pub const ROWS: u32 = 8;
pub const BLOCK: u32 = 256;
/// Workgroups of `matte/expect`, and threads of each; threads of all other passes over entries.
pub const LANES: u32 = 64;
/// Length of `counts` before the blocks' counts.
pub const COUNTS: usize = 64 + SIZES;
/// Maximum number of runs of a pass, plus one.
pub const RUNS: usize = MAX_STEPS + 1;
/// Maximum number of storage buffers of a pass.
pub const MAX_BUFFERS: u32 = 10;
/// Returns the number of workgroups that loop over `count` entries or cells: as many as the largest devices run at once,
/// and few enough that empty ones cost nothing.
pub fn workgroup_count(count: usize) -> u32 {
    count.clamp(1, 4096) as u32
}

// `matte/common`, `matte/clusters` and `matte/compare` repeat these as array lengths and bit positions.
const _: () = assert!(CELL_PX == 8 && CLOSE_PX == 3 && STEPS == 9 && MAX_STEPS < 20);
const _: () = assert!(SIZES == 32 && BITS_BELOW_SIZE == 22);

/// Returns the `override` constants of `matte/common.wgsl`; `again` for the second run of a pass.
pub fn constants(again: bool) -> [(&'static str, f64); 35] {
    [
        ("AGAIN", u8::from(again).into()),
        ("MIN_DEPTH_BITS", DepthMap::MIN_M.to_bits().into()),
        ("MAX_DEPTH_BITS", DepthMap::MAX_M.to_bits().into()),
        ("AT_EDGE_WEIGHT", AT_EDGE_WEIGHT.into()),
        ("CLOSE_WEIGHT", CLOSE_WEIGHT.into()),
        ("RADIUS", RADII_CELLS[0] as f64),
        ("RADIUS_FURTHER", RADII_CELLS[1] as f64),
        ("RADIUS_FARTHEST", RADII_CELLS[2] as f64),
        ("FALLOFF_PX", FALLOFF_PX.into()),
        ("FRINGE_FEW", FRINGE_PIXELS[0].into()),
        ("FRINGE_ENOUGH", FRINGE_PIXELS[1].into()),
        ("FRINGE_ALPHA", FRINGE_ALPHA.into()),
        ("FRINGE_OTHER", FRINGE_ALPHAS[0].into()),
        ("FRINGE_SAME", FRINGE_ALPHAS[1].into()),
        ("SHRINKAGE", SHRINKAGE.into()),
        ("QUANTISATION", QUANTISATION.into()),
        ("MAX_DEVIATION", MAX_DEVIATION.into()),
        ("ISOTROPY", ISOTROPY.into()),
        ("NOISE", NOISE.into()),
        ("ALPHA_VARIANCE", ALPHA_VARIANCE.into()),
        ("MIN_VARIANCE", MIN_VARIANCE.into()),
        ("UNCERTAINTY", UNCERTAINTY.into()),
        ("UNCERTAIN_WEIGHT", UNCERTAIN_WEIGHT.into()),
        ("OUTLIER", OUTLIER.into()),
        ("MIN_LIKELIHOOD", MIN_LIKELIHOOD.into()),
        ("FIRST_MIXED", PRIOR.mixed.into()),
        ("FIRST_WRONG", PRIOR.wrong.into()),
        ("PRIOR_MIN", PRIOR_MIN.into()),
        ("MAX_MIXED", PRIOR_MAX.mixed.into()),
        ("MAX_WRONG", PRIOR_MAX.wrong.into()),
        ("PRIOR_ROUNDS", PRIOR_ROUNDS as f64),
        ("TINY", f32::MIN_POSITIVE.into()),
        ("NEARLY_PURE", NEARLY_PURE.into()),
        ("MIN_TRACED_ALPHA", MIN_TRACED_ALPHA.into()),
        ("STEPS_TRACED", MAX_STEPS as f64),
    ]
}

/// Mirrors `Frame` of `matte/common.wgsl`, which documents each field.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Frame {
    pub size: [u32; 2],
    pub max_entries: u32,
    pub min_rounds: u32,
    pub depth_step: f32,
    pub surface_step: f32,
}

/// Mirrors `PassRun` of `matte/run.wgsl`, which documents its field.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct PassRun {
    pub index: u32,
}

/// Bytes of an `Entry`, a `Cell` and two `Color`s of the shaders.
pub const ENTRY: usize = 48;
pub const CELL: usize = 16;
pub const COLORS: usize = 96;
