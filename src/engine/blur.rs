//! The second half: an executor, and how finely it is to blur the next frame.

use std::mem;

use super::quality::Picker;
use crate::bokeh::{Bokeh, BokehError, Finished, Job, Settings};
use crate::budget::Quality;
use crate::compute::Backend;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{Look, QualityRule};
use crate::optics::CocField;

/// How much time there is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Time<'a> {
    /// For the blur of a frame, in nanoseconds.
    pub budget_ns: u64,
    /// From frame to frame, where they come in real time: then there is a deadline, too.
    pub period_ns: Option<u64>,
    /// What depth costs at each effort ([`DepthSource::efforts`](crate::depth::DepthSource::efforts)).
    pub efforts: &'a [f64],
    /// Whether frames may share depth.
    pub shares_depth: bool,
}

impl Time<'static> {
    /// All that it takes.
    pub const ENOUGH: Self = Self { budget_ns: u64::MAX, period_ns: None, efforts: &[1.0], shares_depth: false };
}

/// A frame in memory: a picture, its depth, and what becomes of it.
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// The picture.
    pub color: ColorImage,
    /// Its depth, where it has some.
    pub depth: Option<DepthMap>,
    /// The picture, blurred.
    pub blurred: ColorImage,
}

/// Blurs frame after frame. The default passes them through.
pub struct Blur {
    /// `None` passes frames through.
    executor: Option<Box<dyn Bokeh>>,
    /// The settings that it was made for, where it was [made](Blur::follow) for a look.
    made_for: Option<Settings>,
    /// What the executor has run on, when that was looked at last.
    backends: Option<&'static str>,
    rule: QualityRule,
    /// Picks the quality of the next frame, by the time that those before took.
    pub(crate) picker: Picker,
}

impl Default for Blur {
    fn default() -> Self {
        Self::new(None, QualityRule::Fixed(Quality::default()), Time::ENOUGH)
    }
}

impl Blur {
    /// By an executor that was made for the qualities of this rule.
    pub(crate) fn new(executor: Option<Box<dyn Bokeh>>, rule: QualityRule, time: Time) -> Self {
        let picker = Picker::new((rule, finest_quality(executor.as_deref())), time);
        let backends = executor.as_deref().map(Bokeh::backends);
        Self { executor, made_for: None, backends, rule, picker }
    }

    /// Blurs pictures of `size` pixels as a look says from now on; the quality may follow the time there is where this is
    /// `adaptive`. `make` makes an executor, where the one before cannot do it.
    ///
    /// # Errors
    /// That of `make`: the one before goes on.
    pub fn follow<E>(
        &mut self,
        look: &Look,
        (size, adaptive): ((u32, u32), bool),
        make: impl FnOnce(&Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(), E> {
        let made_for = look.settings(size, adaptive);
        if made_for != self.made_for {
            let executor = made_for.as_ref().map(make).transpose()?;
            self.replace(executor, look.quality_rule(adaptive));
            self.made_for = made_for;
        }
        Ok(())
    }

    /// By another executor from now on, which has nothing in hand; nor has the one before.
    pub(crate) fn replace(&mut self, executor: Option<Box<dyn Bokeh>>, rule: QualityRule) {
        (self.backends, self.rule) = (executor.as_deref().map(Bokeh::backends), rule);
        self.picker = self.picker.with(rule, finest_quality(executor.as_deref()));
        self.executor = executor;
    }

    /// What blurs, for the report: on what it runs ([`Bokeh::backends`]), and one line more ([`Bokeh::describe`]).
    pub(crate) fn about(&self) -> [String; 2] {
        self.executor.as_ref().map_or_else(
            || ["none".to_owned(), "none".to_owned()],
            |executor| [executor.backends().to_owned(), executor.describe()],
        )
    }

    /// Whether the executor has moved to another backend (GPU to processor) since this was asked last: finest quality and times
    /// are others there.
    pub(crate) fn has_moved(&mut self) -> bool {
        let backends = self.executor.as_deref().map(Bokeh::backends);
        let has_moved = mem::replace(&mut self.backends, backends) != backends;
        if has_moved {
            self.picker = self.picker.with(self.rule, finest_quality(self.executor.as_deref()));
        }
        has_moved
    }

    /// What blurs; `None` passes frames through.
    pub fn executor(&self) -> Option<&dyn Bokeh> {
        self.executor.as_deref()
    }

    /// The quality of the next frame; `None` where nothing is blurred.
    pub fn quality(&self) -> Option<Quality> {
        self.executor.as_ref().map(|_| self.picker.quality())
    }

    /// Frames that may be in hand at once, one at least.
    pub(crate) fn capacity(&self) -> usize {
        self.executor.as_ref().map_or(1, |executor| executor.capacity().max(1))
    }

    /// [`Bokeh::submit`].
    pub(crate) fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        self.executor.as_mut().ok_or(BokehError::Lost)?.submit(job)
    }

    /// [`Bokeh::collect`].
    pub(crate) fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        self.executor.as_mut().map_or(Ok(None), |executor| executor.collect(wait))
    }

    /// Blurs a frame on the caller's thread, with nothing else in hand.
    ///
    /// # Errors
    /// The executor failed: the images are lost.
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
        let Finished { mut picture, mut color, depth, .. } = self.collect(true)?.ok_or(BokehError::Lost)?;
        images.color = mem::take(&mut *color);
        images.blurred = mem::take(picture.memory_mut().ok_or(BokehError::Lost)?);
        images.depth = depth.map(|mut depth| mem::take(&mut *depth)).or(images.depth.take());
        Ok(())
    }
}

/// The finest level that an executor is given as the time allows.
fn finest_quality(executor: Option<&dyn Bokeh>) -> Quality {
    // On the processor a finer level takes twice the time for half a decibel, and other programs need it, too.
    match executor.map(Bokeh::backend) {
        Some(Backend::Cpu) => Quality::Balanced,
        _ => Quality::Best,
    }
}
