//! [`Services`] of the operating system: real cameras, files and GPUs.

mod cameras;

use std::collections::BTreeMap;
use std::str::FromStr;

use cameras::{first_camera, is_there, list_cameras};

use super::dialog;
use super::services::{CliOption, FileChooser, OpenedSource, PathKind, Services, SettingsStore};
use super::state::{Camera, DepthMethod};
use bokehcam::bokeh::{self, Bokeh};
use bokehcam::computing::ExecutorFactory;
use bokehcam::look::{Effect, Look};
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::capture::demo;
use bokehcam_live::sink::{self, Sink, Target};
use bokehcam_live::source::devices::{self, CameraWatch, Choice};
use bokehcam_live::source::{self, DepthChoice, Kind, Options, SingleCameraDepth, Size, Source, SourceName, modes};
use bokehcam_media::recording::{Options as Reading, Recording};

/// Shown if there is no camera, and the demonstration replaces it.
const NO_CAMERA: &str = "No camera was found.";
/// Shown with the synthetic scene.
const RENDERED: &str = "This scene is rendered while it plays, at the speed of this machine; `demo` plays smoothly.";
/// Shown if no network is installed.
const NO_NETWORK: &str = "There is no network yet: `bokehcam models get` installs one that finds you.";
/// Shown if the command line declines the source's depth.
const DECLINED: &str = "The depth of this source is off by --depth none: leave that out for blur by depth.";

/// Opens sources and outputs like the command line does.
pub struct System {
    /// Options for opening sources.
    pub options: Options,
    /// The initial look.
    pub look: Look,
    /// Creates executors.
    pub executors: ExecutorFactory,
    /// Width and height of virtual cameras; `None` for those of the frames.
    pub out_size: Option<(u32, u32)>,
    /// Whether to overwrite existing files.
    pub force: bool,
    /// Persistent settings.
    pub settings: Box<dyn SettingsStore>,
    /// Sources opened so far, most recent first: they stay in the list even if they are no cameras.
    opened: Vec<Choice>,
    /// Camera name with the frame size and rate chosen for it.
    chosen_mode: Option<(String, Size, f64)>,
    devices: CameraWatch,
    /// Whether the source is the demonstration for want of a camera.
    is_fallback: bool,
    /// Values of the driver controls set by the user, by name.
    control_values: BTreeMap<String, i64>,
    /// Device of the camera opened last, if it has driver controls.
    camera: Option<String>,
    /// Depth method that the user chose in the window.
    depth_method: Option<DepthMethod>,
    /// Name of the source opened last with its default method, and the methods it supports itself.
    own_depth_methods: (String, Vec<DepthMethod>),
}

impl System {
    /// Creates a system without an open source, which does not overwrite files.
    pub fn new(options: Options, look: Look, settings: Box<dyn SettingsStore>) -> Self {
        Self {
            executors: ExecutorFactory::new(options.computing.clone()),
            options,
            look,
            out_size: None,
            force: false,
            settings,
            opened: Vec::new(),
            chosen_mode: None,
            devices: CameraWatch::new(),
            is_fallback: false,
            control_values: BTreeMap::new(),
            camera: None,
            depth_method: None,
            own_depth_methods: Default::default(),
        }
    }

    /// Returns the properties of the opened source.
    fn camera_properties(&self, source: &Source, name: &SourceName) -> Camera {
        let metres = source.metres();
        let is_lone = source.depth_from.is_replaceable();
        let Some(camera) = &self.camera else {
            // A camera known only to PipeWire is a laptop's built-in one.
            let faces_user = is_lone && name.kind() == Kind::Camera;
            return Camera { metres, faces_user, is_fallback: self.is_fallback, ..Camera::default() };
        };
        let is_pair = self.options.stereo.side_by_side;
        Camera {
            modes: modes::list_modes(camera),
            faces_user: is_lone && !is_pair && modes::faces_user(camera),
            metres,
            is_fallback: false,
        }
    }

    /// Opens a source for continuous playback, with depth even if the current look does not need it.
    fn open_source(&self, name: &str, depth_method: Option<DepthMethod>) -> Result<(Source, SourceName), String> {
        let source_name = SourceName::from_str(name).map_err(|error| error.with_prefix(name).to_string())?;
        let mut options = self.options.clone();
        if let Some(depth_method) = depth_method {
            options.depth_choice = self.depth_choice_for(depth_method);
        }
        // Only recordings, videos and photos end.
        options.frames.repeat &= matches!(source_name.kind(), Kind::Recording | Kind::Video | Kind::Photo);
        if let Some((_, size, fps)) = self.chosen_mode.as_ref().filter(|(camera, ..)| camera == name) {
            (options.frames.size, options.frames.fps) = (Some(*size), Some(*fps));
        }
        // A later look may need depth; without metric settings, relative depth is accepted.
        let look = Look { effect: Effect::Auto, ..self.look.clone() }.without_metres((0, 0));
        let source = Source::open(&source_name, &options, Some(&look)).map_err(|error| error.to_string())?;
        Ok((source, source_name))
    }

