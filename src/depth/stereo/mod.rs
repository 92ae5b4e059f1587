//! Depth from stereo: the disparity of a rectified pair.
//!
//! [`create`] makes a [`Matcher`]. An executor finds the disparities that pass the left-right consistency check and
//! fills the gaps between them, in integers, so that all executors agree to the bit ([`fixed`]); the post-processing is
//! common to all (`postprocess`).

pub mod check;
mod color_similarity;
#[doc(hidden)]
pub mod cpu;
pub mod executor;
mod executors;
mod fattening;
pub mod fixed;
mod gaps;
#[doc(hidden)]
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
mod half;
mod mismatches;
mod penalty;
mod postprocess;
mod rectify;
pub mod source;

use std::iter;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use color_similarity::Colors;
use executor::Executor;
use executors::Executors;
use postprocess::PostProcessor;

use crate::compute::thread_pool::{DisjointParts, ThreadPool};
use crate::compute::{Backend, Device, GpuError, memory};
use crate::frame::{ColorImage, DisparityMap, GrayImage};
use crate::names::named;

/// Settings of a matcher.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Columns and rows of both pictures.
    pub size: (u32, u32),
    /// Number of candidate disparities, from 0 on: rounded up ([`fixed::candidate_count`]), at most
    /// [`Settings::MAX_DISPARITIES`].
    pub disparities: u32,
    /// Resolution at which pairs are matched.
    pub effort: Effort,
    /// Threads on the CPU, at least 1.
    pub threads: usize,
}

impl Settings {
    /// The largest number of candidate disparities.
    pub const MAX_DISPARITIES: u32 = 256;
}

named! {
    /// The ladder of speeds of matching.
    pub enum Effort default Full {
        /// Half the columns and rows
        Fast = "fast",
        /// All pixels
        Full = "full",
    }
}

/// A rectified stereo pair: a scene point lies in the same row of both pictures.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// Picture of the left camera.
    pub left: &'a GrayImage,
    /// The left picture in colour, if available: it improves the part that the right camera does not see.
    pub color: Option<&'a ColorImage>,
    /// Picture of the right camera.
    pub right: &'a GrayImage,
}

/// Computes the disparity of rectified pairs.
pub trait Matcher: Send {
    /// Describes the device or the CPU that matches, in one line for the report.
    fn describe(&self) -> String;

    /// Changes the effort from the next pair on.
    fn set_effort(&mut self, effort: Effort);

    /// Returns the GPU that the matcher uses, so that other steps of the pipeline can share it.
    #[doc(hidden)]
    fn device(&self) -> Option<Arc<Device>> {
        None
    }

    /// Computes the disparity of `pair` in pixels and resizes `into` to the size of its pictures; every pixel gets a
    /// value.
    ///
    /// # Errors
    /// Fails if the pictures do not have the size in the settings, or the GPU fails.
    fn compute_disparity(&mut self, pair: Pair, into: &mut DisparityMap) -> Result<(), MatchError>;
}

/// Error of matching a pair.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum MatchError {
    /// The pictures of a pair differ in size.
    #[error(
        "the left picture is {}x{}, and the right one {}x{}; both need the same size",
        left.0, left.1, right.0, right.1
    )]
    Sizes { left: (u32, u32), right: (u32, u32) },
    /// The pictures do not have the size that the matcher was made for.
    #[error("the matcher is made for {}x{}, but was given {}x{}", made_for.0, made_for.1, got.0, got.1)]
    Size { made_for: (u32, u32), got: (u32, u32) },
    /// There is not enough memory to match pictures of this size.
    #[error(
        "matching pictures of {}x{} needs about {needed_mb} MB of memory, and {free_mb} MB are free; scale both down, or \
         free some",
        size.0, size.1
    )]
    Memory { size: (u32, u32), needed_mb: u64, free_mb: u64 },
    /// There is no GPU, or it failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Peak memory per pixel of reading and matching a pair (measured: `docs/reliability.md`).
const BYTES_PER_PIXEL: u64 = 52;

/// Creates a matcher on the GPU or the CPU; `adapter` is part of a GPU adapter's name.
///
/// # Errors
/// Fails if a GPU is required and none fits, if it fails, or if there is not enough memory.
pub fn create(settings: &Settings, backend: Backend, adapter: Option<&str>) -> Result<Box<dyn Matcher>, MatchError> {
    if let Some((needed_mb, free_mb)) = memory::find_shortage_mb(settings.size, BYTES_PER_PIXEL) {
        return Err(MatchError::Memory { size: settings.size, needed_mb, free_mb });
    }
    let workers = ThreadPool::new("match", settings.threads);
    let executors = Executors::new(backend, adapter, workers.thread_count())?;
    let level = |effort| EffortLevel::new(settings, effort, &executors);
    Ok(Box::new(StereoMatcher {
        settings: *settings,
        levels: [level(Effort::Fast)?, level(Effort::Full)?],
        workers,
        half_pair: [GrayImage::default(), GrayImage::default()],
        taken: iter::repeat_with(AtomicBool::default).take(settings.size.1 as usize).collect(),
    }))
}

