//! What may change while a run goes on: how the frames are blurred.

use std::sync::Mutex;

use crate::bokeh::Bokeh;
use crate::look::{Look, QualityRule};

/// Another blur, from the next frame on. Every frame has the CoC and the executor of one and the same change.
pub struct Change {
    /// What its frames are known by ([`super::Trace::change`]); those before any change have 0.
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
    /// kernels of another ([`super::Trace::between`]).
    Meanwhile,
    /// This one; `None` passes frames through.
    To(Option<Box<dyn Bokeh>>),
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
