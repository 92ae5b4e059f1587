//! The shaders, and the numbers that Rust shares with them.

use bytemuck::{Pod, Zeroable};

use super::super::align::{BAND_PX, EDGE_SHARE, MADE_UP, ROUNDS, UNSURE};
use super::super::noise::{self, LAG_PX, NO_NOISE, SMOOTH_QUANTILE, SMOOTH_SHARE};
use super::super::planes::LANES;
use super::super::smooth::{self, PAIRS_PX};
use super::super::temporal::{self, HOLD, LONGEST, MOVED, MOVED_BOUNDS};
use super::super::votes::{JUMP_SHARE, LOYALTY, LOYALTY_WITHOUT_CONTRAST, QUARTER_T, UNLIKE, Weights};
use super::super::{CHANGE_SIGMAS, JUMP, JUMP_SIGMAS, LEAST_CHANGE, upsample};
use crate::compute::device::{Shader, shader};
use crate::depth::guided_fill::{self, FOLLOW, PREFERENCE, SAMPLE_PX};
use crate::frame::DepthMap;

/// The map in the picture's size, and the picture.
pub const PREPARE: Shader = shader!("refine_common"; "refine_prepare");
/// Holes: what is known beside them, and then above and below.
pub const BESIDE: Shader = shader!("refine_common"; "refine_beside", "refine_ends");
pub const FILL: Shader = shader!("refine_common"; "refine_fill", "refine_ends");
/// Which holes are the near side's.
pub const CLAIM: Shader = shader!("refine_common"; "refine_claim");
pub const AGREE: Shader = shader!("refine_common"; "refine_agree");
/// How much noise there is, and less of it.
pub const NOISE: Shader = shader!("refine_common"; "refine_noise", "refine_select");
pub const SMOOTH: Shader = shader!("refine_common"; "refine_smooth");
/// Where edges are, and where they should be.
pub const BAND: Shader = shader!("refine_common"; "refine_band");
pub const VOTE: Shader = shader!("refine_common"; "refine_vote", "refine_lanes", "refine_window");
/// What changed since the last frame, and what did not.
pub const CHANGE: Shader = shader!("refine_common"; "refine_change");
pub const MEDIAN: Shader = shader!("refine_common"; "refine_median", "refine_select");
pub const STEADY: Shader = shader!("refine_common"; "refine_steady");

pub const ALL: [Shader; 12] = [PREPARE, BESIDE, FILL, CLAIM, AGREE, NOISE, SMOOTH, BAND, VOTE, CHANGE, MEDIAN, STEADY];

/// Pixels a side of a workgroup, the same in strips along rows, and columns that a workgroup of `refine_fill` does.
pub const TILE: [u32; 2] = [16, 16];
pub const STRIP: [u32; 2] = [64, 4];
pub const COLUMNS: u32 = 16;
/// How many workgroups take turns with the pixels to ask of a picture of so many, in the first wave and in the others, which
/// are short: no more than any device runs at once.
pub fn turns(pixels: usize) -> [u32; 2] {
    [pixels.div_ceil(64).clamp(1, 2048), pixels.div_ceil(512).clamp(1, 256)].map(|turns| turns as u32)
}
/// Waves of pixels to ask in each round, each as wide as the device; one workgroup asks what is left then. A wave goes on by a
/// pixel, and the band is three wide beside edges: few are left.
pub const WAVES: usize = 8;
/// Numbers in `counts`: whether a hole is left, and for each round the pixels to ask in each wave, and in all after those.
pub const COUNTS: usize = 1 + ROUNDS * (WAVES + 2);
/// Numbers in `measures`.
pub const MEASURES: usize = 4;
/// Samples, at most.
pub const SAMPLES: usize = if noise::LOOKS > temporal::LOOKS { noise::LOOKS.pow(2) } else { temporal::LOOKS.pow(2) };
/// The mark of those that were asked in the first round.
pub const ASKED: u32 = 8;

// As `refine_band`, `refine_lanes` and `refine_window` have them, where they are the lengths of arrays.
const _: () = assert!(BAND_PX == 4 && LANES == 16 && size_of::<Weights>() == 9 * LANES * 4);
// The shader goes from one pair to the next in steps.
const _: () =
    assert!(PAIRS_PX[1] == 2 * PAIRS_PX[0] && PAIRS_PX[2] == 3 * PAIRS_PX[0] && PAIRS_PX[3] == 4 * PAIRS_PX[0]);

/// The `override` constants of `refine_common.wgsl`; `again` for the second run of a pass.
pub fn constants(again: bool) -> [(&'static str, f64); 36] {
    [
        ("DOWN", u8::from(again).into()),
        ("LEAST_BITS", DepthMap::LEAST_M.to_bits().into()),
        ("MOST_BITS", DepthMap::MOST_M.to_bits().into()),
        ("MAP_SURFACE", upsample::SAME_SURFACE.into()),
        ("HOLE_SURFACE", guided_fill::SAME_SURFACE.into()),
        ("SAMPLE_PX", SAMPLE_PX as f64),
        ("PREFERENCE", PREFERENCE.into()),
        ("FOLLOW", FOLLOW.into()),
        ("LAG_PX", LAG_PX as f64),
        ("NOISE_LOOKS", noise::LOOKS as f64),
        ("SMOOTH_SHARE", SMOOTH_SHARE.into()),
        ("SMOOTH_QUANTILE", SMOOTH_QUANTILE.into()),
        ("NO_NOISE", NO_NOISE.into()),
        ("SURFACE_SIGMAS", smooth::SAME_SURFACE.into()),
        ("PAIR_STEP_PX", PAIRS_PX[0] as f64),
        ("PAIRS", PAIRS_PX.len() as f64),
        ("JUMP", JUMP.into()),
        ("JUMP_SIGMAS", JUMP_SIGMAS.into()),
        ("JUMP_SHARE", JUMP_SHARE.into()),
        ("EDGE_SHARE", EDGE_SHARE.into()),
        ("LEAST_CHANGE", LEAST_CHANGE.into()),
        ("CHANGE_SIGMAS", CHANGE_SIGMAS.into()),
        ("UNSURE", UNSURE.into()),
        ("MADE_UP", MADE_UP.into()),
        ("QUARTER_T", QUARTER_T.into()),
        ("UNLIKE", UNLIKE.into()),
        ("LOYALTY", LOYALTY.into()),
        ("CONTRAST_LOYALTY", LOYALTY_WITHOUT_CONTRAST.into()),
        ("PIXELS", if again { 16.0 } else { 4.0 }),
        ("WAVES", WAVES as f64),
        ("CHANGE_LOOKS", temporal::LOOKS as f64),
        ("MOVED", MOVED.into()),
        ("MOVED_LEAST", MOVED_BOUNDS.0.into()),
        ("MOVED_MOST", MOVED_BOUNDS.1.into()),
        ("LONGEST", LONGEST.into()),
        ("HOLD", HOLD.into()),
    ]
}

/// `Frame` of `refine_common.wgsl`, where each field is explained.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Frame {
    pub size: [u32; 2],
    pub map_size: [u32; 2],
    pub focus_m: f32,
    pub times: f32,
    pub longest: u32,
    pub empty: u32,
    pub fresh: u32,
    /// As long as the uniform is.
    pub unused: u32,
}

/// `Wave` of `refine_vote.wgsl`, where each field is explained.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Wave {
    pub first: u32,
    pub at: u32,
    pub marks: u32,
}
