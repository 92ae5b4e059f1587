//! Sources behind the preview's window: back and forth in a recording, photos, what is offered, and devices that come and go.
#![cfg(feature = "window")]
#![allow(missing_docs)]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bokehcam::bokeh::{self, Bokeh};
use bokehcam::capture::Seeker;
use bokehcam::capture::synthetic::{Format, Synthetic};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::knob::Knob;
use bokehcam::link::Receiver;
use bokehcam::link::demand::{Demand, Watch};
use bokehcam::look::presets::Preset;
use bokehcam::look::{Look, Strength};
use bokehcam::pipeline::View;
use bokehcam::preview::folders::Folders;
use bokehcam::preview::services::{Opened, Services, SettingsStore, Switch};
use bokehcam::preview::session::{Session, SessionEvent, Start};
use bokehcam::preview::state::{Camera, Output, Request, Source, Update};
use bokehcam::preview::system::System;
use bokehcam::recording::tum::{Writer, WriterOptions};
use bokehcam::recording::{snapshot, still};
use bokehcam::sink::Sink;
use bokehcam::source::devices::Choice;
use bokehcam::source::modes::Mode;
use bokehcam::source::{self, Frames, Options, SourceName};

const PATIENCE: Duration = Duration::from_secs(60);
const FRAMES: usize = 12;

struct NoStore;

impl SettingsStore for NoStore {
    fn presets(&mut self) -> Vec<Preset> {
        Vec::new()
    }
    fn save_preset(&mut self, _: &str, _: &Look) -> Result<(), String> {
        Err("no file".into())
    }
    fn rename_preset(&mut self, _: &str, _: &str) -> Result<(), String> {
        Err("no file".into())
    }
    fn delete_preset(&mut self, _: &str) -> Result<(), String> {
        Err("no file".into())
    }
    fn command(&self, _: &Look, source: &str, _: &[String], _: &[Switch]) -> String {
        source.to_owned()
    }
}

/// Frames as bright as twenty times their number, each 2 m away and a decimetre more than the one before.
fn record(dir: &Path) {
    let mut writer = Writer::create(dir, &WriterOptions { depth_scale: 5000.0, overwrite: false }).unwrap();
    for frame in 0..FRAMES {
        let (mut color, mut depth) = (ColorImage::new(48, 32), DepthMap::new(48, 32));
        color.rgb.fill(20 * frame as u8);
        depth.metres.fill(2.0 + 0.1 * frame as f32);
        writer.add(frame as u64 * 40_000_000, &color, Some(&depth)).unwrap();
    }
    writer.finish().unwrap();
}

/// The system, with a camera that can be plugged in, and a note of the pictures that are chosen of it.
struct Plug {
    system: System,
    is_in: Arc<AtomicBool>,
    was_in: bool,
    mode: Option<((u32, u32), f64)>,
}

const CAMERA: &str = "/dev/video-test";

impl Services for Plug {
    fn sources(&mut self) -> Vec<Choice> {
        let camera = self.was_in.then(|| Choice { name: CAMERA.into(), label: "A camera".into() });
        camera.into_iter().chain(self.system.sources()).collect()
    }
    fn virtual_cameras(&mut self) -> Vec<Choice> {
        Vec::new()
    }
    fn open(&mut self, name: &str, with_plate: bool) -> Result<Opened, String> {
        match (name, self.is_in.load(Ordering::SeqCst)) {
            (CAMERA, false) => Err("no such camera".into()),
            (CAMERA, true) => {
                let ((width, height), fps) = self.mode.unwrap_or(((64, 48), 30.0));
                let format = Format { size: (width, height), fps, frames: None, threads: 1 };
                let source = source::Source::of(Box::new(Synthetic::new(format).unwrap()), None);
                let (name, has_depth) = (name.into(), source.has_depth());
                Ok(Opened { name, source, has_depth, takes_plates: false, notes: Vec::new(), controls: Vec::new() })
            }
            _ => self.system.open(name, with_plate),
        }
    }
    fn devices_changed(&mut self) -> bool {
        let is_in = self.is_in.load(Ordering::SeqCst);
        std::mem::replace(&mut self.was_in, is_in) != is_in
    }
    fn camera(&self) -> Camera {
        let modes = vec![Mode { size: (64, 48), fps: vec![30.0] }, Mode { size: (32, 24), fps: vec![60.0, 30.0] }];
        Camera { modes, faces_user: true, is_relative: false }
    }
    fn choose_mode(&mut self, name: &str, size: (u32, u32), fps: f64) {
        assert_eq!(name, CAMERA);
        self.mode = Some((size, fps));
    }
    fn check(&self, name: &str) -> Result<(), String> {
        self.system.check(name)
    }
    fn turn(&mut self, knob: &str, value: i64) -> Result<Vec<Knob>, String> {
        self.system.turn(knob, value)
    }
    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.system.executor(settings, size)
    }
    fn output(
        &mut self,
        name: &str,
        size: (u32, u32),
        ns: u64,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Sink>, String> {
        self.system.output(name, size, ns, stop)
    }
    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String {
        self.system.command(look, source, outputs, switches)
    }
    fn settings(&mut self) -> &mut dyn SettingsStore {
        self.system.settings()
    }
}

