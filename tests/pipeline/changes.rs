//! What may change while a run goes on, and who looks on.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use bokehcam::bokeh::{Bokeh, BokehError, Finished, Job, PassTimes, Picture};
use bokehcam::compute::{Backend, Place};
use bokehcam::frame::ColorImage;
use bokehcam::link;
use bokehcam::optics::CocField;
use bokehcam::pipeline::{Change, Executor, Pace, Run, View, Wanted, run};
use bokehcam::sink::{Ending, Sink, SinkError};

use crate::fakes::{FakeSink, Received, SIZE, Trouble};
use crate::setup::{fake_camera, simple, uniform};

/// Blurs nothing, but knows the one radius that it was made for.
struct Made {
    radius_px: f32,
    held: VecDeque<Job>,
    blurred: Arc<AtomicU64>,
    wrong: Arc<AtomicU64>,
}

impl Bokeh for Made {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        let CocField::Uniform { radius_px } = job.coc else { panic!("no such rule was given") };
        self.wrong.fetch_add(u64::from(radius_px != self.radius_px), Ordering::SeqCst);
        self.blurred.fetch_add(1, Ordering::SeqCst);
        self.held.push_back(job);
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        if !wait && self.held.len() < self.capacity() {
            return Ok(None);
        }
        Ok(self.held.pop_front().map(|mut job| {
            job.out.resize(SIZE.0, SIZE.1);
            job.out.rgb.copy_from_slice(&job.color.rgb);
            job.out.rgb[0] = self.radius_px as u8;
            let times = PassTimes::new();
            let Job { ticket, out, color, depth, .. } = job;
            Finished { ticket, picture: Picture::in_memory(out), color, depth, times }
        }))
    }

    fn in_flight(&self) -> usize {
        self.held.len()
    }
    fn capacity(&self) -> usize {
        2
    }
    fn backend(&self) -> Backend {
        Backend::Cpu
    }
    fn describe(&self) -> String {
        "made".into()
    }
}

/// Remembers where pictures were wanted.
struct Placed {
    made: Made,
    places: Arc<Mutex<Vec<Place>>>,
}

impl Bokeh for Placed {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        self.places.lock().unwrap().push(job.place);
        self.made.submit(job)
    }
    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        self.made.collect(wait)
    }
    fn in_flight(&self) -> usize {
        self.made.in_flight()
    }
    fn capacity(&self) -> usize {
        self.made.capacity()
    }
    fn backend(&self) -> Backend {
        self.made.backend()
    }
    fn describe(&self) -> String {
        self.made.describe()
    }
}

/// Takes frames and says that nothing becomes of them.
struct Nobody;

impl Sink for Nobody {
    fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        Ok(ControlFlow::Continue(()))
    }
    fn keeps(&self) -> bool {
        false
    }
    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }
    fn describe(&self) -> String {
        "nobody".into()
    }
}

#[test]
fn every_frame_has_the_radius_and_the_executor_of_one_change() {
    for pace in [Pace::Asap, Pace::Realtime] {
        let (blurred, wrong) = (Arc::<AtomicU64>::default(), Arc::<AtomicU64>::default());
        let made = |radius_px| {
            let (blurred, wrong) = (Arc::clone(&blurred), Arc::clone(&wrong));
            Box::new(Made { radius_px, held: VecDeque::new(), blurred, wrong }) as Box<dyn Bokeh>
        };
        let (send, changes) = mpsc::channel();
        let (stop, received) = (AtomicBool::new(false), Received::default());
        let sink = FakeSink {
            received: received.clone(),
            trouble: Trouble::default(),
            closes_at: usize::MAX,
            finish_fails: false,
        };
        let to_come: Vec<_> = (1..=40u8)
            .map(|k| {
                // Now and then frames pass through.
                let executor = (k % 5 != 0).then(|| made(f32::from(k)));
                Change { number: u64::from(k), look: uniform(f32::from(k)), bokeh: Executor::To(executor) }
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
        assert!(report.frames.balance(), "{:?}", report.frames);
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
    let made = |radius_px| Made { radius_px, held: VecDeque::new(), blurred: Arc::default(), wrong: Arc::default() };
    for (number, radius_px) in [(0, 5.0), (9, 6.0)] {
        let (send, changes) = mpsc::channel();
        if number > 0 {
            let look = uniform(radius_px);
            let bokeh = Executor::To(Some(Box::new(made(radius_px))));
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
                ..simple(Box::new(fake_camera(3)), Box::new(bokehcam::sink::Null), &stop, Pace::Asap)
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
        let sink: Box<dyn Sink> = if keeps { Box::new(bokehcam::sink::Null) } else { Box::new(Nobody) };
        let (report, seen) = thread::scope(|scope| {
            let looking = scope.spawn(move || {
                let mut seen = 0;
                while let Some(view) = views.recv() {
                    let before = view.color.as_ref().expect("it was blurred");
                    let picture = view.picture.memory().expect("it is in memory");
                    assert_eq!(before.rgb[1..], picture.rgb[1..]);
                    assert_eq!((picture.rgb[0], view.coc), (7, CocField::Uniform { radius_px: 7.0 }));
                    assert!(view.frames.captured > 0);
                    seen += 1;
                    thread::sleep(Duration::from_millis(patience_ms));
                }
                seen
            });
            let made = Made { radius_px: 7.0, held: VecDeque::new(), blurred: Arc::default(), wrong: Arc::default() };
            let report = run(Run {
                bokeh: Some(Box::new(made)),
                look: uniform(7.0),
                view: Some(view),
                ..simple(Box::new(fake_camera(300)), sink, &stop, Pace::Asap)
            });
            (report.unwrap(), looking.join().unwrap())
        });
        assert!(report.frames.balance() && report.frames.captured == 300, "{:?}", report.frames);
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
        run(Run { view: Some(view), ..simple(Box::new(fake_camera(usize::MAX)), Box::new(Nobody), &stop, Pace::Asap) });
    let frames = report.unwrap().frames;
    assert!(frames.balance() && frames.delivered == 0, "{frames:?}");
}

#[test]
fn frames_between_two_looks_are_known() {
    let made = |radius_px| Made { radius_px, held: VecDeque::new(), blurred: Arc::default(), wrong: Arc::default() };
    for (bokeh, between) in [
        (Executor::Keep, false),
        (Executor::Meanwhile, true),
        (Executor::To(Some(Box::new(made(5.0)) as Box<dyn Bokeh>)), false),
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
                ..simple(Box::new(fake_camera(3)), Box::new(bokehcam::sink::Null), &stop, Pace::Asap)
            })
            .unwrap();
            looking.join().unwrap()
        });
        assert!(!seen.is_empty() && seen.iter().all(|view| view.is_between == between));
    }
}

#[test]
fn pictures_are_made_where_they_are_wanted_but_mirrored_ones_in_memory() {
    for (mirror, place) in [(false, Place::Both), (true, Place::Memory)] {
        let (places, stop) = (Arc::<Mutex<Vec<Place>>>::default(), AtomicBool::new(false));
        let made = Made { radius_px: 3.0, held: VecDeque::new(), blurred: Arc::default(), wrong: Arc::default() };
        run(Run {
            bokeh: Some(Box::new(Placed { made, places: Arc::clone(&places) })),
            mirror,
            wanted: Some(Arc::new(Wanted::new(Place::Both))),
            ..simple(Box::new(fake_camera(3)), Box::new(bokehcam::sink::Null), &stop, Pace::Asap)
        })
        .unwrap();
        assert_eq!(*places.lock().unwrap(), [place; 3], "mirror {mirror}");
    }
}
