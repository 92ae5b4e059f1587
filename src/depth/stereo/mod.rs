//! Depth from two eyes: the disparity of a rectified pair.

pub mod check;
pub mod source;
pub mod stand_in;

use crate::compute::GpuError;
use crate::frame::{DisparityMap, GrayImage};

/// How a pair is matched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Disparities that are tried, from 0: a multiple of 16, at least 16 and at most [`Settings::MOST_DISPARITIES`].
    pub disparities: u32,
    /// How much is done for it.
    pub effort: Effort,
}

impl Settings {
    /// As many disparities as can be tried.
    pub const MOST_DISPARITIES: u32 = 256;
}

/// The ladder of speeds of matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// Half the columns and rows.
    Fast,
    /// All pixels.
    Full,
}

/// Finds the disparity of rectified pairs.
pub trait Matcher: Send {
    /// What runs it, for the report.
    fn describe(&self) -> String;

    /// Changes the effort from the next pair on.
    fn set_effort(&mut self, effort: Effort);

    /// The disparity of the pair `left`, `right` into `into`, which becomes as large as they are; every pixel is
    /// answered.
    ///
    /// # Errors
    /// The pictures are not of one size; the GPU failed.
    fn disparity(&mut self, left: &GrayImage, right: &GrayImage, into: &mut DisparityMap) -> Result<(), MatchError>;
}

/// Why a pair has no disparity.
#[derive(Debug, thiserror::Error)]
pub enum MatchError {
    /// Two eyes of one size are needed.
    #[error("the left picture is {}x{}, and the right one {}x{}; both eyes need one size", left.0, left.1, right.0, right.1)]
    Sizes {
        /// Columns and rows of the left picture.
        left: (u32, u32),
        /// Columns and rows of the right picture.
        right: (u32, u32),
    },
    /// No GPU, or it failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
