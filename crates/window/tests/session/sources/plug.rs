//! A session with real services and a pluggable fake camera.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bokehcam::bokeh::{self, Bokeh};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::Look;
use bokehcam_lab::synthetic::Synthetic;
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::capture::synthetic::Format;
use bokehcam_live::sink::{self, Sink};
use bokehcam_live::source::devices::Choice;
use bokehcam_live::source::modes::Mode;
use bokehcam_live::source::{self, Frames, Options};
use bokehcam_media::recording::RecordingWriter;
use bokehcam_window::services::{CliOption, OpenedSource, Services, SettingsStore};
use bokehcam_window::state::{Camera, DepthMethod};
use bokehcam_window::system::System;

use super::heard::{self, Heard, look};
use super::store::NoStore;

pub const FRAMES: usize = 12;

/// Records frames of brightness 20 times their index, and of depth 2 m plus 0.1 m per frame.
pub fn record(dir: &Path) {
    let mut writer = RecordingWriter::create(dir, false).unwrap();
    for frame in 0..FRAMES {
        let (mut color, mut depth) = (ColorImage::new(48, 32), DepthMap::new(48, 32));
        color.rgb.fill(20 * frame as u8);
        depth.metres.fill(2.0 + 0.1 * frame as f32);
        writer.add(frame as u64 * 40_000_000, &color, Some(&depth)).unwrap();
    }
    writer.finish().unwrap();
}

/// The system's services with a pluggable camera; records the chosen mode.
pub struct Plug {
    system: System,
    is_in: Arc<AtomicBool>,
    was_in: bool,
    mode: Option<((u32, u32), f64)>,
    /// Whether the source is the demonstration for want of the camera.
    is_fallback: bool,
}

pub const CAMERA: &str = "/dev/video-test";

impl Services for Plug {
    fn list_sources(&mut self) -> Vec<Choice> {
        let camera = self.was_in.then(|| Choice { name: CAMERA.into(), label: "A camera".into() });
        camera.into_iter().chain(self.system.list_sources()).collect()
    }
    fn list_virtual_cameras(&mut self) -> Vec<Choice> {
        Vec::new()
    }
    fn open(&mut self, name: &str, depth_method: Option<DepthMethod>) -> Result<OpenedSource, String> {
        let is_in = self.is_in.load(Ordering::SeqCst);
        self.is_fallback = name.is_empty() && !is_in;
        match (name, is_in) {
            ("", true) => self.open(CAMERA, depth_method),
            ("", false) => self.system.open("demo", depth_method),
            (CAMERA, false) => Err("no such camera".into()),
            (CAMERA, true) => {
                let ((width, height), fps) = self.mode.unwrap_or(((64, 48), 30.0));
                let format = Format { size: (width, height), fps, frames: None, threads: 1 };
                let source = source::Source::from_camera(Box::new(Synthetic::new(format).unwrap()), None);
                let (name, has_depth) = (name.into(), source.has_depth());
                let modes =
                    vec![Mode { size: (64, 48), fps: vec![30.0] }, Mode { size: (32, 24), fps: vec![60.0, 30.0] }];
                let camera = Camera { modes, faces_user: true, ..Camera::default() };
                let (notes, controls) = (Vec::new(), Vec::new());
                Ok(OpenedSource {
                    name,
                    source,
                    has_depth,
                    depth_methods: Vec::new(),
                    depth_method,
                    notes,
                    controls,
                    camera,
                })
            }
            _ => self.system.open(name, depth_method),
        }
    }
    fn have_devices_changed(&mut self) -> bool {
        let is_in = self.is_in.load(Ordering::SeqCst);
        std::mem::replace(&mut self.was_in, is_in) != is_in
    }
    fn awaited_camera(&mut self) -> Option<String> {
        (self.is_fallback && self.was_in).then(|| CAMERA.to_owned())
    }
    fn set_mode(&mut self, name: &str, size: (u32, u32), fps: f64) {
        assert_eq!(name, CAMERA);
        self.mode = Some((size, fps));
    }
    fn check_source_name(&self, name: &str) -> Result<(), String> {
        self.system.check_source_name(name)
    }
    fn set_control(&mut self, control: &str, value: i64) -> Result<Vec<CameraControl>, String> {
        self.system.set_control(control, value)
    }
    fn create_executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.system.create_executor(settings, size)
    }
    fn open_output(&mut self, name: &str, options: sink::Options) -> Result<Box<dyn Sink>, String> {
        self.system.open_output(name, options)
    }
    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String {
        self.system.format_command(look, source, outputs, switches)
    }
    fn settings(&mut self) -> &mut dyn SettingsStore {
        self.system.settings()
    }
}

/// A session on them, and whether the camera is plugged in.
pub type Watched = heard::Watched<Arc<AtomicBool>>;

impl Watched {
    pub fn begin(source: &str, folder: &Path) -> Self {
        bokehcam_lab::synthetic::register();
        let options = Options { frames: Frames { repeat: true, ..Frames::default() }, ..Options::default() };
        let system = System::new(options, look(), Box::new(NoStore));
        let is_in = Arc::<AtomicBool>::default();
        let plug = Plug { system, is_in: Arc::clone(&is_in), was_in: false, mode: None, is_fallback: false };
        Self { heard: Heard::begin(Box::new(plug), source, folder), services: is_in }
    }
}
