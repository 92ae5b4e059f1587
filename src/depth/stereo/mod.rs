//! Depth from two eyes: the disparity of a rectified pair.
//!
//! [`create`] makes a [`Matcher`]. An executor finds the disparities that both eyes agree on, in whole numbers, so that
//! all executors find the same ([`fixed`]); what is made of them is common to all ([`tidy`]).

mod alike;
mod border;
pub mod check;
pub mod cpu;
pub mod fixed;
mod gaps;
mod half;
pub mod source;
mod speckle;
mod tidy;

use alike::Colors;
use tidy::Tidy;

use crate::compute::GpuError;
use crate::compute::team::Team;
use crate::frame::{ColorImage, DisparityMap, GrayImage};

/// How pairs are matched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Columns and rows of both pictures.
    pub size: (u32, u32),
    /// Disparities that are tried, from 0 on: rounded up to a multiple of 16, and at most [`Settings::MOST_DISPARITIES`].
    pub disparities: u32,
    /// How much is done for it.
    pub effort: Effort,
    /// Threads on the CPU, at least 1.
    pub threads: usize,
}

impl Settings {
    /// As many disparities as can be tried.
    pub const MOST_DISPARITIES: u32 = 256;
}

/// The ladder of speeds of matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// Half the columns, rows and disparities.
    Fast,
    /// All pixels.
    Full,
}

/// A rectified pair.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// What the left eye saw.
    pub left: &'a GrayImage,
    /// The same in colour, if it is known: tells more of what the right eye does not see.
    pub color: Option<&'a ColorImage>,
    /// What the right eye saw.
    pub right: &'a GrayImage,
}

/// Finds the disparity of rectified pairs.
pub trait Matcher: Send {
    /// What runs it, for the report.
    fn describe(&self) -> String;

    /// Changes the effort from the next pair on.
    fn set_effort(&mut self, effort: Effort);

    /// The disparity of `pair` into `into`, which becomes as large as its pictures; every pixel is answered.
    ///
    /// # Errors
    /// The pictures are not of the size that was set; the GPU failed.
    fn disparity(&mut self, pair: Pair, into: &mut DisparityMap) -> Result<(), MatchError>;
}

/// Why a pair has no disparity.
#[derive(Debug, thiserror::Error)]
pub enum MatchError {
    /// Two eyes of one size are needed.
    #[error(
        "the left picture is {}x{}, and the right one {}x{}; both eyes need one size",
        left.0, left.1, right.0, right.1
    )]
    Sizes {
        /// Columns and rows of the left picture.
        left: (u32, u32),
        /// Columns and rows of the right picture.
        right: (u32, u32),
    },
    /// The pictures are of another size than was set.
    #[error("the matcher is made for {}x{} and was given {}x{}", made_for.0, made_for.1, got.0, got.1)]
    Size {
        /// What was set.
        made_for: (u32, u32),
        /// Columns and rows of the pictures.
        got: (u32, u32),
    },
    /// No GPU, or it failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// A matcher on the CPU.
///
/// # Errors
/// None so far.
pub fn create(settings: &Settings) -> Result<Box<dyn Matcher>, MatchError> {
    let team = Team::new("match", settings.threads);
    Ok(Box::new(Matching {
        settings: *settings,
        levels: [Effort::Fast, Effort::Full].map(|effort| Level::new(settings, effort, team.threads())),
        team,
        small: [GrayImage::default(), GrayImage::default()],
    }))
}

/// Finds the disparities that both eyes agree on.
trait Executor: Send {
    fn describe(&self) -> String;

    /// The disparities of the left picture, in fixed point, or unknown.
    fn winners(&mut self, left: &[u8], right: &[u8], team: &mut Team, out: &mut [u16]) -> Result<(), GpuError>;
}

/// Islands of so many pixels are chance, in whole pictures.
const SPECKLE: u32 = 100;

struct Matching {
    settings: Settings,
    team: Team,
    /// By effort.
    levels: [Level; 2],
    /// Left and right at half the size.
    small: [GrayImage; 2],
}

/// What one effort needs.
struct Level {
    executor: Box<dyn Executor>,
    tidy: Tidy,
    map: Vec<u16>,
    px: Vec<f32>,
}

impl Level {
    fn new(settings: &Settings, effort: Effort, threads: usize) -> Self {
        let whole = (settings.size.0 as usize, settings.size.1 as usize);
        let (size, disparities) = match effort {
            Effort::Fast => (half::size(whole), settings.disparities.div_ceil(2)),
            Effort::Full => (whole, settings.disparities),
        };
        let disparities = disparities.next_multiple_of(16).clamp(16, Settings::MOST_DISPARITIES) as usize;
        let pixels = size.0 * size.1;
        Self {
            executor: Box::new(cpu::CpuExecutor::new(size, disparities, threads)),
            tidy: Tidy::new(size),
            map: vec![0; pixels],
            px: vec![0.0; if effort == Effort::Fast { pixels } else { 0 }],
        }
    }
}

impl Matcher for Matching {
    fn describe(&self) -> String {
        self.levels[self.settings.effort as usize].executor.describe()
    }

    fn set_effort(&mut self, effort: Effort) {
        self.settings.effort = effort;
    }

    fn disparity(&mut self, pair: Pair, into: &mut DisparityMap) -> Result<(), MatchError> {
        let Pair { left, color, right } = pair;
        if left.size() != right.size() {
            return Err(MatchError::Sizes { left: left.size(), right: right.size() });
        }
        for got in [Some(left.size()), color.map(ColorImage::size)].into_iter().flatten() {
            if got != self.settings.size {
                return Err(MatchError::Size { made_for: self.settings.size, got });
            }
        }
        let colors = |every| color.map(|image| Colors { image, every });
        into.resize(left.width, left.height);
        let Self { settings, team, levels, small } = self;
        let Level { executor, tidy, map, px } = &mut levels[settings.effort as usize];
        match settings.effort {
            Effort::Full => {
                executor.winners(&left.luma, &right.luma, team, map)?;
                tidy.tidy(map, &left.luma, colors(1), SPECKLE, team, &mut into.px);
            }
            Effort::Fast => {
                half::shrink(left, &mut small[0]);
                half::shrink(right, &mut small[1]);
                executor.winners(&small[0].luma, &small[1].luma, team, map)?;
                tidy.tidy(map, &small[0].luma, colors(2), SPECKLE / 4, team, px);
                half::grow(left, &small[0], px, &mut into.px);
            }
        }
        Ok(())
    }
}
