//! The shaders, and the constants that they share with Rust.

use super::super::fixed::{
    FILLED, MAX_LR_DIFFERENCE, MAX_NOISE, MAX_SPECKLE_STEP, ONE, OUTSIDE_COST, P1, PRIOR_BONUS, UNKNOWN,
};
use crate::calibration::map::{DOWN_SHIFT, NOWHERE, ONE as WHOLE};
use crate::compute::device::{Shader, shader, workgroups_2d};

/// Temporal prior from the last pair.
pub const LIKELY: Shader = shader!(stereo: "common"; "likely", "line");
/// Census transform of both pictures, and P2 between left pixels.
pub const CENSUS: Shader = shader!(stereo: "common"; "census");
/// Matching costs.
pub const COST: Shader = shader!(stereo: "common"; "cost");
/// Cost aggregation along each row, in either direction.
pub const ROWS: Shader = shader!(stereo: "common"; "rows", "path");
/// Cost aggregation down each column.
pub const COLUMNS: Shader = shader!(stereo: "common"; "columns", "path");
/// Winner takes all with the left-right consistency check.
pub const WINNERS: Shader = shader!(stereo: "common"; "winners", "line");
/// Connected components within rows.
pub const RUNS: Shader = shader!(stereo: "common"; "runs", "row", "touch");
/// Connected components joined from row to row.
pub const JOIN: Shader = shader!(stereo: "common"; "join", "line", "touch", "root");
/// Sizes of the components.
pub const SIZES: Shader = shader!(stereo: "common"; "sizes", "line", "touch", "root");
/// Removal of small components, and filling of gaps.
pub const GAPS: Shader = shader!(stereo: "common"; "gaps", "row");
/// The map packed for the CPU.
pub const PACK: Shader = shader!(stereo: "common"; "pack", "line");

pub const ALL: [Shader; 11] = [LIKELY, CENSUS, COST, ROWS, COLUMNS, WINNERS, RUNS, JOIN, SIZES, GAPS, PACK];

/// Rectification of a picture before matching; it has constants of its own.
pub const RECTIFY: Shader = shader!(stereo: "line"; "rectify");

/// Returns the `override` constants of `stereo/rectify.wgsl`, for pictures of `bytes` bytes.
pub fn rectify_constants(bytes: usize, stride: usize, channels: usize) -> [(&'static str, f64); 6] {
    [
        ("BYTES", bytes as f64),
        ("STRIDE", stride as f64),
        ("CHANNELS", channels as f64),
        ("ONE", WHOLE.into()),
        ("DOWN_SHIFT", DOWN_SHIFT.into()),
        ("NOWHERE", NOWHERE.into()),
    ]
}

/// Pixels or words per workgroup, as `stereo/line.wgsl` declares it.
const LINE: usize = 64;

/// Returns the workgroups of a pass over `count` pixels or words in linear order.
pub fn linear_workgroups(count: usize) -> [u32; 3] {
    workgroups_2d(count.div_ceil(LINE) as u32)
}

/// The `override` constants of `stereo/common.wgsl`.
pub type Constants = [(&'static str, f64); 14];

/// Returns the constants for pictures of this size, with speckles of up to `max_speckle` pixels removed; `from_right`
/// reverses the path along the rows.
pub fn matcher_constants(
    (width, height): (usize, usize),
    disparities: usize,
    max_speckle: u32,
    from_right: bool,
) -> Constants {
    [
        ("WIDTH", width as f64),
        ("HEIGHT", height as f64),
        ("WORDS", (disparities / 4) as f64),
        ("OUTSIDE_COST", OUTSIDE_COST.into()),
        ("PRIOR_BONUS", PRIOR_BONUS.into()),
        ("P1", P1.into()),
        ("MAX_LR_DIFFERENCE", MAX_LR_DIFFERENCE.into()),
        ("ONE", ONE.into()),
        ("UNKNOWN", UNKNOWN.into()),
        ("FILLED", FILLED.into()),
        ("MAX_NOISE", MAX_NOISE.into()),
        ("MAX_SPECKLE_STEP", MAX_SPECKLE_STEP.into()),
        ("MAX_SPECKLE", max_speckle.into()),
        ("FROM_RIGHT", u8::from(from_right).into()),
    ]
}
