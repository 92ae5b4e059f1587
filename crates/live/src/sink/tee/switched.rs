//! Sinks that are added and removed during a run.

use std::io;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc;
use std::thread;
use std::time::Instant;

use super::*;
use crate::sink::tee_control::{MemberState, RunEnded};

/// Size of the frames.
const SIZE: (u32, u32) = (2, 2);
/// No step takes this long: detects a hang.
const HANG: Duration = Duration::from_secs(120);

/// A member with configurable behaviour.
#[derive(Default)]
struct Fake {
    name: &'static str,
    /// First bytes of the frames it got.
    got: Arc<std::sync::Mutex<Vec<u8>>>,
    repeats: Arc<AtomicU64>,
    repeat_interval: Option<Duration>,
    /// The frame at which its reader leaves.
    leaves_at: Option<usize>,
    /// The frame that it fails to write.
    fails_at: Option<usize>,
    /// Completion waits for this signal.
    finish_at: Option<Receiver<()>>,
    finish_fails: bool,
    finish_panics: bool,
}

fn full(name: &str) -> SinkError {
    SinkError::write(name.as_ref())(io::Error::other("full"))
}

impl Sink for Fake {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        let mut got = self.got.lock().unwrap();
        if self.fails_at == Some(got.len()) {
            return Err(full(self.name));
        }
        if self.leaves_at == Some(got.len()) {
            return Ok(ControlFlow::Break(()));
        }
        got.push(frame.rgb[0]);
        Ok(ControlFlow::Continue(()))
    }

    fn repeat_interval(&self) -> Option<Duration> {
        self.repeat_interval
    }

    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.repeats.fetch_add(1, Ordering::SeqCst);
        Ok(ControlFlow::Continue(self.repeat_interval.is_some()))
    }

    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        self.finish_at.iter().for_each(|at| at.recv_timeout(HANG).unwrap());
        assert!(!self.finish_panics, "as it should");
        if self.finish_fails { Err(full(self.name)) } else { Ok(()) }
    }

    fn describe(&self) -> String {
        self.name.into()
    }
}

fn switch() -> (Box<Tee>, TeeControl, Receiver<MemberEvent>) {
    let (to, told) = mpsc::channel();
    let (switch, control) = Tee::with_control("window", move |what| drop(to.send(what)));
    (Box::new(switch), control, told)
}

/// Returns a frame with this value in every sample.
fn filled(value: u8) -> ColorImage {
    let mut frame = ColorImage::new(SIZE.0, SIZE.1);
    frame.rgb.fill(value);
    frame
}

