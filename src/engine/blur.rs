//! The second half of the engine: an executor, and the quality level at which it blurs the next frame.

use std::mem;

use super::quality::QualityPicker;
use crate::bokeh::{BlurredFrame, Bokeh, BokehError, Job, Settings};
use crate::budget::Quality;
use crate::compute::Backend;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{Look, QualityRule};
use crate::optics::CocField;

/// The time that a frame may take.
#[derive(Clone, Copy, Debug)]
pub struct TimeBudget<'a> {
    /// Time for the blur of one frame, in nanoseconds.
    pub budget_ns: u64,
    /// Frame period in nanoseconds if frames come in real time; then there is a deadline as well.
    pub period_ns: Option<u64>,
    /// Relative cost of depth at each effort ([`DepthSource::efforts`](crate::depth::DepthSource::efforts)).
    pub efforts: &'a [f64],
    /// Whether several frames may share one depth map.
    pub shares_depth: bool,
}

impl TimeBudget<'static> {
    /// No limit.
    const UNLIMITED: Self = Self { budget_ns: u64::MAX, period_ns: None, efforts: &[1.0], shares_depth: false };
}

/// The images of one frame: the picture, its depth, and the blurred result.
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// The picture.
    pub color: ColorImage,
    /// Its depth, if any.
    pub depth: Option<DepthMap>,
    /// The blurred picture.
    pub blurred: ColorImage,
}

/// Blurs frame after frame. The default passes them through.
pub struct Blur {
    /// `None` passes frames through.
    executor: Option<Box<dyn Bokeh>>,
    /// The settings that the executor was created for, if [`Blur::set_look`] created it for a look.
    executor_settings: Option<Settings>,
    /// The backends of the executor at the last check; compared by [`Blur::has_changed_backend`].
    backends: Option<&'static str>,
    rule: QualityRule,
    /// Picks the quality of the next frame from the times of earlier ones.
    pub picker: QualityPicker,
}

impl Default for Blur {
    fn default() -> Self {
        Self::new(None, QualityRule::Fixed(Quality::default()), TimeBudget::UNLIMITED)
    }
}

impl Blur {
    /// Creates a blur with an executor that supports all qualities of `rule`.
    pub fn new(executor: Option<Box<dyn Bokeh>>, rule: QualityRule, time: TimeBudget) -> Self {
        let picker = QualityPicker::new((rule, finest_quality(executor.as_deref())), time);
        let backends = executor.as_deref().map(Bokeh::backends);
        Self { executor, executor_settings: None, backends, rule, picker }
    }

    /// Blurs pictures of `size` pixels in this look from the next frame on; with `adaptive`, the quality follows the
    /// available time. Calls `make` for a new executor if the current one does not fit the look's settings.
    ///
    /// # Errors
    /// Returns the error of `make`; the current executor stays in use.
    pub fn set_look<E>(
        &mut self,
        look: &Look,
        (size, adaptive): ((u32, u32), bool),
        make: impl FnOnce(&Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(), E> {
        // Nothing says that these frames come in real time.
        let reuse = look.reuse.is_on(false);
        let executor_settings = look.blur_settings(size, adaptive).map(|settings| Settings { reuse, ..settings });
        if executor_settings != self.executor_settings {
            let executor = executor_settings.as_ref().map(make).transpose()?;
            self.replace_executor(executor, look.quality_rule(adaptive));
            self.executor_settings = executor_settings;
        }
        Ok(())
    }

    /// Replaces the executor. Neither the old nor the new one may have frames in flight.
    pub fn replace_executor(&mut self, executor: Option<Box<dyn Bokeh>>, rule: QualityRule) {
        (self.backends, self.rule) = (executor.as_deref().map(Bokeh::backends), rule);
        self.picker = self.picker.with_rule(rule, finest_quality(executor.as_deref()));
        self.executor = executor;
    }

    /// Describes the executor for the report: its backends ([`Bokeh::backends`]) and one more line
    /// ([`Bokeh::describe`]).
    pub fn describe_executor(&self) -> [String; 2] {
        self.executor.as_ref().map_or_else(
            || ["none".to_owned(), "none".to_owned()],
            |executor| [executor.backends().to_owned(), executor.describe()],
        )
    }

    /// Returns whether the executor has moved to another backend (GPU to CPU) since the last call. The finest quality
    /// and the times differ there, so the picker starts anew.
    pub fn has_changed_backend(&mut self) -> bool {
        let backends = self.executor.as_deref().map(Bokeh::backends);
        let has_changed_backend = mem::replace(&mut self.backends, backends) != backends;
        if has_changed_backend {
            self.picker = self.picker.with_rule(self.rule, finest_quality(self.executor.as_deref()));
        }
        has_changed_backend
    }

    /// Returns the executor; `None` passes frames through.
    pub fn executor(&self) -> Option<&dyn Bokeh> {
        self.executor.as_deref()
    }

    /// Returns the quality of the next frame; `None` if nothing is blurred.
    pub fn quality(&self) -> Option<Quality> {
        self.executor.as_ref().map(|_| self.picker.quality())
    }

    /// Returns how many frames may be in flight at once, at least one.
    pub fn capacity(&self) -> usize {
        self.executor.as_ref().map_or(1, |executor| executor.capacity().max(1))
    }

    /// [`Bokeh::submit`].
    pub fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        self.executor.as_mut().ok_or(BokehError::Lost)?.submit(job)
    }

    /// [`Bokeh::collect`].
    pub fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        self.executor.as_mut().map_or(Ok(None), |executor| executor.collect(wait))
    }

    /// Blurs a frame on the caller's thread; no other frame may be in flight.
    ///
    /// # Errors
    /// Fails if the executor failed; the images are lost then.
    pub fn blur(&mut self, images: &mut Images, coc: CocField) -> Result<(), BokehError> {
        if self.executor.is_none() {
            images.blurred.clone_from(&images.color);
            return Ok(());
        }
        let uses_depth = matches!(coc, CocField::Depth(_));
        let depth = images.depth.take_if(|_| uses_depth).map(Pooled::detached);
        let job = Job::new(Pooled::detached(mem::take(&mut images.color)), depth, coc);
        let out = Pooled::detached(mem::take(&mut images.blurred));
        self.submit(Job { quality: self.picker.quality(), out, ..job })?;
        let BlurredFrame { mut picture, mut color, depth, .. } = self.collect(true)?.ok_or(BokehError::Lost)?;
        images.color = mem::take(&mut *color);
        images.blurred = mem::take(picture.memory_mut().ok_or(BokehError::Lost)?);
        images.depth = depth.map(|mut depth| mem::take(&mut *depth)).or(images.depth.take());
        Ok(())
    }
}

/// Returns the finest quality that an adaptive blur uses on this executor.
fn finest_quality(executor: Option<&dyn Bokeh>) -> Quality {
    // On the CPU a finer level takes twice the time for half a decibel, and other programs need the CPU as well.
    match executor.map(Bokeh::backend) {
        Some(Backend::Cpu) => Quality::Balanced,
        _ => Quality::Best,
    }
}
