//! A picture that stays on the screen, blurred anew with every look.

use super::super::services::Services;
use bokehcam::bokeh::BokehError;
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::still::{self, Depth};
use bokehcam::engine::{Blur, Images};
use bokehcam::look::Look;
use bokehcam::optics::CocField;

/// A frame that stays.
#[derive(Clone, Debug)]
pub struct Still {
    /// Different for each frame that stayed; the same in another look.
    pub number: u64,
    /// As it was taken, its depth with holes filled where its look follows depth, and what became of it.
    pub images: Images,
    /// The radius of every pixel.
    pub coc: CocField,
    /// The number of the change of look that it is of.
    pub change: u64,
    /// The rung that it was blurred at.
    pub quality: Option<Quality>,
}

/// Blurs the frame that stays.
pub(super) struct HeldBlur {
    held: Still,
    /// The rule of focus at first: while it stays, so does the distance.
    focus: FocusRule,
    again: Blur,
}

/// Shown when a look needs depth that the frame has not.
const NO_DEPTH: &str = "The picture that stays was taken without depth: let the next ones come, for blur by depth.";

impl HeldBlur {
    /// Nothing is blurred yet; `focus` is the rule of the look that it was blurred in.
    pub fn new(held: Still, focus: FocusRule) -> Self {
        Self { held, focus, again: Blur::default() }
    }

    /// The frame in this look, which is that of the change of this number.
    ///
    /// # Errors
    /// The look needs depth that the frame has not, or the executor cannot be made or fails: one line.
    pub fn blur(&mut self, look: &Look, change: u64, services: &mut dyn Services) -> Result<Still, String> {
        let Still { number, images, coc, .. } = &self.held;
        let fixed = if look.focus == self.focus { look.of_frame(coc, None) } else { look.clone() };
        let size = images.color.size();
        let plain = |error: BokehError| match error {
            BokehError::NoDepth => NO_DEPTH.to_owned(),
            error => error.to_string(),
        };
        let (mut made, mut coc) = (images.clone(), *coc);
        if fixed.coc_kind().is_some() {
            let depth = made.depth.take().map(Depth::Final);
            (coc, made.depth) = still::coc_and_depth(&fixed, &mut made.color, depth).map_err(plain)?;
        }
        self.again.follow(&fixed, (size, false), |settings| services.executor(settings, size))?;
        if let Err(error) = self.again.blur(&mut made, coc) {
            self.again = Blur::default();
            return Err(plain(error));
        }
        // What stands behind the subject is no part of the frame as it was taken.
        let depth = images.depth.clone().filter(|_| made.depth.is_some());
        let images = Images { color: images.color.clone(), depth, blurred: made.blurred };
        Ok(Still { number: *number, images, coc, change, quality: self.again.quality() })
    }
}