/// Sends frames, each after the members have processed the previous one.
fn write_frames(switch: &mut Tee, numbers: std::ops::Range<u8>) {
    let frames = |count: &Counter<OutputCounts>| count().frames + count().lost;
    for number in numbers {
        switch.handle_requests();
        let counts: Vec<_> = switch.outputs.iter().map(|member| member.output.create_counter()).collect();
        let before: Vec<_> = counts.iter().map(frames).collect();
        assert!(switch.write_frame(&filled(number), number.into()).unwrap().is_continue());
        let began = Instant::now();
        let is_busy = |at: usize| frames(&counts[at]) == before[at] && !switch.outputs[at].output.has_ended();
        while (0..counts.len()).any(is_busy) {
            assert!(began.elapsed() < HANG);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Returns all notices so far, sorted by member.
fn all(told: &Receiver<MemberEvent>) -> Vec<(String, MemberState)> {
    let mut all: Vec<_> = told.try_iter().map(|told| (told.member, told.state)).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

fn began(name: &str) -> (String, MemberState) {
    (name.into(), MemberState::Started)
}

fn completed(name: &str, frames: u64) -> (String, MemberState) {
    (name.into(), MemberState::Completed { frames })
}

fn failed(name: &str, frames: u64, why: &str) -> (String, MemberState) {
    (name.into(), MemberState::Failed { frames, why: why.into() })
}

#[test]
fn members_come_and_go_and_each_gets_the_frames_of_its_time() {
    let (mut switch, control, told) = switch();
    assert!(!switch.has_outputs());
    write_frames(&mut switch, 0..2);
    let (early, late) = (Fake::default(), Fake::default());
    let got = [Arc::clone(&early.got), Arc::clone(&late.got)];
    control.add("early", 0, SIZE, Box::new(early)).unwrap();
    write_frames(&mut switch, 2..4);
    assert!(switch.has_outputs());
    let other = control.clone();
    thread::spawn(move || other.add("late", 0, SIZE, Box::new(late)).unwrap()).join().unwrap();
    write_frames(&mut switch, 4..5);
    control.remove("early");
    control.remove("nobody");
    write_frames(&mut switch, 5..7);
    switch.finish(Ending::Complete).unwrap();
    assert_eq!(got.map(|got| got.lock().unwrap().clone()), [vec![2, 3, 4], vec![4, 5, 6]]);
    let expected = [began("early"), completed("early", 3), began("late"), completed("late", 3)];
    assert_eq!(all(&told), expected);
}

#[test]
fn a_member_that_fails_or_whose_reader_goes_is_taken_out_and_the_others_go_on() {
    let (mut switch, control, told) = switch();
    let good = Fake::default();
    let got = Arc::clone(&good.got);
    control.add("a", 0, SIZE, Box::new(Fake { name: "a", fails_at: Some(1), ..Fake::default() })).unwrap();
    control.add("b", 0, SIZE, Box::new(good)).unwrap();
    control.add("c", 0, SIZE, Box::new(Fake { leaves_at: Some(2), ..Fake::default() })).unwrap();
    write_frames(&mut switch, 0..5);
    switch.handle_requests();
    assert_eq!(switch.outputs.len(), 1);
    // A member's failure during the run does not fail the run.
    switch.finish(Ending::Complete).unwrap();
    assert_eq!(*got.lock().unwrap(), [0, 1, 2, 3, 4]);
    let [a, b, c] = [failed("a", 1, "cannot write a: full"), completed("b", 5), completed("c", 2)];
    assert_eq!(all(&told), [began("a"), a, began("b"), b, began("c"), c]);
}

#[test]
fn a_member_that_takes_long_to_complete_does_not_hold_frames_up() {
    let (mut switch, control, told) = switch();
    let (complete, finish_at) = mpsc::channel();
    control.add("slow", 0, SIZE, Box::new(Fake { finish_at: Some(finish_at), ..Fake::default() })).unwrap();
    write_frames(&mut switch, 0..1);
    control.remove("slow");
    write_frames(&mut switch, 1..100);
    assert_eq!(all(&told), [began("slow")], "frames went on while it was not complete");
    let late = thread::spawn(move || {
        thread::sleep(Duration::from_millis(20));
        complete.send(()).unwrap();
    });
    switch.finish(Ending::Complete).unwrap();
    assert_eq!(all(&told), [completed("slow", 1)], "the end waits for it");
    late.join().unwrap();
}

#[test]
fn errors_at_the_end_are_told_and_returned_after_all_are_completed() {
    let (mut switch, control, told) = switch();
    control.add("a", 0, SIZE, Box::new(Fake { name: "a", finish_panics: true, ..Fake::default() })).unwrap();
    control.add("b", 0, SIZE, Box::new(Fake { name: "b", finish_fails: true, ..Fake::default() })).unwrap();
    let (complete, finish_at) = mpsc::channel();
    control.add("c", 0, SIZE, Box::new(Fake { finish_at: Some(finish_at), ..Fake::default() })).unwrap();
    write_frames(&mut switch, 0..2);
    // After the others have failed, most likely.
    thread::spawn(move || {
        thread::sleep(Duration::from_millis(20));
        complete.send(()).unwrap();
    });
    assert_eq!(switch.finish(Ending::Complete).unwrap_err().to_string(), "cannot write b: full");
    let [a, b, c] = [
        failed("a", 2, "a: panicked: as it should; please report this"),
        failed("b", 2, "cannot write b: full"),
        completed("c", 2),
    ];
    assert_eq!(all(&told), [began("a"), a, began("b"), b, began("c"), c]);
    // A late request is refused, and reported as failed.
    assert_eq!(control.add("d", 0, SIZE, Box::new(Fake::default())), Err(RunEnded));
    assert_eq!(all(&told), [failed("d", 0, "it was given up")]);
}

#[test]
fn what_was_recorded_is_completed_though_the_run_fails() {
    let (mut switch, control, told) = switch();
    control.add("a", 0, SIZE, Box::new(Fake::default())).unwrap();
    write_frames(&mut switch, 0..3);
    control.add("b", 0, SIZE, Box::new(Fake::default())).unwrap();
    drop(switch);
    assert_eq!(all(&told), [began("a"), completed("a", 3), began("b"), completed("b", 0)]);
}

#[test]
fn a_name_that_is_taken_goes_to_the_newer_member() {
    let (mut switch, control, told) = switch();
    for _ in 0..2 {
        control.add("a", 0, SIZE, Box::new(Fake::default())).unwrap();
        write_frames(&mut switch, 0..2);
    }
    assert_eq!(switch.outputs.len(), 1);
    switch.finish(Ending::Complete).unwrap();
    let told: Vec<_> = all(&told).into_iter().filter(|told| *told == completed("a", 2)).collect();
    assert_eq!(told.len(), 2);
}

#[test]
fn without_pictures_orders_are_taken_and_live_members_repeat_when_they_are_due() {
    let (mut switch, control, told) = switch();
    assert_eq!(switch.repeat_interval(), Some(TICK));
    let live = Fake { repeat_interval: Some(Duration::from_millis(5)), ..Fake::default() };
    let (repeats, file) = (Arc::clone(&live.repeats), Fake::default());
    control.add("file", 0, SIZE, Box::new(file)).unwrap();
    assert_eq!(switch.repeat_frame().unwrap(), ControlFlow::Continue(false));
    assert_eq!(all(&told), [began("file")]);
    control.add("live", 0, SIZE, Box::new(live)).unwrap();
    write_frames(&mut switch, 0..1);
    let began_at = Instant::now();
    while repeats.load(Ordering::SeqCst) < 4 {
        assert!(began_at.elapsed() < HANG, "nobody calls it: it does so itself");
        thread::sleep(Duration::from_millis(1));
    }
    control.remove("file");
    assert_eq!(switch.repeat_frame().unwrap(), ControlFlow::Continue(false));
    switch.finish(Ending::Complete).unwrap();
    assert_eq!(all(&told), [completed("file", 1), began("live"), completed("live", 1)]);
}

#[test]
fn a_member_keeps_its_size_and_shows_the_card_while_frames_are_withheld() {
    let (mut switch, control, _) = switch();
    let (film, camera) = (Fake::default(), Fake::default());
    let (in_film, in_camera) = (Arc::clone(&film.got), Arc::clone(&camera.got));
    // The fake's first byte is the left edge: black beside a picture that is scaled into a wide frame.
    control.add("film", 1, (6, 2), Box::new(film)).unwrap();
    control.add("camera", 2, SIZE, Box::new(camera)).unwrap();
    write_frames(&mut switch, 1..3);
    control.withhold("camera", Some(filled(99)));
    control.withhold("nobody", None);
    switch.handle_requests();
    let began = Instant::now();
    while in_camera.lock().unwrap().last() != Some(&99) {
        assert!(began.elapsed() < HANG, "the card comes without a frame");
    }
    for number in 3..6 {
        assert!(switch.write_frame(&filled(number), number.into()).unwrap().is_continue());
    }
    control.withhold("camera", None);
    assert!(switch.write_frame(&filled(6), 6).unwrap().is_continue());
    switch.finish(Ending::Complete).unwrap();
    assert_eq!(*in_camera.lock().unwrap(), [1, 2, 99, 6]);
    assert!(in_film.lock().unwrap().iter().all(|&left| left == 0));
}

/// A stalled recording delays neither the camera nor the frames, and counts its losses.
#[test]
fn no_member_waits_for_another() {
    let (mut switch, control, told) = switch();
    let (complete, finish_at) = mpsc::channel();
    let camera = Fake::default();
    let got = Arc::clone(&camera.got);
    let stalled = Fake { name: "stalled", ..Fake::default() };
    // It receives its first frame once this lock is released.
    let (stuck, held) = (Arc::clone(&stalled.got), stalled.got.lock().unwrap().clone());
    assert!(held.is_empty());
    let hold = stuck.lock().unwrap();
    control.add("stalled", 0, SIZE, Box::new(stalled)).unwrap();
    control.add("camera", 0, SIZE, Box::new(Fake { finish_at: Some(finish_at), ..camera })).unwrap();
    for number in 0..20 {
        assert!(switch.write_frame(&filled(number), number.into()).unwrap().is_continue());
        let began = Instant::now();
        while got.lock().unwrap().last() != Some(&number) {
            assert!(began.elapsed() < HANG, "the camera waits");
        }
    }
    drop(hold);
    complete.send(()).unwrap();
    let outputs = switch.output_counters();
    switch.finish(Ending::Complete).unwrap();
    // The first one that its thread dequeued, and the newest.
    let taken = stuck.lock().unwrap().clone();
    let count = taken.len() as u64;
    assert!(taken.last() == Some(&19) && count <= 2, "{taken:?}");
    assert_eq!((outputs[0]().frames, outputs[0]().lost), (count, 20 - count));
    assert_eq!(all(&told), [began("camera"), completed("camera", 20), began("stalled"), completed("stalled", count)]);
}
