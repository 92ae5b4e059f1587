//! A frame held on the screen, blurred again with every new look.

use super::super::services::Services;
use bokehcam::bokeh::BokehError;
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::still::{self, Depth};
use bokehcam::engine::{Blur, Images};
use bokehcam::look::Look;
use bokehcam::optics::CocField;

/// A held frame.
#[derive(Clone, Debug)]
pub struct Still {
    /// Identifies the frame; unchanged when it is blurred with another look.
    pub number: u64,
    /// Input picture, its depth map (holes filled if its look uses depth), and the blurred picture.
    pub images: Images,
    /// Circle of confusion as a function of depth.
    pub coc: CocField,
    /// Number of the look change that it was blurred with.
    pub change: u64,
    /// Quality level that it was blurred with.
    pub quality: Option<Quality>,
}

/// Blurs a held frame.
pub(super) struct HeldBlur {
    held: Still,
    /// Focus rule when the frame was taken: while the look keeps it, the focus distance stays fixed.
    focus: FocusRule,
    blur: Blur,
}

/// Shown when a look needs depth that the frame lacks.
const NO_DEPTH: &str = "The frozen picture was taken without depth: unfreeze for blur by depth.";

impl HeldBlur {
    /// Creates the blur for a frame; `focus` is the focus rule of the look that the frame was taken with.
    pub fn new(held: Still, focus: FocusRule) -> Self {
        Self { held, focus, blur: Blur::default() }
    }

    /// Returns the frame blurred with `look`, which belongs to the look change `change`, on `threads` threads.
    ///
    /// # Errors
    /// Returns a one-line message if the look needs depth that the frame lacks, or the executor cannot be created or
    /// fails.
    pub fn reblur(
        &mut self,
        look: &Look,
        change: u64,
        threads: usize,
        services: &mut dyn Services,
    ) -> Result<Still, String> {
        let Still { number, images, coc, .. } = &self.held;
        let fixed = if look.focus == self.focus { look.for_frame(coc, None) } else { look.clone() };
        let size = images.color.size();
        let plain = |error: BokehError| match error {
            BokehError::NoDepth => NO_DEPTH.to_owned(),
            error => error.to_string(),
        };
        let (mut reblurred, mut coc) = (images.clone(), *coc);
        if fixed.coc_kind().is_some() {
            let depth = reblurred.depth.take().map(Depth::Final);
            (coc, reblurred.depth) =
                still::compute_coc_and_depth(&fixed, &mut reblurred.color, depth, Some(threads)).map_err(plain)?;
        }
        self.blur.set_look(&fixed, (size, false), |settings| services.create_executor(settings, size))?;
        if let Err(error) = self.blur.blur(&mut reblurred, coc) {
            self.blur = Blur::default();
            return Err(plain(error));
        }
        // Keeps the original picture, without the virtual background composed into `reblurred`.
        let depth = images.depth.clone().filter(|_| reblurred.depth.is_some());
        let images = Images { color: images.color.clone(), depth, blurred: reblurred.blurred };
        Ok(Still { number: *number, images, coc, change, quality: self.blur.quality() })
    }
}
