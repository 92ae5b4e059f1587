//! The buffers of a run, and how many there are.

use crate::bokeh::{BokehError, Settings};
use crate::capture::Brings;
use crate::engine::Taken;
use crate::frame::{ColorImage, DepthMap, GrayImage, YuyvImage};
use crate::link::LOSSLESS_ITEMS;
use crate::link::pool::Pool;

/// The buffers: they are made once, and come back when they are dropped.
pub(super) struct Pools {
    pub colors: Pool<ColorImage>,
    pub depths: Pool<DepthMap>,
    /// The right eye's pictures.
    pub rights: Pool<GrayImage>,
    /// Frames as they were taken, where something else stands behind the subject.
    pub taken: Pool<Taken>,
    /// Blurred pictures.
    pub outs: Pool<ColorImage>,
    pub yuyvs: Pool<YuyvImage>,
}

impl Pools {
    /// For pictures of `size` pixels.
    pub fn new(places: &Places, size: (u32, u32), brings: Brings) -> Self {
        let picture = || ColorImage::new(size.0, size.1);
        Self {
            colors: Pool::new(places.colors(), picture),
            depths: Pool::new(places.depths(), DepthMap::default),
            rights: Pool::new(if brings == Brings::RightEye { places.rights() } else { 0 }, GrayImage::default),
            taken: Pool::new(places.taken(), Taken::default),
            outs: Pool::new(places.outs(), picture),
            yuyvs: Pool::new(places.outs(), YuyvImage::default),
        }
    }
}

/// Room for buffers along the way, so that no stage waits for one that another has no need to give back.
pub(super) struct Places {
    /// Frames that the executor has in hand at once; 0 where nothing blurs.
    pub in_blur: usize,
    /// Whether a viewer is sent every picture, and what it was made of.
    pub viewed: bool,
}

/// Most frames that any executor has in hand.
pub(super) const MOST_IN_FLIGHT: usize = 4;

/// Whether there is room for a run over `frames` pictures of `size` (width, height): for blurring one, and for those under way.
///
/// # Errors
/// [`BokehError::Memory`].
pub fn check_room(size: (u32, u32), frames: Option<u64>) -> Result<(), BokehError> {
    let places = Places { in_blur: MOST_IN_FLIGHT, viewed: false };
    // Colours are there from the start, depth as it comes.
    let depths = frames.map_or(places.depths() as u64, |frames| frames.min(places.depths() as u64));
    Settings::check_room(size, 3 * (places.colors() + places.outs()) as u64 + 4 * depths)
}

impl Places {
    /// A link's items, and the one that it displaces or that waits for room.
    const LINK: usize = LOSSLESS_ITEMS + 1;
    /// The one that a stage is working on.
    const HAND: usize = 1;

    pub fn colors(&self) -> usize {
        // Three stages with the links behind them, and the last stage: where nothing blurs, the captured pictures
        // themselves go on to the sink.
        3 * (Self::HAND + Self::LINK) + Self::HAND + self.in_blur + self.views()
    }

    /// Those that a viewer has: one that it shows, one that it takes, and one that it keeps for long.
    fn views(&self) -> usize {
        if self.viewed { 3 * Self::HAND + Self::LINK } else { 0 }
    }

    pub fn depths(&self) -> usize {
        self.colors()
    }

    /// Frames as they were taken, from before something else stood behind the subject until they are blurred.
    pub fn taken(&self) -> usize {
        2 * Self::HAND + Self::LINK + self.in_blur
    }

    /// The right eye's picture goes no further than its depth.
    pub fn rights(&self) -> usize {
        2 * Self::HAND + Self::LINK
    }

    /// Blurred pictures: with the executor, the blur and the deliver stage, and in the link between those.
    pub fn outs(&self) -> usize {
        if self.in_blur == 0 { 0 } else { self.in_blur + 2 * Self::HAND + Self::LINK + self.views() }
    }
}
