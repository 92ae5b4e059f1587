//! The shaders, and the numbers that Rust shares with them.

use super::super::fixed::{AGREE, BONUS, ONE, OUTSIDE, SLOPE, UNKNOWN};
use crate::compute::device::Shader;

macro_rules! shader {
    ($name:literal $(, $shared:literal)*) => {
        Shader {
            name: $name,
            source: concat!(
                include_str!("../../../../shaders/stereo_common.wgsl"),
                $(include_str!(concat!("../../../../shaders/", $shared, ".wgsl")),)*
                include_str!(concat!("../../../../shaders/", $name, ".wgsl")),
            ),
        }
    };
}

/// Which neighbours are darker, of both eyes, and P2 between left pixels.
pub const CENSUS: Shader = shader!("stereo_census");
/// What each disparity costs.
pub const COST: Shader = shader!("stereo_cost");
/// A path along each row.
pub const ROWS: Shader = shader!("stereo_rows", "stereo_path");
/// The path down each column.
pub const COLUMNS: Shader = shader!("stereo_columns", "stereo_path");
/// What both eyes agree on.
pub const WINNERS: Shader = shader!("stereo_winners");

pub const ALL: [Shader; 5] = [CENSUS, COST, ROWS, COLUMNS, WINNERS];

/// The `override` constants of `stereo_common.wgsl`.
pub type Constants = [(&'static str, f64); 10];

/// The constants for pictures of this size; `from_right` turns the path along the rows round.
pub fn constants((width, height): (usize, usize), disparities: usize, from_right: bool) -> Constants {
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
        ("BACK", u8::from(from_right).into()),
    ]
}