    /// Returns the depth choice of a method. Depth from elsewhere on the command line counts as the source's own.
    fn depth_choice_for(&self, depth_method: DepthMethod) -> DepthChoice {
        match (depth_method, &self.options.depth_choice) {
            (
                DepthMethod::Measured,
                choice @ (DepthChoice::Folder(_) | DepthChoice::Video(_) | DepthChoice::Device(_) | DepthChoice::Auto),
            ) => choice.clone(),
            (
                DepthMethod::Person,
                DepthChoice::SingleCamera(SingleCameraDepth { plate: None, matte: Some(file), .. }),
            ) => DepthChoice::SingleCamera(SingleCameraDepth {
                matte: Some(file.clone()),
                ..SingleCameraDepth::default()
            }),
            (
                DepthMethod::PersonAndMonoDepth,
                choice @ DepthChoice::SingleCamera(SingleCameraDepth { mono: Some(_), matte: Some(_), .. }),
            ) => choice.clone(),
            _ => depth_method.to_depth_choice(),
        }
    }

    /// Returns the depth methods of a source opened with `depth_method`, its own ones first.
    fn list_depth_methods(
        &mut self,
        source: &Source,
        name: &SourceName,
        depth_method: Option<DepthMethod>,
    ) -> Vec<DepthMethod> {
        let called = name.to_string();
        if depth_method.is_none() || self.own_depth_methods.0 != called {
            let mut own = Vec::new();
            match name {
                // Checks the recording itself, because the opened source reveals only the method in use.
                SourceName::Folder(folder) => {
                    let recording =
                        Recording::open(folder, &Reading { keep_going: true, ..self.options.recording_options() }).ok();
                    let has = |own: &mut Vec<DepthMethod>, is: bool, depth_method: DepthMethod| {
                        own.extend(is.then_some(depth_method))
                    };
                    has(&mut own, recording.as_ref().is_some_and(Recording::has_depth), DepthMethod::Measured);
                    has(
                        &mut own,
                        recording.is_some_and(|recording| recording.stereo_geometry().is_some()),
                        DepthMethod::Stereo,
                    );
                }
                _ => own.extend(
                    DepthMethod::from_origin(source.depth_from, &SingleCameraDepth::default(), false)
                        .filter(|depth_method| matches!(depth_method, DepthMethod::Measured | DepthMethod::Stereo)),
                ),
            }
            self.own_depth_methods = (called, own);
        }
        let mut depth_methods = self.own_depth_methods.1.clone();
        if matches!(name.kind(), Kind::Camera | Kind::Recording | Kind::Video | Kind::Photo) {
            let installed = source::installed_networks();
            depth_methods.extend(installed.matte.is_some().then_some(DepthMethod::Person));
            depth_methods.extend(
                (installed.matte.is_some() && installed.mono.is_some()).then_some(DepthMethod::PersonAndMonoDepth),
            );
        }
        // A plate is for live cameras without depth of their own.
        let is_alone = name.kind() == Kind::Camera && self.own_depth_methods.1.is_empty();
        depth_methods.extend(is_alone.then_some(DepthMethod::Plate));
        depth_methods
    }
}

impl Services for System {
    fn list_sources(&mut self) -> Vec<Choice> {
        let mut sources = list_cameras();
        let is_other = |choice: &&Choice| {
            let name = choice.name.as_str();
            name != demo::NAME && !sources.iter().any(|camera| camera.name == name) && is_there(name, &sources)
        };
        let opened: Vec<Choice> = self.opened.iter().filter(is_other).cloned().collect();
        sources.extend(opened);
        sources.push(Choice { name: demo::NAME.into(), label: "Demonstration".into() });
        sources
    }

    fn list_virtual_cameras(&mut self) -> Vec<Choice> {
        devices::list_virtual_cameras()
    }

    fn check_depth_method(&mut self, name: &str, depth_method: DepthMethod) -> Result<(), String> {
        let installed = source::installed_networks();
        let lacks = match depth_method {
            DepthMethod::Person => installed.matte.is_none(),
            DepthMethod::PersonAndMonoDepth => installed.matte.is_none() || installed.mono.is_none(),
            DepthMethod::Measured | DepthMethod::Stereo | DepthMethod::Plate => false,
        };
        if lacks {
            return Err(NO_NETWORK.to_owned());
        }
        // A recording can be opened twice to check it; a camera is busy.
        let is_file = SourceName::from_str(name)
            .is_ok_and(|name| matches!(name.kind(), Kind::Recording | Kind::Video | Kind::Photo));
        if is_file { self.open_source(name, Some(depth_method)).map(drop) } else { Ok(()) }
    }

