//! What may change while a run goes on: how the frames are blurred.

use std::sync::{Mutex, mpsc};

use crate::bokeh::{self, Bokeh};
use crate::look::{Look, QualityRule};

/// Another blur, from the next frame on. Every frame has the CoC and the executor of one and the same change.
pub struct Change {
    /// What its frames are known by ([`super::View::change`]); those before any change have 0.
    pub number: u64,
    /// How frames are blurred.
    pub look: Look,
    /// What blurs them.
    pub bokeh: Executor,
}

/// What blurs from a change on.
pub enum Executor {
    /// What did before.
    Keep,
    /// What did before, until that of the look comes with the next change: such frames have the CoC of one look and the
    /// kernels of another ([`super::View::is_between`]).
    Meanwhile,
    /// This one; `None` passes frames through.
    To(Option<Box<dyn Bokeh>>),
}

/// Makes the changes of a run from looks alone.
pub struct Changes {
    to: mpsc::Sender<Change>,
    /// Columns and rows of the pictures.
    size: (u32, u32),
    adaptive: bool,
    /// The look that holds.
    look: Look,
    /// The settings that the executor was made for; `None` if nothing is blurred.
    made_for: Option<bokeh::Settings>,
}

impl Changes {
    /// The changes of a run that begins with `look`, for pictures of `size` pixels, and what the run takes them from.
    /// `adaptive` as for the run.
    pub fn new(look: Look, size: (u32, u32), adaptive: bool) -> (Self, mpsc::Receiver<Change>) {
        let (to, changes) = mpsc::channel();
        let made_for = look.settings(size, adaptive);
        (Self { to, size, adaptive, look, made_for }, changes)
    }

    /// Blurs with this look from now on; its frames carry this number, which is one more than that of the look before.
    /// `make` makes an executor, where that of before cannot do it.
    ///
    /// # Errors
    /// That of `make`: the look before goes on.
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
                // The same kind of CoC takes effect at once: the present executor does what it can until the new one is
                // made, and such frames keep the number before.
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
        // Fails only if the run has ended; then nothing is to be done.
        let _ = self.to.send(Change { number, look: look.clone(), bokeh });
    }
}

/// An executor on its way to the blur stage. Each frame of the change brings it, so that it comes whichever frame does.
pub(super) struct Swap {
    pub number: u64,
    /// Locked once when it is made and once when it is taken.
    executor: Mutex<Option<New>>,
}

type New = (Option<Box<dyn Bokeh>>, QualityRule);

impl Swap {
    pub(super) fn new(number: u64, executor: Option<Box<dyn Bokeh>>, quality: QualityRule) -> Self {
        Self { number, executor: Mutex::new(Some((executor, quality))) }
    }

    /// The executor, for who comes first.
    pub(super) fn take(&self) -> Option<New> {
        self.executor.lock().ok()?.take()
    }
}
