//! Composes the subject: virtual background and auto-framing.

use crate::depth::backdrop::{Background, VirtualBackground};
use crate::depth::follow::AutoFraming;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
use crate::optics::CocField;

/// A picture and its depth before its background was replaced.
#[derive(Default)]
pub(crate) struct OriginalFrame {
    color: ColorImage,
    map: DepthMap,
}

impl OriginalFrame {
    /// Copies a frame before it is changed.
    pub fn copy_from(&mut self, color: &ColorImage, map: &DepthMap) {
        self.color.copy_from(color);
        self.map.copy_from(map);
    }

    /// Swaps the original back into a frame.
    pub fn restore(&mut self, color: &mut ColorImage, map: &mut DepthMap) {
        std::mem::swap(&mut self.color, color);
        std::mem::swap(&mut self.map, map);
    }
}

/// Replaces the background of frames and crops them around the subject.
#[derive(Default)]
pub(super) struct Composer {
    backdrop: Option<VirtualBackground>,
    follower: Option<AutoFraming>,
}

impl Composer {
    pub fn new(look: &Look) -> Self {
        let mut composer = Self::default();
        composer.set_look(look);
        composer
    }

    /// Follows another look.
    pub fn set_look(&mut self, look: &Look) {
        if self.backdrop.as_ref().map_or(&Background::Blur, VirtualBackground::background) != &look.background {
            self.backdrop = VirtualBackground::new(&look.background);
        }
        match (&mut self.follower, look.follow.zoom()) {
            (Some(follower), Some(zoom)) => follower.set_max_zoom(zoom),
            (follower, zoom) => *follower = zoom.map(AutoFraming::new),
        }
    }

    /// Returns whether pictures with this CoC are changed.
    pub fn replaces_background(&self, field: &CocField) -> bool {
        self.backdrop.is_some() && matches!(field, CocField::Depth(_))
    }

    /// Replaces the background behind the subject of a picture whose depth is finished; `time_ns` is media time.
    /// Returns the crop to show, `None` for all.
    pub fn compose(
        &mut self,
        color: &mut ColorImage,
        map: &mut DepthMap,
        field: &CocField,
        time_ns: u64,
    ) -> Option<Crop> {
        let CocField::Depth(lens) = field else { return None };
        let crop = self.follower.as_mut().map(|follower| follower.update_crop(map, lens, time_ns));
        if let Some(backdrop) = &mut self.backdrop {
            backdrop.replace_background(color, map, lens);
        }
        crop
    }
}
