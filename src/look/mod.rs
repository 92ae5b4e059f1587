//! The look: all settings of the blur, for pictures of any size.
//!
//! A [`Look`] is data: the table [`settings`] reads and writes it, and a [`Patch`] changes parts of it. For pictures of
//! one size it becomes the executor's [`bokeh::Settings`] and a [`CocRule`].

mod aperture;
mod background;
mod change;
mod coc;
mod effect;
mod files;
mod follow;
pub mod number;
mod patch;
pub mod presets;
mod privacy;
pub mod settings;
mod source_depth;
mod strength;
mod tilt;

pub use aperture::ApertureSetting;
pub use background::BackgroundSetting;
pub use change::{Change, LookError};
pub use coc::{CocAtInfinity, CocRule};
pub use effect::{BackgroundMemory, Effect, Refine, Reuse};
pub use files::{FileReaders, register_readers};
pub use follow::FramingZoom;
pub use patch::Value;
pub use privacy::{Privacy, SmallBlur};
pub use settings::{Patch, SETTINGS};
pub use source_depth::{LookFacts, Metres};
pub use strength::Strength;
pub use tilt::Tilt;

use crate::bokeh::{self, aperture::Aperture};
use crate::budget::Quality;
use crate::depth::backdrop::Background;
use crate::depth::focus::FocusRule;
use crate::optics::{CocField, CocKind};

/// CoC radius at infinity, as a fraction of the picture's height: like a portrait lens wide open.
pub const COC_AT_INFINITY_PER_HEIGHT: f32 = 1.0 / 45.0;
/// Largest CoC radius in front of or behind the focal plane, as a fraction of the picture's height.
pub const MAX_COC_PER_HEIGHT: f32 = 0.06;
/// Largest CoC radius that settings accept, in pixels: pictures have sides of up to 16384 px, and a radius above the
/// diagonal makes no difference.
pub const MAX_RADIUS_PX: f32 = 20_000.0;

/// The quality levels at which frames are blurred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityRule {
    /// A single level.
    Fixed(Quality),
    /// Any level, as time allows, starting at this one; the executor must support all.
    Auto(Quality),
}

/// Everything about the blur, for pictures of any size.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Which input determines the CoC radius.
    pub effect: Effect,
    /// Compositing of the effect `dof`.
    pub method: bokeh::Method,
    /// The distance of the focal plane.
    pub focus: FocusRule,
    /// Everything within half of this on either side of the focal plane is sharp, in metres, >= 0.
    pub focus_range_m: f32,
    /// The strength of the blur.
    pub strength: Strength,
    /// Largest CoC radius in pixels; `None` is [`MAX_COC_PER_HEIGHT`].
    pub max_coc_px: Option<f32>,
    /// Whether depth is refined.
    pub refine: Refine,
    /// Whether a stream remembers the background that objects hide.
    pub background_memory: BackgroundMemory,
    /// The background behind the subject.
    pub background: Background,
    /// Whether a stream keeps the subject centred.
    pub follow: FramingZoom,
    /// The band of the effect `tilt-shift`.
    pub tilt: Tilt,
    /// The lens opening.
    pub aperture: Aperture,
    /// Width of its soft rim, as a fraction of the radius.
    pub rim: f32,
    /// Number of separable terms; `None` is that of the quality level.
    pub rank: Option<bokeh::Rank>,
    /// Highlight recovery; 0 is off.
    pub highlights: f32,
    /// The quality level; `None` follows the time available.
    pub quality: Option<Quality>,
    /// Whether a stream keeps what hardly changes from earlier frames.
    pub reuse: Reuse,
    /// Whether the blur of what is behind cannot be undone.
    pub privacy: Privacy,
    /// Whether the pictures leave for a call ([`Look::for_source`]).
    pub is_for_call: bool,
    /// Whether depth is relative ([`Look::for_source`]): then the strength is the radius for a difference of inverse depth
    /// from the nearest to the farthest point.
    pub is_depth_relative: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            effect: Effect::Auto,
            method: bokeh::Method::Layered,
            focus: FocusRule::Auto,
            focus_range_m: 0.0,
            strength: Strength::Default,
            max_coc_px: None,
            refine: Refine::Auto,
            background_memory: BackgroundMemory::On,
            background: Background::Blur,
            follow: FramingZoom::OFF,
            tilt: Tilt { center_y: 0.55, band: 0.15, angle_deg: 0.0 },
            aperture: Aperture::default(),
            // With it, rank 3 is as good as rank 7 with a hard disc.
            rim: 0.2,
            rank: None,
            // Off, as it invents light.
            highlights: 0.0,
            quality: None,
            reuse: Reuse::Auto,
            privacy: Privacy::Auto,
            is_for_call: false,
            is_depth_relative: false,
        }
    }
}

impl Look {
    /// Returns the default look with another effect.
    pub fn with_effect(effect: Effect) -> Self {
        Self { effect, ..Self::default() }
    }

    /// Returns the kind of CoC that frames have; `None` if they pass through.
    pub fn coc_kind(&self) -> Option<CocKind> {
        match self.effect {
            Effect::None => None,
            Effect::Blur => Some(CocKind::Uniform),
            Effect::TiltShift => Some(CocKind::Ramp),
            Effect::Auto | Effect::Dof => Some(CocKind::Depth),
        }
    }

