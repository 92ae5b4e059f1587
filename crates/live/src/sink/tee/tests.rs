use std::io;
use std::sync::atomic::AtomicUsize;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Instant;

use super::*;
use crate::sink::Shutter;
use crate::sink::shutter::CardNotShown;
use bokehcam::clock::Clock;
use bokehcam::link::demand::Demand;

/// No step takes this long: detects a hang.
const HANG: Duration = Duration::from_secs(120);

#[track_caller]
fn until(what: &str, mut is: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(began.elapsed() < HANG, "never: {what}");
        thread::sleep(Duration::from_millis(1));
    }
}

/// Reports what it gets: the first byte of each picture, and its end.
struct Fake {
    name: &'static str,
    tells: Sender<String>,
    /// Each picture waits for a signal, if this is set.
    may_take: Option<Receiver<()>>,
    is_live: bool,
    /// Number of pictures until its reader goes, or it fails.
    leaves_at: usize,
    fails_at: usize,
    finish_fails: bool,
    taken: usize,
    /// Counts the pictures that it got, including those that still wait.
    given: Arc<AtomicUsize>,
}

fn fake(name: &'static str) -> (Fake, Receiver<String>) {
    let (tells, told) = mpsc::channel();
    let never = usize::MAX;
    let fake = Fake {
        name,
        tells,
        may_take: None,
        is_live: false,
        leaves_at: never,
        fails_at: never,
        finish_fails: false,
        taken: 0,
        given: Arc::default(),
    };
    (fake, told)
}

impl Fake {
    fn wait(&self) {
        self.given.fetch_add(1, Ordering::Relaxed);
        if let Some(may_take) = &self.may_take {
            // After the sender is dropped, it accepts all pictures.
            let _ = may_take.recv_timeout(HANG);
        }
    }

    fn full(&self) -> SinkError {
        SinkError::write(self.name.as_ref())(io::Error::other("full"))
    }
}

impl Sink for Fake {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        self.wait();
        if self.taken == self.fails_at {
            return Err(self.full());
        }
        if self.taken == self.leaves_at {
            return Ok(ControlFlow::Break(()));
        }
        self.taken += 1;
        let _ = self.tells.send(frame.rgb[0].to_string());
        Ok(ControlFlow::Continue(()))
    }

    fn write_card(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        self.wait();
        let _ = self.tells.send("card".into());
        Ok(ControlFlow::Continue(()))
    }

    fn is_live(&self) -> bool {
        self.is_live
    }

    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let _ = self.tells.send(format!("{ending:?}"));
        if self.finish_fails { Err(self.full()) } else { Ok(()) }
    }

    fn describe(&self) -> String {
        self.name.into()
    }
}

fn tee(sinks: impl IntoIterator<Item = Fake>, backpressure: Backpressure, closed: &Arc<AtomicBool>) -> Box<Tee> {
    let sinks = sinks.into_iter().map(|sink| Box::new(sink) as Box<dyn Sink>).collect();
    Box::new(Tee::new(sinks, backpressure, Arc::clone(closed)).unwrap())
}

fn picture(number: u8) -> ColorImage {
    let mut picture = ColorImage::new(2, 2);
    picture.rgb.fill(number);
    picture
}

fn next(told: &Receiver<String>) -> String {
    told.recv_timeout(HANG).unwrap()
}

/// Returns the counts of an output, by its name.
fn used(frames: &[Counter<OutputCounts>], name: &str) -> OutputCounts {
    frames.iter().map(|count| count()).find(|output| output.output == name).unwrap()
}

/// A camera and a file run in real time beside a stalled output, and each counts its own losses.
#[test]
fn in_real_time_none_waits_for_another_and_each_counts_what_it_lost() {
    let (camera, shown) = fake("camera");
    let (file, written) = fake("file");
    let (mut stalled, taken) = fake("stalled");
    let (may, may_take) = mpsc::channel();
    stalled.may_take = Some(may_take);
    let given = Arc::clone(&stalled.given);
    let sinks = [stalled, Fake { is_live: true, ..camera }, file];
    let mut tee = tee(sinks, Backpressure::DropOldest, &Arc::default());
    assert_eq!((tee.describe().as_str(), tee.is_live()), ("stalled, camera, file", true));
    let frames = tee.output_counters();
    for number in 0..50 {
        assert!(tee.write_frame(&picture(number), number.into()).unwrap().is_continue());
        assert_eq!((next(&shown), next(&written)), (number.to_string(), number.to_string()));
        until("it was given the first", || given.load(Ordering::Relaxed) == 1);
    }
    assert!(taken.try_recv().is_err(), "it has taken none yet");
    // Two of them: the one that it had and the newest; all others were dropped.
    drop(may);
    tee.finish(Ending::Complete).unwrap();
    assert_eq!((next(&taken), next(&taken), next(&taken)), ("0".into(), "49".into(), "Complete".into()));
    let expected = |output: &str, frames, lost| OutputCounts { output: output.into(), frames, repeats: 0, lost };
    assert_eq!(used(&frames, "stalled"), expected("stalled", 2, 48));
    assert_eq!(used(&frames, "camera"), expected("camera", 50, 0));
}

