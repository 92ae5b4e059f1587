//! [`Services`] by the operating system: real cameras, files and GPUs.

use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::dialog;
use super::services::{Browse, Opened, Pick, Services, SettingsStore, Switch};
use super::state::Camera;
use crate::bokeh::{self, Bokeh};
use crate::capture::demo;
use crate::computing::Executors;
use crate::knob::Knob;
use crate::look::{Effect, Look};
use crate::recording::{Options as Reading, Recording};
use crate::sink::{self, Sink, Target};
use crate::source::devices::{self, Choice};
use crate::source::{
    self, DepthChoice, DepthFrom, Kind, OneCamera, Options, PlateFile, Size, Source, SourceName, modes,
};

/// Shown when there is no camera, and the demonstration takes its place.
const NO_CAMERA: &str = "No camera was found.";
/// Shown with the synthetic scene.
const RENDERED: &str = "This scene is rendered while it plays, as fast as the machine can; `demo` plays smoothly.";
/// Shown where a camera gives no depth, so that a portrait never comes.
const NO_DEPTH: &str = "This camera has no depth, so a band of the picture stays sharp. A plate gives it a portrait (T), and \
                        so does a free network (`bokehcam models`).";
/// Shown where the command line declines the depth that there is.
const DECLINED: &str = "This source has depth, and --depth none declines it: leave that out for blur by depth.";

/// Opens everything as the command line would.
pub struct System {
    /// How sources are opened.
    pub options: Options,
    /// The look at the start.
    pub look: Look,
    /// Makes what blurs.
    pub executors: Executors,
    /// Width and height of virtual cameras; `None`: those of the frames.
    pub out_size: Option<(u32, u32)>,
    /// Overwrite what exists.
    pub force: bool,
    /// Where settings are kept.
    pub settings: Box<dyn SettingsStore>,
    /// The sources that were opened, the last one first: they stay on the list, even if they are no cameras.
    opened: Vec<Choice>,
    /// The camera of which other pictures were chosen, and which.
    mode: Option<(String, Size, f64)>,
    /// The device nodes as they were last, and whether they were others before that.
    nodes: (Vec<String>, bool),
    /// Values of the camera's knobs that were turned, by name.
    turned: BTreeMap<String, i64>,
    /// The camera that was opened last, where it has knobs.
    camera: Option<String>,
    /// Whether a plate was asked for in the window.
    with_plate: bool,
}

impl System {
    /// A system that overwrites nothing; nothing is open yet.
    pub fn new(options: Options, look: Look, settings: Box<dyn SettingsStore>) -> Self {
        Self {
            executors: Executors::new(options.computing.clone()),
            options,
            look,
            out_size: None,
            force: false,
            settings,
            opened: Vec::new(),
            mode: None,
            nodes: (devices::nodes(), false),
            turned: BTreeMap::new(),
            camera: None,
            with_plate: false,
        }
    }

    /// What is known of the camera that was opened, if it is one alone.
    fn facts_of(&self, source: &Source) -> Camera {
        let is_relative = matches!(source.depth_from, DepthFrom::Relative | DepthFrom::Networks | DepthFrom::Plate);
        let Some(camera) = &self.camera else { return Camera { is_relative, ..Camera::default() } };
        let is_lone = matches!(source.depth_from, DepthFrom::Nothing | DepthFrom::Networks | DepthFrom::Plate);
        let is_pair = self.options.stereo.side_by_side;
        Camera {
            modes: modes::modes(camera),
            faces_user: is_lone && !is_pair && modes::faces_user(camera),
            is_relative,
        }
    }

    /// Opens a source to be played for as long as the window is open, with depth whether or not the look needs it.
    fn open_source(&self, name: &str, with_plate: bool) -> Result<(Source, SourceName), String> {
        let source_name = SourceName::from_str(name).map_err(|error| error.of(name).to_string())?;
        let mut options = self.options.clone();
        if with_plate {
            options.depth_choice = DepthChoice::OneCamera(plate());
        }
        // The others have no end.
        options.frames.repeat &= matches!(source_name.kind(), Kind::Recording | Kind::Photo);
        if let Some((_, size, fps)) = self.mode.as_ref().filter(|(camera, ..)| camera == name) {
            (options.frames.size, options.frames.fps) = (Some(*size), Some(*fps));
        }
        // The window may switch to an effect that needs depth later.
        let look = Look { effect: Effect::Auto, ..self.look.clone() };
        let source = Source::open(&source_name, &options, Some(&look)).map_err(|error| error.to_string())?;
        Ok((source, source_name))
    }
}

/// A plate that is taken at the start, and the networks that are installed.
fn plate() -> OneCamera {
    OneCamera { plate: Some(PlateFile::Taken), ..source::installed_networks() }
}

