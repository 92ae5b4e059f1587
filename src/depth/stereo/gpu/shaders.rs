//! The shaders, and the numbers that Rust shares with them.

use super::super::fixed::{AGREE, BONUS, FILLED, NOISE, ONE, OUTSIDE, SLOPE, STEP, UNKNOWN};
use crate::calibration::map::{DOWN_SHIFT, NOWHERE, ONE as WHOLE};
use crate::compute::device::{Shader, shader, workgroups_2d};

/// What the last pair makes likely.
pub const LIKELY: Shader = shader!("stereo_common"; "stereo_likely", "stereo_line");
/// Which neighbours are darker, of both eyes, and P2 between left pixels.
pub const CENSUS: Shader = shader!("stereo_common"; "stereo_census");
/// What each disparity costs.
pub const COST: Shader = shader!("stereo_common"; "stereo_cost");
/// A path along each row.
pub const ROWS: Shader = shader!("stereo_common"; "stereo_rows", "stereo_path");
/// The path down each column.
pub const COLUMNS: Shader = shader!("stereo_common"; "stereo_columns", "stereo_path");
/// What both eyes agree on.
pub const WINNERS: Shader = shader!("stereo_common"; "stereo_winners", "stereo_line");
/// Islands within rows.
pub const RUNS: Shader = shader!("stereo_common"; "stereo_runs", "stereo_row", "stereo_touch");
/// Islands from row to row.
pub const JOIN: Shader = shader!("stereo_common"; "stereo_join", "stereo_line", "stereo_touch", "stereo_root");
/// How large they are.
pub const SIZES: Shader = shader!("stereo_common"; "stereo_sizes", "stereo_line", "stereo_touch", "stereo_root");
/// What is left without small ones, and between it.
pub const GAPS: Shader = shader!("stereo_common"; "stereo_gaps", "stereo_row");
/// The same, as the CPU takes it.
pub const PACK: Shader = shader!("stereo_common"; "stereo_pack", "stereo_line");

pub const ALL: [Shader; 11] = [LIKELY, CENSUS, COST, ROWS, COLUMNS, WINNERS, RUNS, JOIN, SIZES, GAPS, PACK];

/// Pictures of an eye, before they are matched: it has constants of its own.
pub const RECTIFY: Shader = shader!("stereo_line"; "stereo_rectify");

/// The `override` constants of `stereo_rectify.wgsl`, for pictures of so many bytes.
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

/// Pixels, or words, of a workgroup, as `stereo_line.wgsl` declares it.
const LINE: usize = 64;

/// The workgroups of a pass that goes through so many pixels or words in one line.
pub fn in_line(count: usize) -> [u32; 3] {
    workgroups_2d(count.div_ceil(LINE) as u32)
}

/// The `override` constants of `stereo_common.wgsl`.
pub type Constants = [(&'static str, f64); 14];

/// The constants for pictures of this size, where islands of up to `island` pixels are dropped; `from_right` turns the
/// path along the rows round.
pub fn constants((width, height): (usize, usize), disparities: usize, island: u32, from_right: bool) -> Constants {
    [
        ("WIDTH", width as f64),
        ("HEIGHT", height as f64),
        ("WORDS", (disparities / 4) as f64),
        ("OUTSIDE", OUTSIDE.into()),
        ("BONUS", BONUS.into()),
        ("SLOPE", SLOPE.into()),
        ("AGREE", AGREE.into()),
        ("ONE", ONE.into()),
        ("UNKNOWN", UNKNOWN.into()),
        ("FILLED", FILLED.into()),
        ("NOISE", NOISE.into()),
        ("STEP", STEP.into()),
        ("ISLAND", island.into()),
        ("BACK", u8::from(from_right).into()),
    ]
}