/// Speckles of at most this many pixels are treated as mismatches, at full resolution.
const SPECKLE: u32 = 100;

struct StereoMatcher {
    settings: Settings,
    workers: ThreadPool,
    /// Indexed by [`Effort`].
    levels: [EffortLevel; 2],
    /// Left and right picture at half resolution.
    half_pair: [GrayImage; 2],
    /// A flag per row, with which [`DisjointParts`] ensures that only one thread writes it.
    taken: Vec<AtomicBool>,
}

/// State of one effort.
struct EffortLevel {
    executor: Box<dyn Executor>,
    postprocessor: PostProcessor,
    /// Disparities in fixed point, as the executor returns them.
    map: Vec<u16>,
    /// Disparities of the half-size pair in pixels; empty at full size, where they go to the caller's map.
    px: Vec<f32>,
}

impl EffortLevel {
    fn new(settings: &Settings, effort: Effort, executors: &Executors) -> Result<Self, GpuError> {
        let whole = (settings.size.0 as usize, settings.size.1 as usize);
        let (size, disparities, max_speckle) = match effort {
            // At half resolution a speckle has a quarter of its pixels.
            Effort::Fast => (half::size(whole), settings.disparities.div_ceil(2), SPECKLE / 4),
            Effort::Full => (whole, settings.disparities, SPECKLE),
        };
        let pixels = size.0 * size.1;
        Ok(Self {
            executor: executors.create_executor(size, disparities as usize, max_speckle)?,
            postprocessor: PostProcessor::new(size),
            map: vec![0; pixels],
            px: vec![0.0; if effort == Effort::Fast { pixels } else { 0 }],
        })
    }

    /// Matches a pair of this level's size and writes a disparity for every pixel, in pixels, to `into`, or to the
    /// level's own `px` if that is `None`.
    fn match_pair(
        &mut self,
        pair: [&GrayImage; 2],
        colors: Option<Colors>,
        workers: &mut ThreadPool,
        into: Option<&mut [f32]>,
    ) -> Result<(), GpuError> {
        let Self { executor, postprocessor, map, px } = self;
        let [luma, right] = pair.map(|picture| &*picture.luma);
        executor.compute_disparities([luma, right], workers, map)?;
        postprocessor.postprocess(map, luma, colors, workers, into.unwrap_or(px));
        Ok(())
    }
}

impl Matcher for StereoMatcher {
    fn describe(&self) -> String {
        self.levels[self.settings.effort as usize].executor.describe()
    }

    fn device(&self) -> Option<Arc<Device>> {
        self.levels[self.settings.effort as usize].executor.device()
    }

    fn set_effort(&mut self, effort: Effort) {
        self.settings.effort = effort;
    }

    fn compute_disparity(&mut self, pair: Pair, into: &mut DisparityMap) -> Result<(), MatchError> {
        let Pair { left, color, right } = pair;
        if left.size() != right.size() {
            return Err(MatchError::Sizes { left: left.size(), right: right.size() });
        }
        for got in [Some(left.size()), color.map(ColorImage::size)].into_iter().flatten() {
            if got != self.settings.size {
                return Err(MatchError::Size { made_for: self.settings.size, got });
            }
        }
        // Half-size pictures are matched with every second pixel of the colour image.
        let colors = |stride| color.map(|image| Colors { image, stride });
        into.resize(left.width, left.height);
        let Self { settings, workers, levels, half_pair, taken } = self;
        let level = &mut levels[settings.effort as usize];
        match settings.effort {
            Effort::Full => level.match_pair([left, right], colors(1), workers, Some(&mut into.px))?,
            Effort::Fast => {
                half::downsample(left, &mut half_pair[0]);
                half::downsample(right, &mut half_pair[1]);
                let [small_left, small_right] = &*half_pair;
                level.match_pair([small_left, small_right], colors(2), workers, None)?;
                let (px, rows) = (&level.px, DisjointParts::new(&mut into.px, left.width as usize, taken));
                workers.run(left.height as usize, &|y| half::upsample_row(left, small_left, px, y, rows.part(y)));
            }
        }
        Ok(())
    }
}
