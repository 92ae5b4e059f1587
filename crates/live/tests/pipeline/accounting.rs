//! Every frame is accounted for, whatever stage is slow or broken.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use bokehcam_live::capture::{Camera, Captured, SourceInfo};
use bokehcam_live::pipeline::{Fault, Pace, run};
use bokehcam_live::sink::{Ending, Null};
use bokehcam_live::stats::DropCause;

use crate::fakes::*;
use crate::setup::*;

#[test]
fn lossless_delivers_every_frame_however_slow_a_stage_is() {
    let setup = || Setup::new(40, Pace::Asap);
    for (name, setup) in [
        ("nothing", setup()),
        ("capture", Setup { camera: Trouble::slow(), ..setup() }),
        ("depth", Setup { depth: Some(Trouble::slow()), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(2, Trouble::slow())), ..setup() }),
        ("blur of one", Setup { bokeh: Some(fake_bokeh(1, Trouble::slow())), ..setup() }),
        ("sink", Setup { sink: Trouble::slow(), ..setup() }),
    ] {
        let (result, received) = setup.run();
        let report = result.unwrap();
        assert_eq!((report.frames.captured, report.frames.delivered), (40, 40), "slow: {name}");
        assert!(received.numbers().into_iter().eq(0..40));
        assert_eq!(report.depth_held, 0, "slow: {name}");
    }
}

#[test]
fn live_accounts_for_every_frame_however_slow_a_stage_is() {
    // Longer than a busy machine may hold a stage up.
    const FRAMES: u64 = 360;
    let setup = || Setup::new(FRAMES as usize, Pace::Realtime);
    for (name, setup) in [
        ("nothing", setup()),
        ("capture", Setup { camera: Trouble::slow(), ..setup() }),
        ("depth", Setup { depth: Some(Trouble::slow()), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(1, Trouble::slow())), ..setup() }),
        ("sink", Setup { sink: Trouble::slow(), ..setup() }),
    ] {
        let (result, received) = setup.run();
        let report = result.unwrap();
        let frames = report.frames;
        assert_eq!((frames.captured, frames.in_flight), (FRAMES, 0), "slow {name}: {frames:?}");
        assert!(name != "depth" || report.depth_held > 0, "slow depth is made for fewer frames");
        assert!(received.count() > 0, "pictures never stop");
        if name == "capture" {
            assert!(frames.dropped.driver > 0, "what cannot be read in time is the driver's: {frames:?}");
        }
    }
}

#[test]
fn a_live_link_evicts_behind_a_sink_that_stands_still() {
    let asked = Arc::new(AtomicUsize::new(0));
    let (counts, mut fake) = (Arc::clone(&asked), fake_camera(200));
    // The period is so long that no frame is ever late.
    let info = SourceInfo { live: true, period_ns: 3_600_000_000_000, ..fake.info() };
    let camera = camera_by(info, move |before, shot| {
        counts.store(before + 1, Ordering::SeqCst);
        fake.next(shot).unwrap()
    });
    // The sink holds its first frame until the camera has delivered all of its own.
    let sink = sink_by(move |_| {
        while asked.load(Ordering::SeqCst) < 200 {
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    let stop = AtomicBool::new(false);
    let report = run(simple(camera, sink, &stop, Pace::Realtime)).unwrap();
    assert!(report.frames.is_balanced());
    assert!(report.frames.dropped.evicted > 180, "{:?}", report.frames);
    assert_eq!(report.frames.dropped.driver, 0, "a live camera is not asked to skip");
}

/// A live camera never ends by itself; of its frames, one in three is damaged, and the sink is slower than it is.
#[test]
fn as_many_frames_of_a_live_camera_as_were_asked_for_are_delivered() {
    const ASKED: u64 = 20;
    let mut fake = fake_camera(usize::MAX);
    let info = SourceInfo { live: true, frames: Some(ASKED), period_ns: 1_000_000, ..fake.info() };
    let camera = camera_by(info, move |before, shot| {
        std::thread::sleep(Duration::from_millis(1));
        match before % 3 {
            2 => Captured::Lost(1, DropCause::Corrupt),
            _ => fake.next(shot).unwrap(),
        }
    });
    let shown = Arc::new(AtomicUsize::new(0));
    let counts = Arc::clone(&shown);
    let sink = sink_by(move |_| {
        counts.fetch_add(1, Ordering::SeqCst);
        std::thread::sleep(Duration::from_millis(5));
    });
    let stop = AtomicBool::new(false);
    let frames = run(simple(camera, sink, &stop, Pace::Realtime)).unwrap().frames;
    assert!(frames.is_balanced(), "{frames:?}");
    assert_eq!((frames.delivered, shown.load(Ordering::SeqCst) as u64), (ASKED, ASKED));
    assert!(frames.dropped.corrupt > 0 && frames.captured > ASKED, "{frames:?}");
}

#[test]
fn corrupt_frames_end_the_run_or_are_counted() {
    let setup = |keep_going| Setup { corrupt_every: 4, keep_going, ..Setup::new(20, Pace::Asap) };
    let (result, received) = setup(false).run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::Capture(_)) && received.ending() == Some(Ending::Truncated));
    assert_eq!((error.report.frames.captured, error.report.frames.dropped.corrupt), (4, 1));

    let (result, received) = setup(true).run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.captured, frames.delivered, frames.dropped.corrupt), (20, 15, 5));
    assert!(received.numbers().iter().all(|number| number % 4 != 3));

    let depth = Some(Trouble::fails_at(9));
    let (result, received) = Setup { depth, keep_going: true, ..Setup::new(20, Pace::Asap) }.run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.captured, frames.delivered, frames.dropped.corrupt), (20, 19, 1));
    assert!(!received.numbers().contains(&9));
}

#[test]
fn an_empty_source_is_an_empty_run() {
    let stop = AtomicBool::new(false);
    let report = run(simple(Box::new(fake_camera(0)), Box::new(Null), &stop, Pace::Realtime)).unwrap();
    assert_eq!((report.frames.captured, report.latency_ms), (0, None));
}
