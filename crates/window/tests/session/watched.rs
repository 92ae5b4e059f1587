//! A session with fake sources and outputs.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use bokehcam::bokeh::{self, Bokeh};
use bokehcam::depth::plate::PlateDepth;
use bokehcam::frame::ColorImage;
use bokehcam::link::demand::Demand;
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam_lab::synthetic::Synthetic;
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::capture::synthetic::Format;
use bokehcam_live::capture::{Camera as Capture, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::pipeline::View;
use bokehcam_live::sink::{self, Ending, Sink, SinkError};
use bokehcam_live::source::{self, devices::Choice};
use bokehcam_window::services::{CliOption, OpenedSource, Services, SettingsStore};
use bokehcam_window::state::{Camera, DepthMethod, Source, Update};

use super::heard::{self, Heard};
use super::store::NoStore;

/// Opens small synthetic scenes: the name is their width, `24 then no more` has two frames, and `nothing` does not
/// exist.
struct Small {
    executors: Arc<AtomicUsize>,
    is_private: Arc<AtomicBool>,
    written: Arc<Mutex<Vec<String>>>,
    readers: Arc<Mutex<Option<Demand>>>,
    settings: NoStore,
}

/// An output that notes the width of its pictures; `camera` is a virtual camera.
struct Film {
    written: Arc<Mutex<Vec<String>>>,
    name: String,
    last_ns: Option<u64>,
}

impl Sink for Film {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        if self.name == "fills up" {
            return Err(SinkError::Exists { path: "the disk is full now".into() });
        }
        assert!(self.last_ns.replace(time_ns).is_none_or(|last_ns| last_ns < time_ns), "time goes on");
        self.written.lock().unwrap().push(format!("{} {}", self.name, frame.width));
        Ok(ControlFlow::Continue(()))
    }
    fn write_card(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        self.written.lock().unwrap().push(format!("{} card", self.name));
        Ok(ControlFlow::Continue(()))
    }
    fn is_live(&self) -> bool {
        self.name == "camera"
    }
    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        if self.name == "no end" {
            return Err(SinkError::Exists { path: "the disk is full at the end".into() });
        }
        self.written.lock().unwrap().push(format!("{} complete", self.name));
        Ok(())
    }
    fn describe(&self) -> String {
        self.name.clone()
    }
}

/// A camera without depth.
struct Plain(Synthetic);

impl Capture for Plain {
    fn info(&self) -> SourceInfo {
        SourceInfo { frame_data: FrameData::Color, ..self.0.info() }
    }
    fn next(&mut self, shot: FrameBuffers) -> Result<Captured, CaptureError> {
        self.0.next(shot)
    }
}

impl Services for Small {
    fn list_sources(&mut self) -> Vec<Choice> {
        vec![Choice { name: "32".into(), label: "A scene".into() }]
    }
    fn list_virtual_cameras(&mut self) -> Vec<Choice> {
        Vec::new()
    }
    fn open(&mut self, name: &str, depth_method: Option<DepthMethod>) -> Result<OpenedSource, String> {
        let with_plate = depth_method == Some(DepthMethod::Plate);
        let width =
            name.split(' ').next().and_then(|width| width.parse().ok()).ok_or(format!("no such source: {name}"))?;
        let frames = name.ends_with("no more").then_some(2);
        let format = Format { size: (width, 18), fps: 60.0, frames, threads: 1 };
        let scene = Synthetic::new(format).map_err(|error| error.to_string())?;
        let camera: Box<dyn Capture> = if with_plate { Box::new(Plain(scene)) } else { Box::new(scene) };
        let (name, notes, controls) = (name.to_owned(), vec!["a note".to_owned()], Vec::new());
        let mut source = source::Source::from_camera(camera, None);
        if with_plate {
            let plate = PlateDepth::new(None, None, None);
            source.guide = Some(plate.guide());
            source.depth = Some(Box::new(plate));
        }
        let has_depth = source.has_depth();
        Ok(OpenedSource {
            name,
            source,
            has_depth,
            depth_methods: vec![DepthMethod::Plate],
            depth_method,
            notes,
            controls,
            camera: Camera::default(),
        })
    }
    fn set_control(&mut self, _: &str, _: i64) -> Result<Vec<CameraControl>, String> {
        Err("it has no controls".into())
    }
    fn create_executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.executors.fetch_add(1, Ordering::SeqCst);
        self.is_private.store(settings.privacy, Ordering::SeqCst);
        bokeh::create_blur(settings, size, None, Some(1)).map_err(|error| error.to_string())
    }
    fn open_output(&mut self, name: &str, options: sink::Options) -> Result<Box<dyn Sink>, String> {
        if name == "full" {
            return Err("the disk is full".into());
        }
        self.written.lock().unwrap().push(format!("{name} opened"));
        *self.readers.lock().unwrap() = options.demand;
        Ok(Box::new(Film { written: Arc::clone(&self.written), name: name.into(), last_ns: None }))
    }
    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String {
        self.settings.format_command(look, source, outputs, switches)
    }
    fn settings(&mut self) -> &mut dyn SettingsStore {
        &mut self.settings
    }
}

/// What a test sees of these services.
pub struct FrameInput {
    pub executors: Arc<AtomicUsize>,
    /// Whether the last executor is private.
    pub is_private: Arc<AtomicBool>,
    pub written: Arc<Mutex<Vec<String>>>,
    /// The demand of the output that was opened last.
    pub readers: Arc<Mutex<Option<Demand>>>,
}

/// A session on them.
pub type Watched = heard::Watched<FrameInput>;

impl Watched {
    pub fn begin(source: &str) -> Self {
        Self::begin_in(source, &std::env::temp_dir())
    }

    pub fn begin_in(source: &str, folder: &Path) -> Self {
        let (executors, is_private) = (Arc::default(), Arc::default());
        let (written, readers) = (Arc::default(), Arc::default());
        let services = FrameInput {
            executors: Arc::clone(&executors),
            is_private: Arc::clone(&is_private),
            written: Arc::clone(&written),
            readers: Arc::clone(&readers),
        };
        let small = Small { executors, is_private, written, readers, settings: NoStore };
        Self { heard: Heard::begin(Box::new(small), source, folder), services }
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