    fn open(&mut self, name: &str, depth_method: Option<DepthMethod>) -> Result<OpenedSource, String> {
        let mut notes = Vec::new();
        let found = if name.is_empty() { first_camera() } else { Some(name.to_owned()) };
        self.is_fallback = found.is_none();
        let name = found.unwrap_or_else(|| {
            notes.push(NO_CAMERA.to_owned());
            demo::NAME.to_owned()
        });
        let (source, source_name) = self.open_source(&name, depth_method)?;
        // Automatically used networks are not announced, because the user sees their effect.
        let is_asked = matches!(self.options.depth_choice, DepthChoice::SingleCamera(_)) || depth_method.is_some();
        notes.extend(source.networks.iter().filter(|_| is_asked).map(|networks| format!("Depth by {networks}.")));
        for by in source.networks.iter().chain(&source.persons) {
            tracing::info!("{name}: persons by {by}");
        }
        if source_name.kind() == Kind::Synthetic {
            notes.push(RENDERED.to_owned());
        }
        let is_declined = self.options.depth_choice == DepthChoice::None && depth_method.is_none();
        if is_declined && source.has_depth() {
            notes.push(DECLINED.to_owned());
        }
        let has_depth = source.has_depth() && !is_declined;
        self.control_values.clear();
        notes.extend(source_name.describe_photo(&source).into_iter().chain(source.findings.notes.iter().cloned()));
        self.opened.retain(|choice| choice.name != name);
        self.opened.insert(0, Choice::from_name(&name));
        self.camera = devices::controllable_camera(&source_name);
        let controls = self.camera.as_deref().map(devices::list_controls).unwrap_or_default();
        self.depth_method = depth_method;
        let camera = self.camera_properties(&source, &source_name);
        let mut depth_methods = self.list_depth_methods(&source, &source_name, depth_method);
        let networks = match &self.options.depth_choice {
            DepthChoice::SingleCamera(chosen) if chosen.has_networks() => chosen.clone(),
            _ => source::installed_networks(),
        };
        let usual = || DepthMethod::from_origin(source.depth_from, &networks, source.guide.is_some());
        let depth_method = depth_method.or_else(usual).filter(|_| has_depth);
        depth_methods.extend(depth_method.filter(|depth_method| !depth_methods.contains(depth_method)));
        Ok(OpenedSource { name, source, has_depth, depth_methods, depth_method, notes, controls, camera })
    }

    fn have_devices_changed(&mut self) -> bool {
        self.devices.has_changed()
    }

    fn awaited_camera(&mut self) -> Option<String> {
        if self.is_fallback { first_camera() } else { None }
    }

    fn check_source_name(&self, name: &str) -> Result<(), String> {
        let source_name = SourceName::from_str(name).map_err(|error| error.with_prefix(name).to_string())?;
        match &source_name {
            SourceName::Folder(folder) => {
                let reading = Reading { keep_going: true, ..self.options.recording_options() };
                Recording::open(folder, &reading).map(drop).map_err(|error| error.to_string())
            }
            _ => Ok(()),
        }
    }

    fn create_file_chooser(&self, kind: PathKind) -> FileChooser {
        Box::new(move || dialog::choose_path(kind))
    }

    fn set_mode(&mut self, name: &str, (width, height): (u32, u32), fps: f64) {
        self.chosen_mode = Some((name.to_owned(), Size { width, height }, fps));
    }

    fn set_control(&mut self, control: &str, value: i64) -> Result<Vec<CameraControl>, String> {
        let Some(camera) = &self.camera else { return Err("this source has no controls".to_owned()) };
        let controls = devices::set_control(camera, control, value)?;
        self.control_values.insert(control.to_owned(), value);
        Ok(controls)
    }

    fn create_executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        self.executors.create_blur(settings, size).map_err(|error| error.to_string())
    }

    fn open_output(&mut self, name: &str, options: sink::Options) -> Result<Box<dyn Sink>, String> {
        let (force, out_size, threads) = (self.force, self.out_size, self.options.computing.threads);
        let target = Target::from_str(name).map_err(|error| error.to_string())?;
        target.open(&sink::Options { force, out_size, threads, ..options }).map_err(|error| error.to_string())
    }

    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String {
        let mut switches = match outputs {
            [] => switches.to_vec(),
            // A command that writes to outputs has no window options.
            _ => Vec::new(),
        };
        if !self.control_values.is_empty() {
            let controls: Vec<String> =
                self.control_values.iter().map(|(name, value)| format!("{name}={value}")).collect();
            switches.push(("control".into(), controls.join(",")));
        }
        if let Some((_, size, fps)) = self.chosen_mode.as_ref().filter(|(camera, ..)| camera == source) {
            switches.push(("size".into(), format!("{}x{}", size.width, size.height)));
            switches.push(("fps".into(), format!("{}", (fps * 1000.0).round() / 1000.0)));
        }
        if let Some(depth_method) = self.depth_method {
            switches.push(("depth".into(), depth_method.depth_option()));
        }
        self.settings.format_command(look, source, outputs, &switches)
    }

    fn settings(&mut self) -> &mut dyn SettingsStore {
        &mut *self.settings
    }
}
