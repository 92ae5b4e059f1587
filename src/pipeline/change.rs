//! Changes of the blur while a run goes on.

use std::sync::{Mutex, mpsc};

use crate::bokeh::{self, Bokeh};
use crate::look::{Look, QualityRule};

/// A change of the blur from the next frame on. CoC and executor of a frame always belong to the same change.
pub struct Change {
    /// Identifies its frames ([`super::View::change`]); frames before any change have 0.
    pub number: u64,
    /// How frames are blurred.
    pub look: Look,
    /// The executor from here on.
    pub bokeh: Executor,
}

/// The executor from a change on.
pub enum Executor {
    /// The current one stays.
    Keep,
    /// The current one stays until the look's own comes with the next change: until then frames have the CoC of one
    /// look and the kernels of another ([`super::View::is_between`]).
    Meanwhile,
    /// This one; `None` passes frames through.
    To(Option<Box<dyn Bokeh>>),
}

/// Creates the changes of a run from looks.
pub struct Changes {
    to: mpsc::Sender<Change>,
    /// Width and height of the pictures, in pixels.
    size: (u32, u32),
    adaptive: bool,
    /// The current look.
    look: Look,
    /// The settings of the current executor; `None` if nothing is blurred.
    made_for: Option<bokeh::Settings>,
}

impl Changes {
    /// Creates the sender of a run's changes and the receiver for the run. The run begins with `look`, for pictures of
    /// `size` pixels; `adaptive` must equal that of the run.
    pub fn new(look: Look, size: (u32, u32), adaptive: bool) -> (Self, mpsc::Receiver<Change>) {
        let (to, changes) = mpsc::channel();
        let made_for = look.settings(size, adaptive);
        (Self { to, size, adaptive, look, made_for }, changes)
    }

    /// Switches to another look. Its frames carry `number`, which must be one more than that of the look before. Calls
    /// `make` for a new executor if the current one does not fit.
    ///
    /// # Errors
    /// Returns the error of `make`; the current look stays in use.
    pub fn adopt<E>(
        &mut self,
        look: Look,
        number: u64,
        make: impl FnOnce(&bokeh::Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(), E> {
        let made_for = look.settings(self.size, self.adaptive);
        let kind = |settings: &Option<bokeh::Settings>| settings.as_ref().map(|settings| settings.coc);
        let is_same_kind = kind(&self.made_for) == kind(&made_for);
        if made_for == self.made_for {
            self.send(number, &look, Executor::Keep);
        } else {
            if is_same_kind {
                // The same kind of CoC takes effect at once: the current executor does what it can until the new one
                // is ready, and such frames keep the previous number.
                self.send(number - 1, &look, Executor::Meanwhile);
            }
            match made_for.as_ref().map(make).transpose() {
                Ok(bokeh) => self.send(number, &look, Executor::To(bokeh)),
                Err(error) => {
                    if is_same_kind {
                        self.send(number - 1, &self.look, Executor::Keep);
                    }
                    return Err(error);
                }
            }
        }
        (self.look, self.made_for) = (look, made_for);
        Ok(())
    }

    fn send(&self, number: u64, look: &Look, bokeh: Executor) {
        // Fails only if the run has ended, which needs no handling.
        let _ = self.to.send(Change { number, look: look.clone(), bokeh });
    }
}

/// An executor on its way to the blur stage. Each frame of the change carries it, as any frame may be dropped.
pub(super) struct Swap {
    pub number: u64,
    /// Locked once at creation and once when it is taken.
    executor: Mutex<Option<New>>,
}

type New = (Option<Box<dyn Bokeh>>, QualityRule);

impl Swap {
    pub(super) fn new(number: u64, executor: Option<Box<dyn Bokeh>>, quality: QualityRule) -> Self {
        Self { number, executor: Mutex::new(Some((executor, quality))) }
    }

    /// Takes the executor; only the first caller gets it.
    pub(super) fn take(&self) -> Option<New> {
        self.executor.lock().ok()?.take()
    }
}
