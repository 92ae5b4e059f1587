//! A picture that stays on the screen, blurred anew with every look.

use super::super::services::Services;
use bokehcam::bokeh::{self, Bokeh, BokehError};
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam::pipeline::still::{self, Depth};

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
    executor: Option<(bokeh::Settings, Box<dyn Bokeh>)>,
}

/// Shown when a look needs depth that the frame has not.
const NO_DEPTH: &str = "The picture that stays was taken without depth: let the next ones come, for blur by depth.";

impl HeldBlur {
    /// Nothing is blurred yet; `focus` is the rule of the look that it was blurred in.
    pub fn new(held: Held, focus: FocusRule) -> Self {
        Self { held, focus, executor: None }
    }

    /// The frame in this look, which is that of the change of this number.
    ///
    /// # Errors
    /// The look needs depth that the frame has not, or the executor cannot be made or fails: one line.
    pub fn blur(&mut self, look: &Look, change: u64, services: &mut dyn Services) -> Result<Blurred, String> {
        let Held { number, color, depth, coc, .. } = &self.held;
        let fixed = if look.focus == self.focus { look.of_frame(coc, None) } else { look.clone() };
        let Some(settings) = fixed.settings(color.size(), false) else {
            let (picture, depth) = (color.clone(), depth.clone());
            return Ok(Blurred { number: *number, picture, depth, coc: *coc, change, quality: None });
        };
        let plain = |error: BokehError| match error {
            BokehError::NoDepth => NO_DEPTH.to_owned(),
            error => error.to_string(),
        };
        let mut color = color.clone();
        let (coc, staged) = still::coc_and_depth(&fixed, &mut color, depth.clone().map(Depth::Final)).map_err(plain)?;
        let depth = depth.clone().filter(|_| staged.is_some());
        if self.executor.as_ref().is_none_or(|(made_for, _)| *made_for != settings) {
            let executor = services.executor(&settings, color.size())?;
            self.executor = Some((settings.clone(), executor));
        }
        let Some((_, executor)) = &mut self.executor else { return Err(BokehError::Lost.to_string()) };
        let blurred = still::blur_with(&mut **executor, settings.quality, color, staged, coc);
        match blurred {
            Ok(picture) => {
                Ok(Blurred { number: *number, picture, depth, coc, change, quality: Some(settings.quality) })
            }
            Err(error) => {
                self.executor = None;
                Err(plain(error))
            }
        }
    }
}