impl Services for System {
    fn sources(&mut self) -> Vec<Choice> {
        let mut sources = devices::cameras();
        let is_other =
            |choice: &&Choice| choice.name != demo::NAME && !sources.iter().any(|camera| camera.name == choice.name);
        let opened: Vec<Choice> = self.opened.iter().filter(is_other).cloned().collect();
        sources.extend(opened);
        sources.push(Choice { name: demo::NAME.into(), label: "Demonstration".into() });
        sources
    }

    fn virtual_cameras(&mut self) -> Vec<Choice> {
        devices::virtual_cameras()
    }

    fn open(&mut self, name: &str, with_plate: bool) -> Result<Opened, String> {
        let mut notes = Vec::new();
        let first_camera = devices::cameras().into_iter().next();
        let name = match name {
            "" => first_camera.map_or_else(
                || {
                    notes.push(NO_CAMERA.to_owned());
                    demo::NAME.to_owned()
                },
                |camera| camera.name,
            ),
            name => name.to_owned(),
        };
        let (source, source_name) = self.open_source(&name, with_plate)?;
        notes.extend(source.networks.iter().map(|networks| format!("Depth by {networks}.")));
        match source_name.kind() {
            Kind::Camera if !source.has_depth() => notes.push(NO_DEPTH.to_owned()),
            Kind::Synthetic => notes.push(RENDERED.to_owned()),
            _ => {}
        }
        let is_declined = self.options.depth_choice == DepthChoice::None && !with_plate;
        if is_declined && source.has_depth() {
            notes.push(DECLINED.to_owned());
        }
        let has_depth = source.has_depth() && !is_declined;
        self.turned.clear();
        notes.extend(source_name.note(&source));
        self.opened.retain(|choice| choice.name != name);
        self.opened.insert(0, Choice::of(&name));
        self.camera = devices::camera_of(&source_name);
        let controls = self.camera.as_deref().map(devices::knobs).unwrap_or_default();
        self.with_plate = with_plate;
        let is_replaceable = matches!(source.depth_from, DepthFrom::Nothing | DepthFrom::Networks | DepthFrom::Plate);
        let camera = self.facts_of(&source);
        let takes_plates = self.camera.is_some() && is_replaceable;
        Ok(Opened { name, source, has_depth, takes_plates, notes, controls, camera })
    }

    fn devices_changed(&mut self) -> bool {
        let nodes = devices::nodes();
        let differ = nodes != self.nodes.0;
        // Once more a moment later: a node is there before everybody may open it.
        let again = std::mem::replace(&mut self.nodes, (nodes, differ)).1;
        differ || again
    }

    fn check(&self, name: &str) -> Result<(), String> {
        let source_name = SourceName::from_str(name).map_err(|error| error.of(name).to_string())?;
        match &source_name {
            SourceName::Folder(folder) => {
                let reading = Reading { keep_going: true, ..Reading::default() };
                Recording::open(folder, &reading).map(drop).map_err(|error| error.to_string())
            }
            _ => Ok(()),
        }
    }

    fn browse(&self, what: Browse) -> Pick {
        Box::new(move || dialog::pick(what))
    }

    fn choose_mode(&mut self, name: &str, (width, height): (u32, u32), fps: f64) {
        self.mode = Some((name.to_owned(), Size { width, height }, fps));
    }

    fn turn(&mut self, knob: &str, value: i64) -> Result<Vec<Knob>, String> {
        let Some(camera) = &self.camera else { return Err("this source has no controls".to_owned()) };
        let controls = devices::turn(camera, knob, value)?;
        self.turned.insert(knob.to_owned(), value);
        Ok(controls)
    }

    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.executors.blur(settings, size).map_err(|error| error.to_string())
    }

    fn output(
        &mut self,
        name: &str,
        size: (u32, u32),
        period_ns: u64,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Sink>, String> {
        let (force, out_size, threads, stop) =
            (self.force, self.out_size, self.options.computing.threads, Arc::clone(stop));
        let options = sink::Options { force, out_size, threads, stop, ..sink::Options::new(size, period_ns) };
        let target = Target::from_str(name).map_err(|error| error.to_string())?;
        target.open(&options).map_err(|error| error.to_string())
    }

    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String {
        let mut switches = match outputs {
            [] => switches.to_vec(),
            // A command that writes to outputs has no window to set options of.
            _ => Vec::new(),
        };
        if !self.turned.is_empty() {
            let controls: Vec<String> = self.turned.iter().map(|(name, value)| format!("{name}={value}")).collect();
            switches.push(("control".into(), controls.join(",")));
        }
        if let Some((_, size, fps)) = self.mode.as_ref().filter(|(camera, ..)| camera == source) {
            switches.push(("size".into(), format!("{}x{}", size.width, size.height)));
            switches.push(("fps".into(), format!("{}", (fps * 1000.0).round() / 1000.0)));
        }
        if self.with_plate {
            switches.push(("depth".into(), plate().kinds()));
        }
        self.settings.command(look, source, outputs, &switches)
    }

    fn settings(&mut self) -> &mut dyn SettingsStore {
        &mut *self.settings
    }
}
