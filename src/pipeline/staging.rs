//! Where the subject stands: before what, and in which part of the picture.

use crate::depth::backdrop::{Backdrop, Behind};
use crate::depth::follow::Follower;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
use crate::optics::CocField;

/// Stages the subject of frame after frame.
#[derive(Default)]
pub(super) struct Staging {
    backdrop: Option<Backdrop>,
    follower: Option<Follower>,
}

impl Staging {
    pub fn new(look: &Look) -> Self {
        let mut staging = Self::default();
        staging.follow(look);
        staging
    }

    /// Follows another look.
    pub fn follow(&mut self, look: &Look) {
        if self.backdrop.as_ref().map_or(&Behind::Blur, Backdrop::behind) != &look.behind {
            self.backdrop = Backdrop::new(&look.behind);
        }
        match (&mut self.follower, look.follow.zoom()) {
            (Some(follower), Some(zoom)) => follower.limit(zoom),
            (follower, zoom) => *follower = zoom.map(Follower::new),
        }
    }

    /// Puts what was chosen behind the subject of a picture at `time_ns` of media time, whose depth is finished; returns the part
    /// of it to show, `None` for all.
    pub fn stage(
        &mut self,
        color: &mut ColorImage,
        map: &mut DepthMap,
        field: &CocField,
        time_ns: u64,
    ) -> Option<Crop> {
        let CocField::Depth(lens) = field else { return None };
        let part = self.follower.as_mut().map(|follower| follower.part(map, lens, time_ns));
        if let Some(backdrop) = &mut self.backdrop {
            backdrop.lay(color, map, lens);
        }
        part
    }
}
