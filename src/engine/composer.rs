//! Composes the subject: virtual background and auto-framing.

use super::Images;
use super::backdrop_player::BackdropPlayer;
use crate::depth::backdrop::{Background, VirtualBackground};
use crate::depth::follow::AutoFraming;
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
use crate::optics::CocField;

/// A picture and its depth before its background was replaced.
#[derive(Default)]
pub struct OriginalFrame {
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

/// How a video behind the subject is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Playback {
    /// Its first picture stays.
    Still,
    /// At the times of the frames, which wait for it.
    EveryPicture,
    /// At the times of the frames, which do not wait.
    Realtime,
}

/// Replaces the background of frames and crops them around the subject.
pub(super) struct Composer {
    backdrop: Option<VirtualBackground>,
    follower: Option<AutoFraming>,
    playback: Playback,
    player: Option<BackdropPlayer>,
    /// The video's picture, as large as it is decoded.
    picture: ColorImage,
}

impl Composer {
    pub fn new(look: &Look, playback: Playback) -> Self {
        let mut composer =
            Self { backdrop: None, follower: None, playback, player: None, picture: ColorImage::default() };
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

    /// Returns whether results have an alpha channel.
    pub fn is_transparent(&self) -> bool {
        self.backdrop.as_ref().is_some_and(|backdrop| *backdrop.background() == Background::Transparent)
    }

    /// Draws the foreground mask of a frame of `size`, before it is composed; blurring it gives alpha.
    pub fn draw_kept(&mut self, size: (u32, u32), map: &DepthMap, field: &CocField, kept: &mut Images) {
        if let (CocField::Depth(lens), Some(backdrop)) = (field, &mut self.backdrop) {
            backdrop.draw_kept((size, map), lens, &mut kept.color, kept.depth.get_or_insert_default());
        }
    }

    /// Shows the picture of a video that is due at `time_ns`, behind frames of `size`.
    fn play_video(&mut self, size: (u32, u32), time_ns: u64) {
        let Self { backdrop: Some(backdrop), playback, player, picture, .. } = self else { return };
        let Background::Video(video) = backdrop.background() else { return };
        if *playback == Playback::Still {
            return;
        }
        if !player.as_ref().is_some_and(|player| player.plays(video)) {
            let waits = *playback == Playback::EveryPicture;
            match BackdropPlayer::start(video.clone(), size, waits) {
                Ok(new) => *player = Some(new),
                Err(error) => {
                    tracing::warn!("--behind video: {error}; its first picture stays");
                    *playback = Playback::Still;
                }
            }
        }
        if player.as_mut().is_some_and(|player| player.take_picture(time_ns, picture)) {
            backdrop.show_covering(picture, size);
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
        self.play_video(color.size(), time_ns);
        let crop = self.follower.as_mut().map(|follower| follower.update_crop(map, lens, time_ns));
        if let Some(backdrop) = &mut self.backdrop {
            backdrop.replace_background(color, map, lens);
        }
        crop
    }
}