    /// Returns the look that reproduces the blur of one frame from its colours and depth. `coc` is the frame's, with
    /// its focus distance; `quality` is its level, if it was blurred.
    pub fn for_frame(&self, coc: &CocField, quality: Option<Quality>) -> Self {
        let focus = match coc {
            CocField::Depth(lens) => FocusRule::Metres(lens.focus_m),
            CocField::Uniform { .. } | CocField::Ramp(_) => self.focus,
        };
        // Not `auto`, which becomes a uniform blur if depth is missing.
        let effect = if self.effect.follows_depth() { Effect::Dof } else { self.effect };
        Self { effect, focus, quality: quality.or(self.quality), ..self.clone() }
    }

    /// Returns the look that reproduces the blur of one frame from its colours and its depth in a file, in which relative
    /// depth is written as metres. Otherwise as [`Look::for_frame`].
    pub fn for_saved_frame(&self, coc: &CocField, quality: Option<Quality>) -> Self {
        let look = Self { privacy: self.privacy_outside_call(), ..self.for_frame(coc, quality) };
        match coc {
            CocField::Depth(coc) if look.is_depth_relative => Self {
                strength: Strength::AtInfinity(coc.coc_at_infinity_px),
                max_coc_px: Some(coc.max_coc_px),
                is_depth_relative: false,
                ..look
            },
            _ => look,
        }
    }

    /// Returns the executor's settings for pictures of `size` pixels; `None` if frames pass through. `adaptive` says
    /// whether the quality may follow the time available.
    pub fn blur_settings(&self, size: (u32, u32), adaptive: bool) -> Option<bokeh::Settings> {
        let coc = self.coc_kind()?;
        let max_px = self.max_coc_px(size);
        let far_max_px = self.coc_at_infinity_px(size).min(max_px);
        let near_max_px = if coc == CocKind::Depth { max_px } else { 0.0 };
        Some(bokeh::Settings {
            coc,
            method: self.method,
            aperture: self.aperture.clone(),
            rim: self.rim,
            rank: self.rank,
            highlights: self.highlights,
            quality: self.quality.unwrap_or_default(),
            adaptive: adaptive && self.quality.is_none(),
            reuse: self.reuse.is_on(adaptive),
            privacy: self.is_private(),
            far_max_px,
            near_max_px,
        })
    }

    /// Returns the rule for the CoC of frames of `size` pixels.
    pub fn coc_rule(&self, size: (u32, u32)) -> CocRule {
        let max_coc_px = self.max_coc_px(size);
        let radius_px = self.coc_at_infinity_px(size).min(max_coc_px);
        match self.coc_kind() {
            None => CocRule::Fixed(CocField::Uniform { radius_px: 0.0 }),
            Some(CocKind::Uniform) => CocRule::Fixed(CocField::Uniform { radius_px }),
            Some(CocKind::Ramp) => CocRule::Fixed(CocField::Ramp(self.tilt.ramp(size, radius_px))),
            Some(CocKind::Depth) => CocRule::Depth {
                focus: self.focus,
                lens: match self.strength {
                    Strength::Lens(lens) => CocAtInfinity::Lens { lens, min_px: self.min_far_px(size) },
                    _ if self.is_depth_relative => CocAtInfinity::Relative(self.coc_at_infinity_px(size)),
                    _ => CocAtInfinity::Px(self.coc_at_infinity_px(size)),
                },
                range_m: self.focus_range_m,
                max_coc_px,
            },
        }
    }

    /// Returns the quality levels for an executor of [`Look::blur_settings`].
    pub fn quality_rule(&self, adaptive: bool) -> QualityRule {
        match self.quality {
            None if adaptive => QualityRule::Auto(Quality::default()),
            quality => QualityRule::Fixed(quality.unwrap_or_default()),
        }
    }

    /// Returns whether depth is refined before the blur; `measured` says whether it was measured.
    pub fn refines_depth(&self, measured: bool) -> bool {
        match self.refine {
            Refine::Auto => measured,
            Refine::On => true,
            Refine::Off => false,
        }
    }

    /// Returns the CoC radius at infinity in pixels; infinite if it depends on a focus that is not known yet.
    fn coc_at_infinity_px(&self, size: (u32, u32)) -> f32 {
        self.asked_at_infinity_px(size).max(self.min_far_px(size))
    }

    fn asked_at_infinity_px(&self, (width, height): (u32, u32)) -> f32 {
        match (self.strength, self.focus) {
            (Strength::Default, _) => height as f32 * COC_AT_INFINITY_PER_HEIGHT,
            (Strength::Percent(percent), _) => height as f32 * percent / 100.0,
            (Strength::AtInfinity(radius_px), _) => radius_px,
            (Strength::Lens(lens), FocusRule::Metres(focus_m)) => lens.coc_at_infinity_px(focus_m, width),
            // The focus is not known yet: callers use the largest CoC as the bound.
            (Strength::Lens(_), _) => f32::INFINITY,
        }
    }

    /// Returns the largest CoC radius in pixels. An explicit strength holds even above the default limit, unless
    /// `--max-coc` is given as well.
    fn max_coc_px(&self, size: (u32, u32)) -> f32 {
        self.asked_max_px(size).max(self.min_far_px(size))
    }

    fn asked_max_px(&self, size: (u32, u32)) -> f32 {
        let by_height_px = size.1 as f32 * MAX_COC_PER_HEIGHT;
        self.max_coc_px.unwrap_or(match self.strength {
            Strength::AtInfinity(_) | Strength::Percent(_) => by_height_px.max(self.asked_at_infinity_px(size)),
            Strength::Default | Strength::Lens(_) => by_height_px,
        })
    }
}
