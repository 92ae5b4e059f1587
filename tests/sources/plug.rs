//! A session on the system, with a camera that can be plugged in.

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
use bokehcam::look::{Look, Strength};
use bokehcam::pipeline::View;
use bokehcam::preview::folders::Folders;
use bokehcam::preview::services::{Opened, Services, SettingsStore, Switch};
use bokehcam::preview::session::{Session, SessionEvent, Start};
use bokehcam::preview::state::{Camera, Update};
use bokehcam::preview::system::System;
use bokehcam::recording::tum::{Writer, WriterOptions};
use bokehcam::sink::Sink;
use bokehcam::source::devices::Choice;
use bokehcam::source::modes::Mode;
use bokehcam::source::{self, Frames, Options};

use super::store::NoStore;

pub const PATIENCE: Duration = Duration::from_secs(60);
pub const FRAMES: usize = 12;

/// Frames as bright as twenty times their number, each 2 m away and a decimetre more than the one before.
pub fn record(dir: &Path) {
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
pub struct Plug {
    system: System,
    is_in: Arc<AtomicBool>,
    was_in: bool,
    mode: Option<((u32, u32), f64)>,
}

pub const CAMERA: &str = "/dev/video-test";

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
pub struct Watched {
    pub session: Session,
    pub views: Option<Receiver<View>>,
    pub seeker: Option<Arc<Seeker>>,
    pub told: Vec<Update>,
    pub is_in: Arc<AtomicBool>,
    /// Somebody watches.
    _watch: Watch,
}

impl Watched {
    pub fn begin(source: &str, folder: &Path) -> Self {
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

    pub fn hear(&mut self) {
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
    pub fn until(&mut self, what: &str, is: impl Fn(&Update) -> bool) -> Update {
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
    pub fn frame(&mut self, what: &str, is: impl Fn(&View) -> bool) -> View {
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
