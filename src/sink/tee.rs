//! Several sinks as one.

use std::ops::ControlFlow;
use std::time::Duration;

use super::{Sink, SinkError};
use crate::frame::ColorImage;

/// Gives every frame to each of its sinks, in turn. One whose reader has gone is completed and left out from then on;
/// when all are, so has this one's.
pub struct Tee {
    sinks: Vec<Box<dyn Sink>>,
    name: String,
}

impl Tee {
    /// One sink of several.
    pub fn new(sinks: Vec<Box<dyn Sink>>) -> Self {
        let names: Vec<String> = sinks.iter().map(|sink| sink.describe()).collect();
        Self { sinks, name: names.join(", ") }
    }

    /// `Continue` says whether any of them showed something.
    fn each(
        &mut self,
        mut give: impl FnMut(&mut dyn Sink) -> Result<ControlFlow<(), bool>, SinkError>,
    ) -> Result<ControlFlow<(), bool>, SinkError> {
        let (mut at, mut any) = (0, false);
        while at < self.sinks.len() {
            match give(&mut *self.sinks[at])? {
                ControlFlow::Continue(shown) => {
                    any |= shown;
                    at += 1;
                }
                ControlFlow::Break(()) => self.sinks.remove(at).finish()?,
            }
        }
        Ok(if self.sinks.is_empty() { ControlFlow::Break(()) } else { ControlFlow::Continue(any) })
    }
}

impl Sink for Tee {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        let flow = self.each(|sink| Ok(sink.put(frame)?.map_continue(|()| true)))?;
        Ok(flow.map_continue(|_| ()))
    }

    fn hold(&self) -> Option<Duration> {
        self.sinks.iter().filter_map(|sink| sink.hold()).min()
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.each(|sink| sink.repeat())
    }

    /// Completes them all, also after one could not be: the first error is told.
    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        let ended: Vec<_> = self.sinks.into_iter().map(|sink| sink.finish()).collect();
        ended.into_iter().collect()
    }

    fn describe(&self) -> String {
        self.name.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::{Arc, Mutex};

    use super::*;

    /// Writes down what is asked of it.
    struct Witness {
        name: &'static str,
        log: Arc<Mutex<Vec<String>>>,
        hold_ms: Option<u64>,
        /// Frames until its reader goes.
        wants: usize,
        breaks_down: bool,
    }

    impl Witness {
        fn note(&self, what: &str) {
            self.log.lock().unwrap().push(format!("{} {what}", self.name));
        }

        fn end(&self) -> Result<(), SinkError> {
            if self.breaks_down { Err(SinkError::write(self.name.as_ref())(io::Error::other("full"))) } else { Ok(()) }
        }
    }

    impl Sink for Witness {
        fn put(&mut self, _: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
            self.note("put");
            self.wants -= 1;
            Ok(if self.wants == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        }

        fn hold(&self) -> Option<Duration> {
            self.hold_ms.map(Duration::from_millis)
        }

        fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
            self.note("repeat");
            Ok(ControlFlow::Continue(self.hold_ms.is_some()))
        }

        fn finish(self: Box<Self>) -> Result<(), SinkError> {
            self.note("finish");
            self.end()
        }

        fn describe(&self) -> String {
            self.name.into()
        }
    }

    fn tee(log: &Arc<Mutex<Vec<String>>>, sinks: [(&'static str, Option<u64>, usize, bool); 2]) -> Box<Tee> {
        let sinks = sinks.map(|(name, hold_ms, wants, breaks_down)| {
            Box::new(Witness { name, log: Arc::clone(log), hold_ms, wants, breaks_down }) as Box<dyn Sink>
        });
        Box::new(Tee::new(sinks.into()))
    }

    #[test]
    fn a_sink_whose_reader_goes_is_left_out_and_the_last_ends_it() {
        let log = Arc::default();
        let mut tee = tee(&log, [("a", None, 1, false), ("b", Some(50), 2, false)]);
        assert_eq!((tee.describe().as_str(), tee.hold()), ("a, b", Some(Duration::from_millis(50))));
        let frame = ColorImage::new(2, 2);
        assert!(tee.put(&frame).unwrap().is_continue());
        assert_eq!(tee.repeat().unwrap(), ControlFlow::Continue(true));
        assert!(tee.put(&frame).unwrap().is_break());
        assert_eq!(tee.hold(), None);
        tee.finish().unwrap();
        assert_eq!(*log.lock().unwrap(), ["a put", "a finish", "b put", "b repeat", "b put", "b finish"]);
    }

    #[test]
    fn all_are_completed_and_the_first_error_is_told() {
        let log = Arc::default();
        let broken = tee(&log, [("a", Some(200), 9, true), ("b", Some(100), 9, true)]);
        assert_eq!(broken.hold(), Some(Duration::from_millis(100)));
        assert_eq!(broken.finish().unwrap_err().to_string(), "cannot write a: full");
        assert_eq!(*log.lock().unwrap(), ["a finish", "b finish"]);
    }
}