/// A session as the window has it.
struct Watched {
    session: Session,
    views: Option<Receiver<View>>,
    seeker: Option<Arc<Seeker>>,
    told: Vec<Update>,
    is_in: Arc<AtomicBool>,
    /// Somebody watches.
    _watch: Watch,
}

impl Watched {
    fn begin(source: &str, folder: &Path) -> Self {
        let options = Options { frames: Frames { repeat: true, ..Frames::default() }, ..Options::default() };
        let look = Look { strength: Strength::AtInfinity(2.0), ..Look::default() };
        let system = System::new(options, look.clone(), Box::new(NoStore));
        let is_in = Arc::<AtomicBool>::default();
        let demand = Demand::default();
        let watch = demand.watch();
        let start = Start {
            services: Box::new(Plug { system, is_in: Arc::clone(&is_in), was_in: false, mode: None }),
            look,
            source: source.into(),
            outputs: Vec::new(),
            keep_going: false,
            budget_ns: None,
            folders: Folders::at(folder.to_owned()),
            wanted: Arc::default(),
            demand: demand.clone(),
        };
        let session = Session::begin(start, Arc::new(|| {})).unwrap();
        Self { session, views: None, seeker: None, told: Vec::new(), is_in, _watch: watch }
    }

    fn hear(&mut self) {
        while let Some(heard) = self.session.hear() {
            match heard {
                SessionEvent::Views(views, _, seeker) => (self.views, self.seeker) = (Some(views), seeker),
                SessionEvent::Update(told) => self.told.push(told),
                _ => {}
            }
        }
    }

