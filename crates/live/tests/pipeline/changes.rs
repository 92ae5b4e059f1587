//! Changes during a run, and viewers of it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use bokehcam::bokeh::{Bokeh, Job, PassTimes};
use bokehcam::compute::PictureLocation;
use bokehcam::link;
use bokehcam::optics::CocField;
use bokehcam_live::pipeline::{Change, ExecutorChange, OutputRequest, Pace, Run, View, run};
use bokehcam_live::sink::{Null, Sink};

use crate::fakes::{FakeBokeh, Received, Trouble, changed, fake_bokeh, fake_camera, fake_sink, nobody};
use crate::setup::{simple, uniform};

fn radius_of(job: &Job) -> f32 {
    let CocField::Uniform { radius_px } = job.coc else { panic!("no such rule was given") };
    radius_px
}

/// Does not blur, but writes the one radius that it was made for.
fn made(radius_px: f32) -> FakeBokeh {
    let makes = move |job| changed(job, PassTimes::new(), |job| job.out.rgb[0] = radius_px as u8);
    FakeBokeh { makes: Box::new(makes), ..fake_bokeh(2, Trouble::default()) }
}

#[test]
fn every_frame_has_the_radius_and_the_executor_of_one_change() {
    for pace in [Pace::Asap, Pace::Realtime] {
        let (blurred, wrong) = (Arc::<AtomicU64>::default(), Arc::<AtomicU64>::default());
        let made = |radius_px| {
            let (blurred, wrong) = (Arc::clone(&blurred), Arc::clone(&wrong));
            let looks = move |job: &Job| {
                wrong.fetch_add(u64::from(radius_of(job) != radius_px), Ordering::SeqCst);
                blurred.fetch_add(1, Ordering::SeqCst);
            };
            Box::new(FakeBokeh { looks: Box::new(looks), ..made(radius_px) }) as Box<dyn Bokeh>
        };
        let (send, changes) = mpsc::channel();
        let (stop, received) = (AtomicBool::new(false), Received::default());
        let sink = fake_sink(&received);
        let to_come: Vec<_> = (1..=40u8)
            .map(|k| {
                // Every fifth change lets frames pass through unblurred.
                let executor = (k % 5 != 0).then(|| made(f32::from(k)));
                Change { number: u64::from(k), look: uniform(f32::from(k)), bokeh: ExecutorChange::Replace(executor) }
            })
            .collect();
        let report = thread::scope(|scope| {
            scope.spawn(move || {
                for (k, change) in to_come.into_iter().enumerate() {
                    let _ = send.send(change);
                    thread::sleep(Duration::from_micros(if k % 3 == 0 { 0 } else { 700 }));
                }
            });
            run(Run {
                bokeh: Some(made(0.0)),
                look: uniform(0.0),
                changes: Some(changes),
                ..simple(Box::new(fake_camera(400)), Box::new(sink), &stop, pace)
            })
            .unwrap()
        });
        assert!(report.frames.is_balanced(), "{:?}", report.frames);
        assert_eq!(wrong.load(Ordering::SeqCst), 0);
        assert!(blurred.load(Ordering::SeqCst) > 0);
        assert!(received.numbers().is_sorted_by(|a, b| a < b), "frames keep their order");
        if pace == Pace::Asap {
            assert_eq!(report.frames.delivered, 400, "a change costs no frame");
        }
    }
}

#[test]
fn the_first_change_is_known_by_its_number_and_frames_without_one_by_none() {
    for (number, radius_px) in [(0, 5.0), (9, 6.0)] {
        let (send, changes) = mpsc::channel();
        if number > 0 {
            let look = uniform(radius_px);
            let bokeh = ExecutorChange::Replace(Some(Box::new(made(radius_px))));
            send.send(Change { number, look, bokeh }).unwrap();
        }
        let (view, mut views) = link::live::<View>();
        let stop = AtomicBool::new(false);
        let seen = thread::scope(|scope| {
            let looking = scope.spawn(move || std::iter::from_fn(|| views.recv()).collect::<Vec<View>>());
            let report = run(Run {
                bokeh: Some(Box::new(made(5.0))),
                look: uniform(5.0),
                changes: Some(changes),
                view: Some(view),
                ..simple(Box::new(fake_camera(3)), Box::new(Null), &stop, Pace::Asap)
            });
            assert_eq!(report.unwrap().frames.delivered, 3);
            looking.join().unwrap()
        });
        assert!(!seen.is_empty());
        for View { picture, change, .. } in seen {
            assert_eq!((picture.memory().unwrap().rgb[0], change), (radius_px as u8, number));
        }
    }
}

