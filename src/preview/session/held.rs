//! A picture that stays on the screen, blurred anew with every look.

use super::super::services::Services;
use crate::bokeh::BokehError;
use crate::budget::Quality;
use crate::depth::focus::FocusRule;
use crate::engine::still::{self, Depth};
use crate::engine::{Blur, Images};
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
use crate::optics::CocField;

/// A frame that stays.
pub struct Held {
    /// Different for each frame that stayed.
    pub number: u64,
    /// As it was taken.
    pub color: ColorImage,
    /// Its depth, holes filled.
    pub depth: Option<DepthMap>,
    /// The radius of every pixel.
    pub coc: CocField,
    /// Whether it waits for the look that was chosen before it stayed.
    pub is_behind: bool,
}

/// The frame in another look.
#[derive(Debug)]
pub struct Blurred {
    /// Of [`Held::number`].
    pub number: u64,
    pub picture: ColorImage,
    /// Its depth, where the look follows depth.
    pub depth: Option<DepthMap>,
    pub coc: CocField,
    /// The number of the change of look.
    pub change: u64,
    pub quality: Option<Quality>,
}

/// Blurs the frame that stays.
pub(super) struct HeldBlur {
    held: Held,
    /// The rule of focus at first: while it stays, so does the distance.
    focus: FocusRule,
    again: Blur,
}

/// Shown when a look needs depth that the frame has not.
const NO_DEPTH: &str = "The picture that stays was taken without depth: let the next ones come, for blur by depth.";

impl HeldBlur {
    /// Nothing is blurred yet; `focus` is the rule of the look that it was blurred in.
    pub fn new(held: Held, focus: FocusRule) -> Self {
        Self { held, focus, again: Blur::default() }
    }

    /// The frame in this look, which is that of the change of this number.
    ///
    /// # Errors
    /// The look needs depth that the frame has not, or the executor cannot be made or fails: one line.
    pub fn blur(&mut self, look: &Look, change: u64, services: &mut dyn Services) -> Result<Blurred, String> {
        let Held { number, color, depth, coc, .. } = &self.held;
        let fixed = if look.focus == self.focus { look.of_frame(coc, None) } else { look.clone() };
        if fixed.coc_kind().is_none() {
            let (picture, depth) = (color.clone(), depth.clone());
            return Ok(Blurred { number: *number, picture, depth, coc: *coc, change, quality: None });
        }
        let plain = |error: BokehError| match error {
            BokehError::NoDepth => NO_DEPTH.to_owned(),
            error => error.to_string(),
        };
        let (mut color, size) = (color.clone(), color.size());
        let (coc, staged) = still::coc_and_depth(&fixed, &mut color, depth.clone().map(Depth::Final)).map_err(plain)?;
        let depth = depth.clone().filter(|_| staged.is_some());
        self.again.follow(&fixed, (size, false), |settings| services.executor(settings, size))?;
        let mut images = Images { color, depth: staged, ..Images::default() };
        let quality = self.again.quality();
        if let Err(error) = self.again.blur(&mut images, coc) {
            self.again = Blur::default();
            return Err(plain(error));
        }
        Ok(Blurred { number: *number, picture: images.blurred, depth, coc, change, quality })
    }
}
