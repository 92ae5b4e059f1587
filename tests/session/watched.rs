//! A session as the window has it, on sources and outputs of the tests' own.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bokehcam::bokeh::{self, Backend, Bokeh};
use bokehcam::capture::synthetic::{Format, Synthetic};
use bokehcam::capture::{Brings, Camera, CaptureError, Captured, Shot, SourceInfo};
use bokehcam::depth::plate::{Guide, PlateDepth};
use bokehcam::frame::ColorImage;
use bokehcam::knob::Knob;
use bokehcam::link::Receiver;
use bokehcam::link::demand::{Demand, Watch};
use bokehcam::look::presets::Preset;
use bokehcam::look::{Look, Patch, Strength};
use bokehcam::optics::CocField;
use bokehcam::pipeline::View;
use bokehcam::preview::folders::Folders;
use bokehcam::preview::services::{Opened, Services, SettingsStore, Switch};
use bokehcam::preview::session::{Blurred, Session, SessionEvent, Start};
use bokehcam::preview::state::{Source, Update};
use bokehcam::sink::{Ending, Sink, SinkError};
use bokehcam::source::{self, devices::Choice};

/// Opens small synthetic scenes: the name is their width, `24 then no more` has two frames, and `nothing` is not there.
struct Small {
    executors: Arc<AtomicUsize>,
    written: Arc<Mutex<Vec<String>>>,
    settings: NoSettings,
}

struct Film(Arc<Mutex<Vec<String>>>, String);

impl Sink for Film {
    fn put(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        if self.1 == "fills up" {
            return Err(SinkError::Exists { path: "the disk is full now".into() });
        }
        self.0.lock().unwrap().push(format!("{} {}", self.1, frame.width));
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        if self.1 == "no end" {
            return Err(SinkError::Exists { path: "the disk is full at the end".into() });
        }
        self.0.lock().unwrap().push(format!("{} complete", self.1));
        Ok(())
    }
    fn describe(&self) -> String {
        self.1.clone()
    }
}

/// A camera that does not know its depth.
struct Plain(Synthetic);

impl Camera for Plain {
    fn info(&self) -> SourceInfo {
        SourceInfo { brings: Brings::Color, ..self.0.info() }
    }
    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
        self.0.next(shot)
    }
}

impl Services for Small {
    fn sources(&mut self) -> Vec<Choice> {
        vec![Choice { name: "32".into(), label: "A scene".into() }]
    }
    fn virtual_cameras(&mut self) -> Vec<Choice> {
        Vec::new()
    }
    fn open(&mut self, name: &str, with_plate: bool) -> Result<Opened, String> {
        let width =
            name.split(' ').next().and_then(|width| width.parse().ok()).ok_or(format!("no such source: {name}"))?;
        let frames = name.ends_with("no more").then_some(2);
        let format = Format { size: (width, 18), fps: 60.0, frames, threads: 1 };
        let scene = Synthetic::new(format).map_err(|error| error.to_string())?;
        let camera: Box<dyn Camera> = if with_plate { Box::new(Plain(scene)) } else { Box::new(scene) };
        let (name, notes, controls) = (name.to_owned(), vec!["a note".to_owned()], Vec::new());
        let mut source = source::Source::of(camera, None);
        if with_plate {
            let plate = PlateDepth::new(None, None, None);
            source.guide = Some(plate.guide());
            source.depth = Some(Box::new(plate));
        }
        let has_depth = source.has_depth();
        Ok(Opened { name, source, has_depth, takes_plates: true, notes, controls })
    }
    fn turn(&mut self, _: &str, _: i64) -> Result<Vec<Knob>, String> {
        Err("it has no controls".into())
    }
    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.executors.fetch_add(1, Ordering::SeqCst);
        bokeh::create(settings, size, Backend::Cpu, None, Some(1)).map_err(|error| error.to_string())
    }
    fn output(&mut self, name: &str, _: (u32, u32), _: u64, _: &Arc<AtomicBool>) -> Result<Box<dyn Sink>, String> {
        if name == "full" {
            Err("the disk is full".into())
        } else {
            Ok(Box::new(Film(Arc::clone(&self.written), name.into())))
        }
    }
    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String {
        self.settings.command(look, source, outputs, switches)
    }
    fn settings(&mut self) -> &mut dyn SettingsStore {
        &mut self.settings
    }
}