#[test]
fn files_that_are_to_miss_nothing_get_all_and_what_is_live_waits_for_none_of_them() {
    let (mut camera, shown) = fake("camera");
    camera.is_live = true;
    let (mut slow, written) = fake("slow");
    let (may, may_take) = mpsc::channel();
    slow.may_take = Some(may_take);
    let mut tee = tee([slow, camera], Backpressure::Block, &Arc::default());
    let frames = tee.output_counters();
    // One is being written, one waits in the queue, and the next one waits for space.
    let gives = thread::spawn(move || {
        for number in 0..20 {
            assert!(tee.write_frame(&picture(number), 0).unwrap().is_continue());
        }
        tee.finish(Ending::Complete).unwrap();
    });
    until("the camera has the one that waits for the file", || shown.try_iter().last().is_some_and(|last| last == "2"));
    for _ in 0..20 {
        may.send(()).unwrap();
    }
    gives.join().unwrap();
    assert_eq!((0..20).map(|_| next(&written)).collect::<Vec<_>>(), (0..20).map(|n| n.to_string()).collect::<Vec<_>>());
    assert_eq!((used(&frames, "slow").frames, used(&frames, "slow").lost), (20, 0));
}

/// Runs a tee behind a shutter, driven like in the last pipeline stage.
fn driven(
    sinks: impl IntoIterator<Item = Fake>,
    backpressure: Backpressure,
    test: impl FnOnce(&crate::sink::ShutterControl, &dyn Fn()),
) {
    let closed = Arc::new(AtomicBool::new(false));
    let tee = tee(sinks, backpressure, &closed);
    let (mut shutter, control) =
        Shutter::new(tee, (2, 2), Duration::from_millis(5), Demand::new(), Clock::system(), closed);
    let (end, ended) = mpsc::channel::<()>();
    let (wish, wishes) = mpsc::channel::<()>();
    let drives = thread::spawn(move || {
        let mut time_ns = 0;
        while !matches!(ended.try_recv(), Err(mpsc::TryRecvError::Disconnected)) {
            match wishes.recv_timeout(shutter.repeat_interval().unwrap()) {
                Ok(()) => {
                    time_ns += 5_000_000;
                    assert!(shutter.write_frame(&picture(7), time_ns).unwrap().is_continue());
                }
                Err(_) => assert!(shutter.repeat_frame().unwrap().is_continue()),
            }
        }
        Box::new(shutter).finish(Ending::Complete).unwrap();
    });
    test(&control, &|| wish.send(()).unwrap());
    drop(end);
    drives.join().unwrap();
}

/// Closing takes effect for a live camera, whatever another output does; the caller learns which output lacks the card.
#[test]
fn off_reaches_what_is_live_beside_an_output_that_stalls() {
    for backpressure in [Backpressure::DropOldest, Backpressure::Block] {
        let (mut camera, shown) = fake("camera");
        camera.is_live = true;
        let (mut stalled, taken) = fake("pipe");
        let (may, may_take) = mpsc::channel();
        stalled.may_take = Some(may_take);
        driven([stalled, camera], backpressure, |control, give| {
            (0..6).for_each(|_| give());
            assert_eq!(next(&shown), "7");
            control.close(true);
            let note = control.wait_for_card().unwrap().expect("the pipe has not the card");
            assert!(note.starts_with("pipe: "), "{note}");
            let last = shown.try_iter().last().expect("the card");
            assert_eq!(last, "card", "{backpressure:?}: answered before the camera had it");
            give();
            assert_eq!(next(&shown), "card", "and no picture after it");
            drop(may);
            until("the pipe has the card", || taken.try_iter().last().is_some_and(|last| last == "card"));
            assert_eq!(control.wait_for_card(), Ok(None));
            control.close(false);
            give();
            until("pictures again", || shown.try_iter().last().is_some_and(|last| last == "7"));
        });
    }
}

