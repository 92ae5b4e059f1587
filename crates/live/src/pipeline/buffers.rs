//! The buffers of a run, and how many there are.

use crate::capture::FrameData;
use bokehcam::bokeh::{BokehError, Settings};
use bokehcam::engine::{Images, OriginalFrame};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, YuyvImage};
use bokehcam::link::LOSSLESS_ITEMS;
use bokehcam::link::pool::Pool;

/// The buffer pools: buffers are created once and return when dropped.
pub(super) struct Pools {
    pub colors: Pool<ColorImage>,
    pub depths: Pool<DepthMap>,
    /// Pictures of the right camera.
    pub rights: Pool<GrayImage>,
    /// Frames before their background was replaced.
    pub original: Pool<OriginalFrame>,
    /// What is kept of frames before a transparent background, and the same blurred.
    pub kept: Pool<Images>,
    /// Blurred pictures.
    pub outs: Pool<ColorImage>,
    pub yuyvs: Pool<YuyvImage>,
}

impl Pools {
    /// Creates the pools for pictures of `size` pixels.
    pub fn new(counts: &BufferCounts, size: (u32, u32), frame_data: FrameData) -> Self {
        let picture = || ColorImage::new(size.0, size.1);
        Self {
            colors: Pool::new(counts.color_buffers(), picture),
            depths: Pool::new(counts.depth_buffers(), DepthMap::default),
            rights: Pool::new(
                if frame_data == FrameData::RightCamera { counts.right_buffers() } else { 0 },
                GrayImage::default,
            ),
            original: Pool::new(counts.original_buffers(), OriginalFrame::default),
            // Empty until a background is transparent; from the replacement of the background to the last stage.
            kept: Pool::new(counts.original_buffers() + counts.output_buffers(), Images::default),
            outs: Pool::new(counts.output_buffers(), picture),
            yuyvs: Pool::new(counts.output_buffers(), YuyvImage::default),
        }
    }
}

/// Counts of buffers such that no stage ever waits for one that another stage holds.
pub(super) struct BufferCounts {
    /// Frames that the executor has in flight; 0 if nothing is blurred.
    pub in_blur: usize,
    /// Whether a viewer receives every picture and its inputs.
    pub is_viewed: bool,
}

/// Maximum number of frames that any executor has in flight.
pub(super) const MAX_IN_FLIGHT: usize = 4;

/// Checks that the memory suffices for a run over `frames` pictures of `size` (width, height): for blurring one, and
/// for those in flight.
///
/// # Errors
/// [`BokehError::Memory`].
pub fn check_memory(size: (u32, u32), frames: Option<u64>) -> Result<(), BokehError> {
    let counts = BufferCounts { in_blur: MAX_IN_FLIGHT, is_viewed: false };
    // All colour buffers exist from the start; depth buffers are created as frames come.
    let depths = frames.map_or(counts.depth_buffers() as u64, |frames| frames.min(counts.depth_buffers() as u64));
    Settings::check_memory(size, 3 * (counts.color_buffers() + counts.output_buffers()) as u64 + 4 * depths)
}

impl BufferCounts {
    /// The items of a link, and the one that is displaced or waits for room.
    const LINK_BUFFERS: usize = LOSSLESS_ITEMS + 1;
    /// The item that a stage works on.
    const STAGE_BUFFERS: usize = 1;

    fn color_buffers(&self) -> usize {
        // Three stages with the links behind them, and the last stage: if nothing is blurred, the captured pictures
        // themselves go to the sink.
        3 * (Self::STAGE_BUFFERS + Self::LINK_BUFFERS) + Self::STAGE_BUFFERS + self.in_blur + self.viewer_buffers()
    }

    /// Returns the buffers of a viewer: one shown, one being taken, one kept for long.
    fn viewer_buffers(&self) -> usize {
        if self.is_viewed { 3 * Self::STAGE_BUFFERS + Self::LINK_BUFFERS } else { 0 }
    }

    fn depth_buffers(&self) -> usize {
        self.color_buffers()
    }

    /// Returns the buffers for original frames, from the replacement of the background until they are blurred.
    fn original_buffers(&self) -> usize {
        2 * Self::STAGE_BUFFERS + Self::LINK_BUFFERS + self.in_blur
    }

    /// Returns the buffers for the right camera, whose pictures go no further than the depth stage.
    fn right_buffers(&self) -> usize {
        2 * Self::STAGE_BUFFERS + Self::LINK_BUFFERS
    }

    /// Returns the buffers for blurred pictures: in the executor, the blur and deliver stages, and the link between
    /// them.
    fn output_buffers(&self) -> usize {
        if self.in_blur == 0 {
            0
        } else {
            self.in_blur + 2 * Self::STAGE_BUFFERS + Self::LINK_BUFFERS + self.viewer_buffers()
        }
    }
}
