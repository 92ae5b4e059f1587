//! Changes of the blur while a run goes on.

use std::sync::{Mutex, mpsc};

use bokehcam::bokeh::{self, Bokeh};
use bokehcam::look::{Look, QualityRule};

/// A change of the blur from the next frame on. CoC and executor of a frame always belong to the same change.
pub struct Change {
    /// Identifies its frames ([`super::View::change`]); frames before any change have 0.
    pub number: u64,
    /// How frames are blurred.
    pub look: Look,
    /// The executor from here on.
    pub bokeh: ExecutorChange,
}

/// The executor from a change on.
pub enum ExecutorChange {
    /// The current one stays.
    Keep,
    /// The current one stays until the look's own comes with the next change: until then frames have the CoC of one
    /// look and the kernels of another ([`super::View::is_transitional`]).
    KeepUntilReady,
    /// This one; `None` passes frames through.
    Replace(Option<Box<dyn Bokeh>>),
}

/// Creates the changes of a run from looks.
pub struct ChangeSender {
    to: mpsc::Sender<Change>,
    /// Width and height of the pictures, in pixels.
    size: (u32, u32),
    adaptive: bool,
    /// The current look.
    look: Look,
    /// The settings of the current executor; `None` if nothing is blurred.
    executor_settings: Option<bokeh::Settings>,
}

impl ChangeSender {
    /// Creates the sender of a run's changes and the receiver for the run. The run begins with `look`, for pictures of
    /// `size` pixels; `adaptive` must equal that of the run.
    pub fn new(look: Look, size: (u32, u32), adaptive: bool) -> (Self, mpsc::Receiver<Change>) {
        let (to, changes) = mpsc::channel();
        let executor_settings = look.blur_settings(size, adaptive);
        (Self { to, size, adaptive, look, executor_settings }, changes)
    }

    /// Switches to another look. Its frames carry `number`, which must be one more than that of the look before. Calls
    /// `make` for a new executor if the current one does not fit.
    ///
    /// # Errors
    /// Returns the error of `make`; the current look stays in use.
    pub fn switch_look<E>(
        &mut self,
        look: Look,
        number: u64,
        make: impl FnOnce(&bokeh::Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(), E> {
        let executor_settings = look.blur_settings(self.size, self.adaptive);
        let kind = |settings: &Option<bokeh::Settings>| settings.as_ref().map(|settings| settings.coc);
        let is_same_kind = kind(&self.executor_settings) == kind(&executor_settings);
        if executor_settings == self.executor_settings {
            self.send_change(number, &look, ExecutorChange::Keep);
        } else {
            if is_same_kind {
                // The same kind of CoC takes effect at once: the current executor does what it can until the new one
                // is ready, and such frames keep the previous number.
                self.send_change(number - 1, &look, ExecutorChange::KeepUntilReady);
            }
            match executor_settings.as_ref().map(make).transpose() {
                Ok(bokeh) => self.send_change(number, &look, ExecutorChange::Replace(bokeh)),
                Err(error) => {
                    if is_same_kind {
                        self.send_change(number - 1, &self.look, ExecutorChange::Keep);
                    }
                    return Err(error);
                }
            }
        }
        (self.look, self.executor_settings) = (look, executor_settings);
        Ok(())
    }

    fn send_change(&self, number: u64, look: &Look, bokeh: ExecutorChange) {
        // Fails only if the run has ended, which needs no handling.
        let _ = self.to.send(Change { number, look: look.clone(), bokeh });
    }
}

/// An executor on its way to the blur stage. Each frame of the change carries it, as any frame may be dropped.
pub(super) struct ExecutorSwap {
    pub number: u64,
    /// Locked once at creation and once when it is taken.
    executor: Mutex<Option<NewExecutor>>,
}

type NewExecutor = (Option<Box<dyn Bokeh>>, QualityRule);

impl ExecutorSwap {
    pub(super) fn new(number: u64, executor: Option<Box<dyn Bokeh>>, quality: QualityRule) -> Self {
        Self { number, executor: Mutex::new(Some((executor, quality))) }
    }

    /// Takes the executor; only the first caller gets it.
    pub(super) fn take(&self) -> Option<NewExecutor> {
        self.executor.lock().ok()?.take()
    }
}