/// Settings that hold nothing: of presets there is one.
struct NoSettings;

impl SettingsStore for NoSettings {
    fn presets(&mut self) -> Vec<Preset> {
        vec![Preset { name: "same".into(), patch: Patch::default(), own: false }]
    }
    fn save_preset(&mut self, name: &str, _: &Look) -> Result<(), String> {
        if name.is_empty() { Err("no name".into()) } else { Ok(()) }
    }
    fn rename_preset(&mut self, _: &str, _: &str) -> Result<(), String> {
        Err("none of that name".into())
    }
    fn delete_preset(&mut self, _: &str) -> Result<(), String> {
        Err("none of that name".into())
    }
    fn command(&self, _: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String {
        format!("show {source} {outputs:?} {switches:?}")
    }
}

/// A session as the window has it: what it said so far, and where its frames come from.
pub struct Watched {
    pub session: Session,
    pub views: Option<Receiver<View>>,
    pub guide: Option<Arc<Guide>>,
    pub told: Vec<Update>,
    pub copied: Option<String>,
    /// The frames that stay, in other looks.
    pub blurred: Vec<Blurred>,
    /// Somebody watches while it is held.
    pub watch: Option<Watch>,
    pub demand: Demand,
    pub executors: Arc<AtomicUsize>,
    pub written: Arc<Mutex<Vec<String>>>,
}

pub const PATIENCE: Duration = Duration::from_secs(120);

pub fn look() -> Look {
    Look { strength: Strength::AtInfinity(2.0), ..Look::default() }
}

impl Watched {
    pub fn begin(source: &str) -> Self {
        Self::begin_in(source, &std::env::temp_dir())
    }

    pub fn begin_in(source: &str, folder: &Path) -> Self {
        let (executors, written) = (Arc::<AtomicUsize>::default(), Arc::<Mutex<Vec<String>>>::default());
        let demand = Demand::default();
        let watch = Some(demand.watch());
        let start = Start {
            services: Box::new(Small {
                executors: Arc::clone(&executors),
                written: Arc::clone(&written),
                settings: NoSettings,
            }),
            look: look(),
            source: source.into(),
            outputs: Vec::new(),
            keep_going: false,
            budget_ns: None,
            folders: Folders::at(folder.to_owned()),
            wanted: Arc::default(),
            demand: demand.clone(),
        };
        let session = Session::begin(start, Arc::new(|| {})).unwrap();
        Self {
            session,
            views: None,
            guide: None,
            told: Vec::new(),
            copied: None,
            blurred: Vec::new(),
            watch,
            demand,
            executors,
            written,
        }
    }

    pub fn hear(&mut self) {
        while let Some(heard) = self.session.hear() {
            match heard {
                SessionEvent::Update(told) => self.told.push(told),
                SessionEvent::Views(views, guide, _) => (self.views, self.guide) = (Some(views), guide),
                SessionEvent::Copy(text) => self.copied = Some(text),
                SessionEvent::Blurred(blurred) => self.blurred.push(*blurred),
            }
        }
    }

    /// Waits until something was said; what was said before it is forgotten.
    #[track_caller]
    pub fn until(&mut self, what: &str, is: impl Fn(&Update) -> bool) {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(at) = self.told.iter().position(&is) {
                self.told.drain(..=at);
                return;
            }
            assert!(began.elapsed() < PATIENCE, "never heard: {what}; {:?}", self.told);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits for a frame.
    #[track_caller]
    pub fn frame(&mut self, what: &str, is: impl Fn(&View) -> bool) -> View {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(view) = self.views.as_mut().and_then(Receiver::try_recv).filter(&is) {
                return view;
            }
            assert!(began.elapsed() < PATIENCE, "never seen: {what}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

pub fn is_running(told: &Update, width: u32) -> bool {
    matches!(told, Update::Source(Source::Running(running)) if running.size.0 == width)
}

pub fn radius_px(view: &View) -> f32 {
    match view.coc {
        CocField::Depth(coc) => coc.coc_at_infinity_px,
        CocField::Uniform { radius_px } => -radius_px,
        CocField::Ramp(_) => f32::NAN,
    }
}
