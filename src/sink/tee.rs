//! Several sinks as one.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use super::{Ending, Sink, SinkError};
use crate::frame::{ColorImage, YuyvImage};
use crate::stats::NodeUse;

/// Gives every frame to each of its sinks, in turn. One whose reader has gone is completed and removed; once all are,
/// [`Sink::put`] says `Break`. One that fails is removed, too, which is logged, and its error is returned at the end;
/// the error of a live one is returned at once, which ends the run.
pub struct Tee {
    sinks: Vec<Named>,
    name: String,
    /// The error of the first one that failed.
    failed: Option<SinkError>,
}

/// A sink, and what it calls itself.
type Named = (String, Box<dyn Sink>);

type Flow = Result<ControlFlow<(), bool>, SinkError>;

impl Tee {
    /// One sink of several.
    pub fn new(sinks: Vec<Box<dyn Sink>>) -> Self {
        let names: Vec<String> = sinks.iter().map(|sink| sink.describe()).collect();
        let name = names.join(", ");
        Self { sinks: names.into_iter().zip(sinks).collect(), name, failed: None }
    }

    /// Calls `give` for each sink, and removes those that fail or whose reader has gone. `Continue` says whether any of
    /// them showed something.
    fn each(&mut self, mut give: impl FnMut(&mut dyn Sink) -> Flow) -> Flow {
        let (mut at, mut any) = (0, false);
        while at < self.sinks.len() {
            let (name, sink) = &mut self.sinks[at];
            let is_live = sink.hold().is_some();
            match guarded(name, || give(&mut **sink)) {
                Ok(ControlFlow::Continue(shown)) => {
                    any |= shown;
                    at += 1;
                }
                Ok(ControlFlow::Break(())) => {
                    if let Err(error) = end(self.sinks.remove(at), Ending::Whole) {
                        self.note_failure(error);
                    }
                }
                Err(error) => {
                    // Not finished: a sink that fails has kept its output itself.
                    drop(self.sinks.remove(at));
                    if is_live {
                        return Err(error);
                    }
                    self.note_failure(error);
                }
            }
        }
        match self.failed.take_if(|_| self.sinks.is_empty()) {
            Some(error) => Err(error),
            None if self.sinks.is_empty() => Ok(ControlFlow::Break(())),
            None => Ok(ControlFlow::Continue(any)),
        }
    }

    /// Logs an error while other sinks go on, and keeps the first one for the end.
    fn note_failure(&mut self, error: SinkError) {
        if !self.sinks.is_empty() {
            tracing::error!("{error}; going on without it");
        }
        self.failed.get_or_insert(error);
    }
}

fn end((name, sink): Named, ending: Ending) -> Result<(), SinkError> {
    guarded(&name, || sink.finish(ending))
}

/// Makes an error of a panic, so that the other sinks can go on.
fn guarded<T>(name: &str, call: impl FnOnce() -> Result<T, SinkError>) -> Result<T, SinkError> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
        Err(SinkError::Panic { sink: name.into(), what: text.unwrap_or("no reason given").into() })
    })
}