#[test]
fn a_viewer_sees_what_pictures_were_made_of_and_counts_where_the_sink_does_not() {
    for (keeps, patience_ms) in [(false, 0), (false, 5), (true, 5)] {
        let (view, mut views) = link::live::<View>();
        let stop = AtomicBool::new(false);
        let sink: Box<dyn Sink> = if keeps { Box::new(Null) } else { nobody() };
        let (report, seen) = thread::scope(|scope| {
            let looking = scope.spawn(move || {
                let mut seen = 0;
                while let Some(view) = views.recv() {
                    let before = view.color.as_ref().expect("it was blurred");
                    let picture = view.picture.memory().expect("it is in memory");
                    assert_eq!(before.rgb[1..], picture.rgb[1..]);
                    assert_eq!((picture.rgb[0], view.coc), (7, CocField::Uniform { radius_px: 7.0 }));
                    seen += 1;
                    thread::sleep(Duration::from_millis(patience_ms));
                }
                seen
            });
            let report = run(Run {
                bokeh: Some(Box::new(made(7.0))),
                look: uniform(7.0),
                view: Some(view),
                ..simple(Box::new(fake_camera(300)), sink, &stop, Pace::Asap)
            });
            (report.unwrap(), looking.join().unwrap())
        });
        assert!(report.frames.is_balanced() && report.frames.captured == 300, "{:?}", report.frames);
        assert_eq!(report.frames.in_flight, 0);
        if keeps {
            assert_eq!(report.frames.delivered, 300, "the sink had them all");
        } else {
            assert_eq!(report.frames.delivered, seen, "delivered is what was looked at");
            assert_eq!(report.frames.dropped.evicted, 300 - seen);
        }
        assert!(seen > 0);
    }
}

#[test]
fn a_viewer_that_leaves_ends_the_run() {
    let (view, views) = link::live();
    drop(views);
    let stop = AtomicBool::new(false);
    let report =
        run(Run { view: Some(view), ..simple(Box::new(fake_camera(usize::MAX)), nobody(), &stop, Pace::Asap) });
    let frames = report.unwrap().frames;
    assert!(frames.is_balanced() && frames.delivered == 0, "{frames:?}");
}

#[test]
fn frames_between_two_looks_are_known() {
    for (bokeh, between) in [
        (ExecutorChange::Keep, false),
        (ExecutorChange::KeepUntilReady, true),
        (ExecutorChange::Replace(Some(Box::new(made(5.0)) as Box<dyn Bokeh>)), false),
    ] {
        let (send, changes) = mpsc::channel();
        send.send(Change { number: 1, look: uniform(5.0), bokeh }).unwrap();
        let (view, mut views) = link::live::<View>();
        let stop = AtomicBool::new(false);
        let seen = thread::scope(|scope| {
            let looking = scope.spawn(move || std::iter::from_fn(|| views.recv()).collect::<Vec<View>>());
            run(Run {
                bokeh: Some(Box::new(made(5.0))),
                look: uniform(5.0),
                changes: Some(changes),
                view: Some(view),
                ..simple(Box::new(fake_camera(3)), Box::new(Null), &stop, Pace::Asap)
            })
            .unwrap();
            looking.join().unwrap()
        });
        assert!(!seen.is_empty() && seen.iter().all(|view| view.is_transitional == between));
    }
}

#[test]
fn pictures_are_made_where_they_are_wanted_but_mirrored_ones_in_memory() {
    for (mirror, place) in [(false, PictureLocation::Both), (true, PictureLocation::Memory)] {
        let (places, stop) = (Arc::<Mutex<Vec<PictureLocation>>>::default(), AtomicBool::new(false));
        let noted = Arc::clone(&places);
        let looks = Box::new(move |job: &Job| noted.lock().unwrap().push(job.place));
        run(Run {
            bokeh: Some(Box::new(FakeBokeh { looks, ..made(3.0) })),
            mirror,
            output_request: Some(Arc::new(OutputRequest::new(PictureLocation::Both))),
            ..simple(Box::new(fake_camera(3)), Box::new(Null), &stop, Pace::Asap)
        })
        .unwrap();
        assert_eq!(*places.lock().unwrap(), [place; 3], "mirror {mirror}");
    }
}