#[test]
fn off_is_no_success_while_something_live_keeps_the_picture() {
    let (mut camera, shown) = fake("camera");
    let (may, may_take) = mpsc::channel();
    (camera.is_live, camera.may_take) = (true, Some(may_take));
    let (file, written) = fake("file");
    driven([camera, file], Backpressure::DropOldest, |control, give| {
        give();
        may.send(()).unwrap();
        assert_eq!((next(&shown), next(&written)), ("7".into(), "7".into()));
        control.close(true);
        assert_eq!(control.wait_for_card(), Err(CardNotShown("camera".into())));
        assert!(written.try_iter().any(|what| what == "card"), "the file has it");
        drop(may);
        until("the camera has the card", || shown.try_iter().last().is_some_and(|last| last == "card"));
    });
}

#[test]
fn who_asks_of_a_run_that_has_ended_or_hangs_learns_that() {
    let (mut stalled, _taken) = fake("pipe");
    let (may, may_take) = mpsc::channel();
    stalled.may_take = Some(may_take);
    let (mut shutter, control) = Shutter::new(
        Box::new(stalled),
        (2, 2),
        Duration::from_millis(5),
        Demand::new(),
        Clock::system(),
        Arc::default(),
    );
    let hangs = thread::spawn(move || shutter.write_frame(&picture(7), 0).unwrap().is_continue());
    control.close(true);
    assert!(control.wait_for_card().unwrap().is_some_and(|note| note.starts_with("pipe: busy")));
    drop(may);
    assert!(hangs.join().unwrap());
    assert_eq!(control.wait_for_card(), Ok(None));
}

#[test]
fn a_sink_whose_reader_goes_is_left_out_and_the_last_ends_it() {
    let (mut a, of_a) = fake("a");
    let (mut b, of_b) = fake("b");
    (a.leaves_at, b.leaves_at) = (1, 3);
    let mut tee = tee([a, b], Backpressure::Block, &Arc::default());
    let mut given = 0;
    until("both have gone", || {
        given += 1;
        tee.write_frame(&picture(1), given).unwrap().is_break()
    });
    tee.finish(Ending::Truncated).unwrap();
    assert_eq!(of_a.iter().collect::<Vec<_>>(), ["1", "Complete"]);
    assert_eq!(of_b.iter().collect::<Vec<_>>(), ["1", "1", "1", "Complete"]);
}

#[test]
fn all_are_completed_and_the_first_error_is_told() {
    let (mut a, of_a) = fake("a");
    let (mut b, of_b) = fake("b");
    (a.finish_fails, b.finish_fails) = (true, true);
    let broken = tee([a, b], Backpressure::DropOldest, &Arc::default());
    assert_eq!(broken.finish(Ending::Complete).unwrap_err().to_string(), "cannot write a: full");
    assert_eq!((next(&of_a), next(&of_b)), ("Complete".into(), "Complete".into()));
}

#[test]
fn one_that_fails_is_left_out_unless_it_is_live_and_is_an_error_in_the_end() {
    for is_live in [false, true] {
        let (broken, of_broken) = fake("broken");
        let (good, of_good) = fake("good");
        let broken = Fake { is_live, fails_at: 1, ..broken };
        let mut tee = tee([broken, good], Backpressure::Block, &Arc::default());
        let mut error = None;
        for number in 0..100 {
            error = error.or(tee.write_frame(&picture(number), 0).err());
        }
        // The failure was detected by then, or is detected now.
        let error = error.or(tee.finish(Ending::Truncated).err()).unwrap();
        assert_eq!(error.to_string(), "cannot write broken: full");
        assert_eq!(of_broken.iter().count(), 1, "what has failed is not completed");
        let good: Vec<_> = of_good.iter().collect();
        assert!(is_live || good.len() == 101 && good[100] == "Truncated", "{good:?}");
    }
}

#[test]
fn a_panic_is_an_error_of_that_output() {
    struct Panics;
    impl Sink for Panics {
        fn write_frame(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
            panic!("as it should")
        }
        fn describe(&self) -> String {
            "panics".into()
        }
    }
    let (good, of_good) = fake("good");
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Panics), Box::new(good)];
    let mut tee = Box::new(Tee::new(sinks, Backpressure::Block, Arc::default()).unwrap());
    assert!((0..9).all(|number| tee.write_frame(&picture(number), 0).unwrap().is_continue()));
    let error = tee.finish(Ending::Complete).unwrap_err();
    assert_eq!(error.to_string(), "panics: panicked: as it should; please report this");
    assert_eq!(of_good.iter().count(), 10);
}

#[test]
fn outputs_that_are_given_up_are_not_completed() {
    let (a, of_a) = fake("a");
    let mut tee = tee([a, fake("b").0], Backpressure::Block, &Arc::default());
    assert!(tee.write_frame(&picture(3), 0).unwrap().is_continue());
    drop(tee);
    assert_eq!(of_a.iter().collect::<Vec<_>>(), ["3"], "what was under way comes, and nothing is finished");
}
