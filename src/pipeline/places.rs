//! The buffers of a run, and how many there are.

use crate::bokeh::{BokehError, Settings};
use crate::capture::Brings;
use crate::engine::OriginalFrame;
use crate::frame::{ColorImage, DepthMap, GrayImage, YuyvImage};
use crate::link::LOSSLESS_ITEMS;
use crate::link::pool::Pool;

/// The buffer pools: buffers are created once and return when dropped.
pub(super) struct Pools {
    pub colors: Pool<ColorImage>,
    pub depths: Pool<DepthMap>,
    /// Pictures of the right camera.
    pub rights: Pool<GrayImage>,
    /// Frames before their background was replaced.
    pub original: Pool<OriginalFrame>,
    /// Blurred pictures.
    pub outs: Pool<ColorImage>,
    pub yuyvs: Pool<YuyvImage>,
}

impl Pools {
    /// Creates the pools for pictures of `size` pixels.
    pub fn new(places: &Places, size: (u32, u32), brings: Brings) -> Self {
        let picture = || ColorImage::new(size.0, size.1);
        Self {
            colors: Pool::new(places.colors(), picture),
            depths: Pool::new(places.depths(), DepthMap::default),
            rights: Pool::new(if brings == Brings::RightCamera { places.rights() } else { 0 }, GrayImage::default),
            original: Pool::new(places.original(), OriginalFrame::default),
            outs: Pool::new(places.outs(), picture),
            yuyvs: Pool::new(places.outs(), YuyvImage::default),
        }
    }
}

/// Counts of buffers such that no stage ever waits for one that another stage holds.
pub(super) struct Places {
    /// Frames that the executor has in flight; 0 if nothing is blurred.
    pub in_blur: usize,
    /// Whether a viewer receives every picture and its inputs.
    pub viewed: bool,
}

/// Maximum number of frames that any executor has in flight.
pub(super) const MAX_IN_FLIGHT: usize = 4;

/// Checks that the memory suffices for a run over `frames` pictures of `size` (width, height): for blurring one, and
/// for those in flight.
///
/// # Errors
/// [`BokehError::Memory`].
pub fn check_room(size: (u32, u32), frames: Option<u64>) -> Result<(), BokehError> {
    let places = Places { in_blur: MAX_IN_FLIGHT, viewed: false };
    // All colour buffers exist from the start; depth buffers are created as frames come.
    let depths = frames.map_or(places.depths() as u64, |frames| frames.min(places.depths() as u64));
    Settings::check_room(size, 3 * (places.colors() + places.outs()) as u64 + 4 * depths)
}

impl Places {
    /// The items of a link, and the one that is displaced or waits for room.
    const LINK: usize = LOSSLESS_ITEMS + 1;
    /// The item that a stage works on.
    const HAND: usize = 1;

    pub fn colors(&self) -> usize {
        // Three stages with the links behind them, and the last stage: if nothing is blurred, the captured pictures
        // themselves go to the sink.
        3 * (Self::HAND + Self::LINK) + Self::HAND + self.in_blur + self.views()
    }

    /// Returns the buffers of a viewer: one shown, one being taken, one kept for long.
    fn views(&self) -> usize {
        if self.viewed { 3 * Self::HAND + Self::LINK } else { 0 }
    }

    pub fn depths(&self) -> usize {
        self.colors()
    }

    /// Returns the buffers for original frames, from the replacement of the background until they are blurred.
    pub fn original(&self) -> usize {
        2 * Self::HAND + Self::LINK + self.in_blur
    }

    /// Returns the buffers for the right camera, whose pictures go no further than the depth stage.
    pub fn rights(&self) -> usize {
        2 * Self::HAND + Self::LINK
    }

    /// Returns the buffers for blurred pictures: in the executor, the blur and deliver stages, and the link between
    /// them.
    pub fn outs(&self) -> usize {
        if self.in_blur == 0 { 0 } else { self.in_blur + 2 * Self::HAND + Self::LINK + self.views() }
    }
}
