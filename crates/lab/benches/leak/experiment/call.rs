//! The blur of a call, and a camera that moves.

use bokehcam::bokeh::{self, Bokeh, BokehError, Job, Settings};
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::look::{Effect, Look, Strength};

use super::card::{Card, PERSON_M, WALL_M};

/// Frame period.
const PERIOD_NS: u64 = 33_333_333;
/// How far a hand-held camera moves the wall, in pixels: the phases of cells up to this size are all seen.
const MOTION_PX: f32 = 16.0;

/// How a call blurs a card.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CallSettings {
    /// Blur radius of the wall, in pixels.
    pub radius_px: f32,
    /// [`Settings::privacy`].
    pub privacy: bool,
    /// Quality level.
    pub quality: Quality,
    /// Threads; `None` uses all cores.
    pub threads: Option<usize>,
}

/// A call that shows a card, frame by frame.
pub struct Call {
    blur: Box<dyn Bokeh>,
    calculator: CocCalculator,
    depth: DepthMap,
    time_ns: u64,
}

impl Call {
    /// Begins a call about a card: measured depth, the person in focus, everything else as by default in real time.
    ///
    /// # Errors
    /// The radius is too wide.
    pub fn new(card: &Card, settings: &CallSettings) -> Result<Self, BokehError> {
        let at_infinity_px = settings.radius_px / (1.0 - PERSON_M / WALL_M);
        let look = Look {
            effect: Effect::Dof,
            focus: FocusRule::Metres(PERSON_M),
            strength: Strength::AtInfinity(at_infinity_px),
            max_coc_px: Some(at_infinity_px),
            quality: Some(settings.quality),
            ..Look::default()
        };
        let realtime = look.blur_settings(card.size, true).expect("the effect dof blurs");
        let of_blur = Settings { privacy: settings.privacy, ..realtime };
        let blur = bokeh::create_blur(&of_blur, card.size, None, settings.threads)?;
        let calculator = CocCalculator::new(look.coc_rule(card.size), Postprocess::Fill);
        Ok(Self { blur, calculator, depth: card.depth(), time_ns: 0 })
    }

    /// Returns what the others see of a frame.
    ///
    /// # Errors
    /// The executor failed.
    pub fn show(&mut self, frame: &ColorImage) -> Result<ColorImage, BokehError> {
        let mut depth = self.depth.clone();
        let coc = self.calculator.compute(&mut depth, frame, self.time_ns);
        self.time_ns += PERIOD_NS;
        self.blur.submit(Job::new(Pooled::detached(frame.clone()), Some(Pooled::detached(depth)), coc))?;
        let finished = self.blur.collect(true)?;
        Ok(finished.and_then(|mut finished| finished.picture.memory_mut().map(std::mem::take)).unwrap_or_default())
    }
}

/// Returns by how much a hand-held camera moves the wall in each frame, in pixels to the right and down: the R2 sequence
/// (M. Roberts 2018), whose sub-pixel phases are even.
pub fn hand_held_shifts_px(frames: usize) -> Vec<(f32, f32)> {
    /// Inverse powers of the plastic number.
    const STEP: (f32, f32) = (0.754_877_7, 0.569_840_3);
    let place = |k: usize, step: f32| MOTION_PX * ((k as f32 * step).fract() - 0.5);
    (1..=frames).map(|k| (place(k, STEP.0), place(k, STEP.1))).collect()
}