impl Sink for Tee {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let flow = self.each(|sink| Ok(sink.put(frame, time_ns)?.map_continue(|()| true)))?;
        Ok(flow.map_continue(|_| ()))
    }

    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let flow = self.each(|sink| Ok(sink.cover(card, time_ns)?.map_continue(|()| true)))?;
        Ok(flow.map_continue(|_| ()))
    }

    /// Whoever is given YUYV may keep its memory, so there can be only one.
    fn wants_yuyv(&mut self) -> bool {
        let [(_, only)] = &mut self.sinks[..] else { return false };
        only.wants_yuyv()
    }

    fn put_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let flow = self.each(|sink| Ok(sink.put_yuyv(frame, time_ns)?.map_continue(|()| true)))?;
        Ok(flow.map_continue(|_| ()))
    }

    fn captured(&mut self, captured_ns: u64) {
        self.sinks.iter_mut().for_each(|(_, sink)| sink.captured(captured_ns));
    }

    fn nodes(&self) -> Vec<NodeUse> {
        self.sinks.iter().flat_map(|(_, sink)| sink.nodes()).collect()
    }

    fn hold(&self) -> Option<Duration> {
        self.sinks.iter().filter_map(|(_, sink)| sink.hold()).min()
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.each(|sink| sink.repeat())
    }

    /// Completes them all, also after one could not be: the first error of all is told.
    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let Self { sinks, failed, .. } = *self;
        let ended: Vec<_> = sinks.into_iter().map(|sink| end(sink, ending)).collect();
        failed.map(Err).into_iter().chain(ended).collect()
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
        fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
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

        fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
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
        assert!(tee.put(&frame, 0).unwrap().is_continue());
        assert_eq!(tee.repeat().unwrap(), ControlFlow::Continue(true));
        assert!(tee.put(&frame, 0).unwrap().is_break());
        assert_eq!(tee.hold(), None);
        tee.finish(Ending::Whole).unwrap();
        assert_eq!(*log.lock().unwrap(), ["a put", "a finish", "b put", "b repeat", "b put", "b finish"]);
    }

    /// Wants YUYV, and nothing else.
    struct Camera;

    impl Sink for Camera {
        fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
            panic!("it wanted YUYV")
        }
        fn wants_yuyv(&mut self) -> bool {
            true
        }
        fn put_yuyv(&mut self, frame: &mut YuyvImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
            frame.bytes.clear();
            Ok(ControlFlow::Continue(()))
        }
    }

    #[test]
    fn only_one_alone_is_given_yuyv() {
        let mut frame = YuyvImage::default();
        frame.resize(2, 2);
        let mut alone = Tee::new(vec![Box::new(Camera)]);
        assert!(alone.wants_yuyv() && alone.put_yuyv(&mut frame, 0).unwrap().is_continue());
        assert!(frame.bytes.is_empty());
        assert!(!Tee::new(vec![Box::new(Camera), Box::new(Camera)]).wants_yuyv());
        assert!(!Tee::new(vec![Box::new(Broken(None))]).wants_yuyv(), "nobody does who does not say so");
        assert!(matches!(Broken(None).put_yuyv(&mut frame, 0), Err(SinkError::Yuyv)));
    }

    #[test]
    fn all_are_completed_and_the_first_error_is_told() {
        let log = Arc::default();
        let broken = tee(&log, [("a", Some(200), 9, true), ("b", Some(100), 9, true)]);
        assert_eq!(broken.hold(), Some(Duration::from_millis(100)));
        assert_eq!(broken.finish(Ending::Whole).unwrap_err().to_string(), "cannot write a: full");
        assert_eq!(*log.lock().unwrap(), ["a finish", "b finish"]);
    }

    /// Fails at once; live, if it is one.
    struct Broken(Option<Duration>);

    impl Sink for Broken {
        fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
            Err(SinkError::write("broken".as_ref())(io::Error::other("gone")))
        }
        fn hold(&self) -> Option<Duration> {
            self.0
        }
        fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
            panic!("it has failed")
        }
        fn describe(&self) -> String {
            "broken".into()
        }
    }

    #[test]
    fn one_that_fails_is_left_out_unless_it_is_live_and_is_an_error_in_the_end() {
        for (hold, ends) in [(None, false), (Some(Duration::from_millis(50)), true)] {
            let log: Arc<Mutex<Vec<String>>> = Arc::default();
            let good = Witness { name: "a", log: Arc::clone(&log), hold_ms: None, wants: 9, breaks_down: false };
            let mut tee = Box::new(Tee::new(vec![Box::new(Broken(hold)), Box::new(good)]));
            let frame = ColorImage::new(2, 2);
            assert_eq!(tee.put(&frame, 0).is_err(), ends);
            assert_eq!(tee.finish(Ending::Cut).is_err(), !ends, "what ended the run was told");
            let expected: &[&str] = if ends { &["a finish"] } else { &["a put", "a finish"] };
            assert_eq!(*log.lock().unwrap(), expected);
        }
    }
}
