//! How a run ends: by a fault, a panic, a reader that closes, or the stop flag.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use bokehcam_live::pipeline::{Fault, Pace, run};
use bokehcam_live::sink::{Backpressure, Ending, Options, Sink, Target, Tee};

use crate::fakes::*;
use crate::setup::*;

#[test]
fn the_fault_of_a_stage_is_the_error_of_the_run() {
    for pace in [Pace::Asap, Pace::Realtime] {
        for frame in [0, 7] {
            let setup = || Setup::new(500, pace);
            let trouble = Trouble::fails_at(frame);
            let collect = FakeBokeh { collect_fails: true, ..fake_bokeh(2, trouble) };
            type Expected = fn(&Fault) -> bool;
            let cases: [(&str, Setup, Expected); 5] = [
                ("capture", Setup { camera: trouble, ..setup() }, |fault| matches!(fault, Fault::Capture(_))),
                ("depth", Setup { depth: Some(trouble), ..setup() }, |fault| matches!(fault, Fault::Depth(_))),
                ("submit", Setup { bokeh: Some(fake_bokeh(2, trouble)), ..setup() }, |fault| {
                    matches!(fault, Fault::Bokeh(_))
                }),
                ("collect", Setup { bokeh: Some(collect), ..setup() }, |fault| matches!(fault, Fault::Bokeh(_))),
                ("sink", Setup { sink: trouble, ..setup() }, |fault| matches!(fault, Fault::Sink(_))),
            ];
            for (stage, setup, expected) in cases {
                // In real time a frame may be skipped: only a stage's first frame is certain, and depth counts by the
                // frame's number.
                let certain = pace == Pace::Asap || frame == 0 && stage != "depth";
                let (result, received) = setup.run();
                let Err(error) = result else {
                    assert!(!certain, "{stage} at {frame}");
                    continue;
                };
                assert!(expected(&error.fault), "{stage} at {frame}: {error}");
                assert_eq!(received.ending(), Some(Ending::Truncated), "{stage} at {frame}");
                if pace == Pace::Asap {
                    assert!(error.report.frames.captured < 500, "{stage} at {frame} ended the run");
                    assert!(received.count() <= frame as u64);
                }
                if ["submit", "collect", "sink"].contains(&stage) {
                    assert_eq!(error.report.frames.dropped.failed, 1, "{stage}");
                }
            }
        }
    }
}

#[test]
fn a_panic_is_the_error_of_its_stage() {
    let setup = || Setup::new(300, Pace::Asap);
    let trouble = Trouble::panics_at(5);
    for (stage, setup) in [
        ("capture", Setup { camera: trouble, ..setup() }),
        ("depth", Setup { depth: Some(trouble), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(2, trouble)), ..setup() }),
        ("sink", Setup { sink: trouble, ..setup() }),
    ] {
        let (result, received) = setup.run();
        let text = result.unwrap_err().to_string();
        assert_eq!(text, format!("the {stage} stage panicked: out of order at frame 5; please report this"));
        assert_eq!(received.ending(), Some(Ending::Truncated), "{stage}");
    }
}

#[test]
fn an_executor_that_loses_frames_is_found_out() {
    let bokeh = FakeBokeh { loses_frames: true, ..fake_bokeh(2, Trouble::default()) };
    let (result, _) = Setup { bokeh: Some(bokeh), ..Setup::new(20, Pace::Asap) }.run();
    assert!(matches!(result.unwrap_err().fault, Fault::LostFrame));
}

#[test]
fn a_sink_that_cannot_be_completed_is_an_error() {
    let (result, received) = Setup { finish_fails: true, ..Setup::new(5, Pace::Asap) }.run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::Sink(_)) && received.count() == 5);
    assert_eq!(error.report.frames.delivered, 5);
}

#[test]
fn a_reader_that_goes_ends_the_run_cleanly() {
    let (result, received) = Setup { closes_at: 6, ..Setup::new(300, Pace::Asap) }.run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.delivered, received.count(), frames.dropped.total()), (6, 6, 0));
    assert_eq!(received.ending(), Some(Ending::Complete), "as far as anybody wanted it");
    assert!(frames.captured < 300 && frames.in_flight > 0, "what was under way stays in flight: {frames:?}");
}

