//! Frames that arrive have the right depth and pixels, reproducibly, and are reported.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bokehcam::bokeh::quality_level::COSTS;
use bokehcam::bokeh::{Job, PassTimes};
use bokehcam::compute::Backend;
use bokehcam::frame::Stamp;
use bokehcam::look::Look;
use bokehcam_live::capture::{Camera, Captured, FrameBuffers, FrameData};
use bokehcam_live::pipeline::{Fault, Pace, Run, run};
use bokehcam_live::sink::Null;

use crate::fakes::*;
use crate::setup::*;

#[test]
fn depth_comes_with_the_frame_it_belongs_to() {
    // Focus is eased over media time, and all of these frames come within 20 ms: the first one determines it.
    for (frame_data, depth) in [(FrameData::Color, Some(Trouble::default())), (FrameData::Depth, None)] {
        let (result, received) = Setup { frame_data, depth, ..Setup::new(20, Pace::Asap) }.run();
        result.unwrap();
        assert!(received.pictures.lock().unwrap().iter().all(|rgb| rgb[0] == 1 && rgb[1] >= 100));
    }
    let (result, _) = Setup { depth: None, ..Setup::new(20, Pace::Asap) }.run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::NoDepth { .. }) && error.to_string().contains("fake camera"), "{error}");
}

#[test]
fn a_fixed_coc_and_no_blur_ask_for_no_depth() {
    let never = Some(Trouble::panics_at(0));
    let look = uniform(4.0);
    let (result, received) = Setup { depth: never, look, ..Setup::new(10, Pace::Asap) }.run();
    result.unwrap();
    assert!(
        received
            .pictures
            .lock()
            .unwrap()
            .iter()
            .enumerate()
            .all(|(i, rgb)| rgb[..BLURRED].iter().all(|&b| b == 100 + i as u8))
    );

    let (result, received) = Setup { depth: never, bokeh: None, ..Setup::new(10, Pace::Asap) }.run();
    let report = result.unwrap();
    assert!(
        received
            .pictures
            .lock()
            .unwrap()
            .iter()
            .enumerate()
            .all(|(i, rgb)| rgb[..BLURRED].iter().all(|&b| b == i as u8))
    );
    assert_eq!((report.backend.as_str(), report.quality.fractions.len()), ("none", 0));
}

#[test]
fn lossless_twice_is_the_same_twice() {
    let bytes = || {
        let (result, received) = Setup::new(60, Pace::Asap).run();
        result.unwrap();
        Arc::try_unwrap(received.pictures).unwrap().into_inner().unwrap()
    };
    assert_eq!(bytes(), bytes());
}

#[test]
fn the_report_tells_what_ran() {
    let (result, _) = Setup::new(10, Pace::Asap).run();
    let report = result.unwrap();
    assert_eq!((report.backend.as_str(), report.adapter.as_str()), ("cpu", "cpu, fake"));
    assert_eq!((report.source.as_str(), report.sink.as_str()), ("fake camera", "fake sink"));
    assert_eq!(report.quality.fractions, [("draft", 1.0)]);
    assert_eq!((report.budget_ms, report.misses), (0.5, 10), "0.7 ms of passes each");
    let stages: Vec<_> = report.stages_ms.0.iter().map(|stage| stage.0.as_str()).collect();
    assert_eq!(stages, ["decode", "depth", "blur", "blur.rows", "blur.columns", "sink"]);
    assert!((report.stages_ms.0[2].1.p50 - 0.7).abs() < 0.007);
    assert!(report.latency_ms.is_some() && report.frame_ms.is_some());
}

/// Creates a blur that reports the time `took` at the default quality, and in proportion at the others.
fn paced(took: Duration) -> FakeBokeh {
    let makes = move |job: Job| {
        let mut times = PassTimes::new();
        times.add("all", took.mul_f64(COSTS[job.quality as usize]));
        changed(job, times, |_| {})
    };
    let fake = fake_bokeh(1, Trouble::default());
    FakeBokeh { backend: Backend::Gpu, name: "a GPU, paced", makes: Box::new(makes), ..fake }
}

#[test]
fn quality_follows_the_time_there_is() {
    let stop = AtomicBool::new(false);
    for (took_us, quality) in [(1000, "best"), (3300, "balanced"), (4500, "draft"), (90_000, "draft")] {
        let report = run(Run {
            bokeh: Some(Box::new(paced(Duration::from_micros(took_us)))),
            look: Look { quality: None, ..uniform(3.0) },
            adaptive: true,
            budget_ns: 4_000_000,
            ..simple(Box::new(fake_camera(150)), Box::new(Null), &stop, Pace::Asap)
        });
        let quality_use = report.unwrap().quality;
        let most = quality_use.fractions.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert_eq!((most.0, quality_use.switches <= 1), (quality, true), "{took_us}: {quality_use:?}");
    }
}

#[test]
fn mirror_flips_pixels_and_keeps_channels() {
    // One picture, whose columns differ.
    let camera = camera_by(fake_camera(1).info(), |index, FrameBuffers { color, .. }| {
        color.resize(SIZE.0, SIZE.1);
        (0..).zip(&mut color.rgb).for_each(|(value, byte)| *byte = value);
        let stamp = Stamp { index, time_ns: 0, captured_ns: None };
        if index == 0 { Captured::Frame(stamp) } else { Captured::End }
    });
    let (received, stop) = (Received::default(), AtomicBool::new(false));
    let sink = fake_sink(&received);
    run(Run { mirror: true, ..simple(camera, Box::new(sink), &stop, Pace::Asap) }).unwrap();
    let rgb = &received.pictures.lock().unwrap()[0];
    assert_eq!(rgb[..6], [15, 16, 17, 12, 13, 14]);
    assert_eq!(rgb[18..21], [33, 34, 35]);
}