    /// Waits until something was said; what was said before it is forgotten.
    #[track_caller]
    fn until(&mut self, what: &str, is: impl Fn(&Update) -> bool) -> Update {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(at) = self.told.iter().position(&is) {
                return self.told.drain(..=at).next_back().unwrap();
            }
            assert!(began.elapsed() < PATIENCE, "never heard: {what}; {:?}", self.told);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[track_caller]
    fn frame(&mut self, what: &str, is: impl Fn(&View) -> bool) -> View {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(view) = self.views.as_mut().and_then(Receiver::try_recv).filter(&is) {
                return view;
            }
            assert!(began.elapsed() < PATIENCE, "never seen: {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn a_recording_is_sought_in_while_it_plays_and_what_is_written_stays_whole() {
    let (recording, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    record(recording.path());
    let mut watched = Watched::begin(&recording.path().display().to_string(), folder.path());
    watched.frame("a frame", |_| true);
    let seeker = watched.seeker.clone().expect("a recording is gone back and forth in");
    assert_eq!((seeker.frames(), seeker.length_ns()), (FRAMES, FRAMES as u64 * 40_000_000));
    let film = folder.path().join("film.y4m");
    let output = Output { name: film.display().to_string(), is_camera: false };
    watched.session.order(Request::Begin(output.clone()));
    let mut last_ns = 0;
    for place in [8, 3, 11, 0, 11] {
        let number = seeker.go_to(place);
        let asked = watched.frame("the frame that was asked for", |view| view.trace.asked && view.trace.seek == number);
        assert_eq!(seeker.place_of(asked.stamp), place);
        let rgb = asked.picture.memory().unwrap().rgb[0];
        assert!(rgb.abs_diff(20 * place as u8) <= 1, "{rgb} of frame {place}");
        let metres = asked.depth.as_ref().unwrap().metres[5];
        // Refined, but of no other frame.
        assert!((metres - 2.0 - 0.1 * place as f32).abs() < 0.02, "{metres} m of frame {place}");
        assert!(asked.stamp.time_ns > last_ns, "media time goes on");
        drop(asked);
        let after = watched.frame("those after it", |view| !view.trace.asked && view.trace.seek == number);
        last_ns = after.stamp.time_ns;
        assert!((seeker.place_of(after.stamp) + FRAMES - place) % FRAMES <= 6, "{:?}", after.stamp);
    }
    watched.session.order(Request::End(output));
    let closed = watched.session.close();
    assert_eq!(closed.failed, None);
    assert!(closed.report.unwrap().frames.balance());
    assert!(film.metadata().unwrap().len() > 48 * 32 * 3 / 2, "the film is there");
}

#[test]
fn what_never_ends_has_no_places() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::begin("synthetic", folder.path());
    watched.frame("a frame", |_| true);
    assert!(watched.seeker.is_none());
    watched.session.close();
}

fn is_running(told: &Update) -> bool {
    matches!(told, Update::Source(Source::Running(_)))
}

#[test]
fn a_photo_is_opened_with_the_depth_beside_it_and_follows_the_look() {
    let folder = tempfile::tempdir().unwrap();
    let (mut color, mut depth) = (ColorImage::new(40, 30), DepthMap::new(40, 30));
    for (at, pixel) in color.rgb.chunks_exact_mut(3).enumerate() {
        pixel.fill(if at % 40 < 20 { 40 } else { 200 });
        depth.metres[at] = if at % 40 < 20 { 1.0 } else { 4.0 };
    }
    let photo = folder.path().join("holiday.jpg");
    still::write_color(&photo, &color, false).unwrap();
    still::write_depth(&folder.path().join("holiday-depth.png"), &depth, 1000.0, false).unwrap();
    let name = photo.display().to_string();
    let mut watched = Watched::begin(&name, folder.path());
    watched.until("what it is", |told| matches!(told, Update::Note(line) if line.contains("a photo, one frame") && line.contains("depth beside it")));
    let Update::Source(Source::Running(running)) = watched.until("it runs", is_running) else { unreachable!() };
    assert!(running.size == (40, 30) && running.has_depth);
    let first = watched.frame("a frame", |_| true);
    let map = first.depth.as_ref().unwrap();
    assert!((map.metres[15 * 40 + 5] - 1.0).abs() < 0.05 && (map.metres[15 * 40 + 35] - 4.0).abs() < 0.2);
    let change = first.trace.change;
    drop(first);
    let stronger = Look { strength: Strength::AtInfinity(5.0), ..Look::default() };
    watched.session.order(Request::Look(Box::new(stronger)));
    watched.frame("another look", |view| view.trace.change > change && !view.trace.between);
    assert!(watched.session.close().report.unwrap().frames.balance());

    // Other names, a snapshot, and what is no photo.
    let open = |path: &Path| {
        let name: SourceName = path.display().to_string().parse()?;
        source::Source::open(&name, &Options::default(), None).map_err(|error| error.to_string())
    };
    let other = folder.path().join("other.png");
    still::write_color(&other, &color, false).unwrap();
    assert!(!open(&other).unwrap().has_depth());
    std::fs::rename(folder.path().join("holiday-depth.png"), folder.path().join("other.depth.png")).unwrap();
    assert!(open(&other).unwrap().has_depth());
    let kept =
        snapshot::Snapshot { picture: &ColorImage::new(40, 30), color: &color, depth: Some(&depth), settings: &[] };
    let kept = snapshot::save(folder.path(), "kept", &kept).unwrap();
    let mut opened = open(&kept).unwrap();
    assert!(opened.has_depth());
    let (mut into, mut no_depth, mut right) = Default::default();
    let shot = bokehcam::capture::Shot { color: &mut into, depth: &mut no_depth, right: &mut right };
    opened.camera.next(shot).unwrap();
    assert!(into == color, "the picture before the blur");
    still::write_depth(&folder.path().join("kept-2-depth.pfm"), &DepthMap::new(80, 30), 1000.0, true).unwrap();
    let small = folder.path().join("kept-2.png");
    still::write_color(&small, &color, false).unwrap();
    let error = open(&small).err().unwrap();
    assert!(error.contains("kept-2-depth.pfm") && !error.contains('\n'), "{error}");
    let text = folder.path().join("text.png");
    std::fs::write(&text, "no picture").unwrap();
    let error = open(&text).err().unwrap();
    assert!(error.contains("neither a folder nor a photo"), "{error}");
}

#[test]
fn what_is_offered_is_opened_only_if_it_can_be_and_stays_on_the_list() {
    let (recording, empty) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    record(recording.path());
    let mut watched = Watched::begin("synthetic", empty.path());
    watched.until("it runs", is_running);
    let name = recording.path().display().to_string();
    for nothing in [empty.path().display().to_string(), format!("{name}/missing"), format!("{name}/rgb.txt")] {
        watched.session.order(Request::Offer(nothing.clone()));
        watched.until("why not", |told| matches!(told, Update::Note(line) if line.contains(&nothing)));
    }
    watched.frame("what ran goes on", |view| view.picture.size().0 == 640);
    assert!(!watched.told.iter().any(|told| matches!(told, Update::Source(_))));
    watched.session.order(Request::Offer(name.clone()));
    watched.until("it is good", |told| *told == Update::Offered(name.clone()));
    // As the window does then.
    watched.session.order(Request::Open(name.clone()));
    let listed = |told: &Update, first: &str| match told {
        Update::Choices { sources, .. } => sources.first().is_some_and(|choice| choice.name == first),
        _ => false,
    };
    watched.until("it is listed", |told| listed(told, &name));
    watched.until("it runs", is_running);
    let again = recording.path().join(".").display().to_string();
    watched.session.order(Request::Open(again.clone()));
    watched.until("the last one is first", |told| listed(told, &again));
    watched.session.order(Request::Open("synthetic".into()));
    let told = watched.until("both stay", |told| matches!(told, Update::Choices { .. }));
    let Update::Choices { sources, .. } = told else { unreachable!() };
    let names: Vec<&str> =
        sources.iter().map(|choice| choice.name.as_str()).filter(|name| !name.starts_with("/dev/")).collect();
    assert_eq!(names, [again.as_str(), name.as_str(), "synthetic"]);
    watched.session.close();
}

#[test]
fn a_camera_that_comes_is_offered_and_opened_where_it_was_missing_and_its_pictures_are_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::begin(CAMERA, folder.path());
    watched.until("it is not there", |told| matches!(told, Update::Source(Source::Lost(_))));
    watched.is_in.store(true, Ordering::SeqCst);
    let has_it = |told: &Update| match told {
        Update::Choices { sources, .. } => sources.iter().any(|choice| choice.name == CAMERA),
        _ => false,
    };
    let began = Instant::now();
    watched.until("it is offered", has_it);
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    watched.until("its sizes", |told| matches!(told, Update::Camera(camera) if camera.modes.len() == 2));
    watched.until("it runs", is_running);
    watched.frame("a frame", |view| view.picture.size() == (64, 48));
    watched.session.order(Request::Mode((32, 24), 60.0));
    let Update::Source(Source::Running(running)) = watched.until("it runs", is_running) else { unreachable!() };
    assert_eq!((running.size, running.period_ns), ((32, 24), 16_666_667));
    watched.frame("a frame of the other size", |view| view.picture.size() == (32, 24));
    watched.is_in.store(false, Ordering::SeqCst);
    watched.until("it has gone", |told| matches!(told, Update::Choices { .. }) && !has_it(told));
    watched.session.close();
}