#[test]
fn stop_finishes_what_is_in_hand() {
    for pace in [Pace::Asap, Pace::Realtime] {
        let (result, received) = Setup { stop_after: 8, ..Setup::new(5000, pace) }.run();
        let frames = result.unwrap().frames;
        assert_eq!(frames.in_flight, 0);
        assert!(frames.delivered >= 8 && frames.captured < 5000, "{frames:?}");
        assert_eq!(received.ending(), Some(Ending::Truncated), "the source had an end of its own");
    }
}

#[test]
fn stop_before_the_first_frame_still_makes_a_whole_file() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let options = Options::new(SIZE, PERIOD_NS);
    let stop = AtomicBool::new(true);
    let sink = Target::Y4m(name.clone()).open(&options).unwrap();
    let report = run(simple(Box::new(fake_camera(9)), sink, &stop, Pace::Asap)).unwrap();
    assert_eq!(report.frames.captured, 0);
    assert!(name.exists());
}

#[test]
fn a_failed_run_leaves_the_frames_that_were_good() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options::new(SIZE, PERIOD_NS);
    let stop = AtomicBool::new(false);
    let failing = || FakeCamera { trouble: Trouble::fails_at(5), ..fake_camera(9) };
    let name = folder.path().join("clip.y4m");
    let sink = Target::Y4m(name.clone()).open(&options).unwrap();
    let failed = run(simple(Box::new(failing()), sink, &stop, Pace::Asap)).unwrap_err();
    let frame = b"FRAME\n";
    let written = fs::read(&name).unwrap();
    let frames = written.windows(frame.len()).filter(|bytes| bytes == frame).count();
    assert_eq!((frames as u64, failed.report.frames.delivered), (5, 5));

    let out = folder.path().join("out");
    let sink = Target::Folder(out.clone()).open(&options).unwrap();
    assert!(run(simple(Box::new(failing()), sink, &stop, Pace::Asap)).is_err());
    for number in 0..5 {
        assert!(image::open(out.join(format!("{number:06}.png"))).is_ok(), "each picture is whole");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_failed_run_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    fs::write(&name, "old").unwrap();
    let options = Options { force: true, ..Options::new(SIZE, PERIOD_NS) };
    let stop = AtomicBool::new(false);
    let failing = FakeCamera { trouble: Trouble::fails_at(5), ..fake_camera(9) };
    let sink = Target::Y4m(name.clone()).open(&options).unwrap();
    assert!(run(simple(Box::new(failing), sink, &stop, Pace::Asap)).is_err());
    assert_eq!(fs::read(&name).unwrap(), b"old");
    assert!(fs::metadata(folder.path().join("clip.incomplete.y4m")).unwrap().len() > 0);

    let sink = Target::Y4m(name.clone()).open(&options).unwrap();
    run(simple(Box::new(fake_camera(9)), sink, &stop, Pace::Asap)).unwrap();
    assert!(fs::read(&name).unwrap().starts_with(b"YUV4MPEG2"));
}

#[test]
fn of_several_sinks_the_good_ones_go_on_to_the_end() {
    let fake = |received: &Received, trouble| FakeSink { trouble, ..fake_sink(received) };
    let stop = AtomicBool::new(false);
    for trouble in [Trouble::fails_at(2), Trouble::panics_at(2)] {
        let (good, bad) = (Received::default(), Received::default());
        let sinks: Vec<Box<dyn Sink>> = vec![Box::new(fake(&bad, trouble)), Box::new(fake(&good, Trouble::default()))];
        let tee = Tee::new(sinks, Backpressure::Block, Arc::default()).unwrap();
        let failed = run(simple(Box::new(fake_camera(9)), Box::new(tee), &stop, Pace::Asap)).unwrap_err();
        assert!(matches!(failed.fault, Fault::Sink(_)), "{failed}");
        assert_eq!((bad.count(), good.count(), failed.report.frames.delivered), (2, 9, 9));
        assert_eq!((bad.ending(), good.ending()), (None, Some(Ending::Complete)));
    }
}

#[test]
fn sinks_are_told_when_frames_were_taken() {
    let (result, received) = Setup::new(20, Pace::Asap).run();
    result.unwrap();
    let times_ns = received.times_ns.lock().unwrap();
    let expected: Vec<u64> = (0..20).map(|frame| frame * PERIOD_NS).collect();
    assert_eq!(*times_ns, expected);
}
