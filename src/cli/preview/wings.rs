//! What the window asks for by name, got as the other commands get it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::super::config::Executor;
use super::super::layers::Given;
use super::super::options::{self, Streaming};
use super::super::settings::SettingsFile;
use super::super::source::{Source, SourceName, Wanted};
use super::super::unused::From;
use super::super::{command_line, depth, presets, print, save};
use crate::bokeh::{self, Backend, Bokeh};
use crate::clock::Clock;
use crate::compute::device::Device;
use crate::look::presets::Preset;
use crate::look::settings::Value;
use crate::look::{Effect, Look, Patch};
use crate::preview::backstage::{Backstage, Choice, Control, Opened, Switch};
use crate::sink::{self, Sink, Target};

/// What is said when there is nothing to look at but our own scene.
const NO_CAMERA: &str = "No camera was found, so this is a scene of our own. `bokehcam devices` lists cameras, \
                         `bokehcam doctor` says what is missing.";
/// What is called so needs no camera.
const SYNTHETIC: &str = "synthetic";

pub(super) struct Wings {
    parts: Streaming,
    /// The look at the start.
    look: Look,
    executor: Executor,
    /// The GPU that blurs and draws, where one does.
    device: Option<Arc<Device>>,
    /// The settings file, where one was chosen.
    chosen: Option<PathBuf>,
    /// What was said of other things than the look.
    given: Vec<(String, String)>,
    /// Settings of the look that the environment or a file has another value for than is usual.
    behind: Vec<String>,
    /// The settings file, as it was read last.
    file: SettingsFile,
    /// The source that was asked for at the start.
    first: Option<Choice>,
    /// Controls that were set, by name.
    set: BTreeMap<String, i64>,
    /// The camera that was opened last, where its controls can be set.
    camera: Option<String>,
}

impl Wings {
    /// Opens what is asked for as `parts` say.
    pub fn new(
        (parts, look): (&Streaming, &Look),
        executor: &Executor,
        device: Option<Arc<Device>>,
        chosen: Option<PathBuf>,
        Given { switches: given, behind, .. }: Given,
    ) -> Self {
        Self {
            parts: parts.clone(),
            look: look.clone(),
            executor: executor.clone(),
            device,
            chosen,
            given,
            behind,
            file: SettingsFile::default(),
            first: None,
            set: BTreeMap::new(),
            camera: None,
        }
    }

    fn open_source(&self, name: &str) -> Result<(Source, SourceName), String> {
        let source_name = SourceName::from_str(name).map_err(|error| format!("{name}: {error}"))?;
        let Streaming { frames, blur, depth, stereo, stream, .. } = &self.parts;
        // Of depth the window may make use later.
        let look = Look { effect: Effect::Auto, ..self.look.clone() };
        let frames =
            options::Source { repeat: frames.repeat && source_name.kind() == From::Recording, ..frames.clone() };
        let wanted = Wanted {
            frames: &frames,
            depth,
            stereo,
            from: &blur.depth,
            look: Some(&look),
            executor: &self.executor,
            keep_going: stream.keep_going,
            cycle: true,
        };
        let source = Source::open(&source_name, &wanted).map_err(|error| error.to_string())?;
        let source = depth::beside(source, &wanted, &Clock::system());
        Ok((source.map_err(|error| error.to_string())?, source_name))
    }
}

impl Backstage for Wings {
    fn sources(&mut self) -> Vec<Choice> {
        self.file = SettingsFile::load(self.chosen.as_deref()).unwrap_or_else(|error| {
            tracing::warn!("{error}");
            SettingsFile::default()
        });
        let mut sources = devices::cameras();
        let is_other = |choice: &&Choice| choice.name != SYNTHETIC && !sources.contains(choice);
        let first = self.first.iter().find(is_other).cloned();
        sources.extend(first);
        sources.push(Choice { name: SYNTHETIC.into(), label: "Synthetic scene".into() });
        sources
    }

    fn virtual_cameras(&mut self) -> Vec<Choice> {
        devices::virtual_cameras()
    }

    fn open(&mut self, name: &str) -> Result<Opened, String> {
        let mut notes = Vec::new();
        let first = devices::cameras().into_iter().next();
        let name = match name {
            "" => first.map_or_else(
                || {
                    notes.push(NO_CAMERA.to_owned());
                    SYNTHETIC.to_owned()
                },
                |camera| camera.name,
            ),
            name => name.to_owned(),
        };
        let (source, source_name) = self.open_source(&name)?;
        self.set.clear();
        self.first.get_or_insert_with(|| Choice { name: name.clone(), label: name.clone() });
        self.camera = devices::camera_of(&source_name);
        let controls = self.camera.as_deref().map(devices::controls).unwrap_or_default();
        let (has_depth, measured) = (source.has_depth(), source.is_measured());
        Ok(Opened { name, camera: source.camera, depth: source.depth, has_depth, measured, notes, controls })
    }

    fn set_control(&mut self, name: &str, value: i64) -> Result<Vec<Control>, String> {
        match &self.camera {
            Some(camera) => {
                let controls = devices::set_control(camera, name, value)?;
                self.set.insert(name.to_owned(), value);
                Ok(controls)
            }
            None => Err("this source has no controls".to_owned()),
        }
    }

    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String> {
        let threads = self.executor.threads;
        // One that failed stays so.
        let made = match self.device.as_ref().filter(|device| device.check().is_ok()) {
            Some(device) => bokeh::create_on(settings, size, Arc::clone(device), threads),
            None => bokeh::create(settings, size, Backend::Cpu, None, threads),
        };
        made.map_err(|error| error.to_string())
    }

    fn output(
        &mut self,
        name: &str,
        size: (u32, u32),
        period_ns: u64,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Sink>, String> {
        let out_size = self.parts.stream.out_size.map(|size| (size.width, size.height));
        let force = self.parts.output.force;
        let stop = Arc::clone(stop);
        let options = sink::Options { force, out_size, stop, ..sink::Options::new(size, period_ns) };
        let target = Target::from_str(name).map_err(|error| error.to_string())?;
        target.open(&options).map_err(|error| error.to_string())
    }

    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String {
        let mut switches = match outputs {
            [] => switches.to_vec(),
            // They are the window's own.
            _ => Vec::new(),
        };
        let is_new = |(name, _): &&Switch| !switches.iter().any(|(other, _)| other == name);
        let given: Vec<Switch> = self.given.iter().filter(is_new).cloned().collect();
        switches.extend(given);
        if !self.set.is_empty() {
            let controls: Vec<String> = self.set.iter().map(|(name, value)| format!("{name}={value}")).collect();
            switches.push(("control".into(), controls.join(",")));
        }
        let unusual = Patch::of(look).beside(&Patch::of(&Look::default())).values();
        let says = |value: &Value| unusual.contains(value) || self.behind.iter().any(|name| name == value.0);
        let flags: Vec<Value> = Patch::of(look).values().into_iter().filter(says).collect();
        let command = command_line::equivalent(source, outputs, &flags, &switches);
        // Whoever reads it may be gone.
        let _ = print(format!("{command}\n").as_bytes());
        command
    }

    fn presets(&mut self) -> Vec<Preset> {
        self.file.all_presets()
    }

    fn save_preset(&mut self, name: &str, look: &Look) -> Result<(), String> {
        let saved = save::file_to_save(self.chosen.as_deref());
        let saved = saved.and_then(|file| presets::save(&file, name, &Patch::of(look).values()));
        saved.map_err(|error| error.to_string())?;
        self.sources();
        Ok(())
    }
}

#[cfg(feature = "camera")]
mod devices {
    use super::super::super::source::SourceName;
    use super::{Choice, Control};
    use crate::v4l2::live::knobs::{self, Knob};
    use crate::v4l2::node::{self, Kind, Node};

    fn choices(kind: Kind) -> Vec<Choice> {
        let of_kind = |node: &Node| node.kind == kind && (kind == Kind::Virtual || node.captures);
        let choice = |node: Node| {
            let name = node.path.display().to_string();
            let label = if node.card.is_empty() { name.clone() } else { format!("{} ({name})", node.card) };
            Choice { name, label }
        };
        node::nodes().into_iter().filter(of_kind).map(choice).collect()
    }

    pub fn cameras() -> Vec<Choice> {
        choices(Kind::Capture)
    }

    pub fn virtual_cameras() -> Vec<Choice> {
        choices(Kind::Virtual)
    }

    /// One camera has controls of its own; two have to see alike.
    pub fn camera_of(source: &SourceName) -> Option<String> {
        match source {
            SourceName::Camera(camera) => Some(camera.node().display().to_string()),
            _ => None,
        }
    }

    pub fn controls(camera: &str) -> Vec<Control> {
        let listed = knobs::list(camera).unwrap_or_else(|error| {
            tracing::info!("{error}");
            Vec::new()
        });
        listed.into_iter().map(control).collect()
    }

    pub fn set_control(camera: &str, name: &str, value: i64) -> Result<Vec<Control>, String> {
        let turned = knobs::turn(camera, name, value).map_err(|error| error.to_string())?;
        Ok(turned.into_iter().map(control).collect())
    }

    fn control(knob: Knob) -> Control {
        let Knob { name, value, range, menu, switch, active } = knob;
        Control { name, value, range, menu, switch, active }
    }
}

#[cfg(not(feature = "camera"))]
mod devices {
    use super::super::super::source::SourceName;
    use super::{Choice, Control};

    pub fn cameras() -> Vec<Choice> {
        Vec::new()
    }

    pub fn virtual_cameras() -> Vec<Choice> {
        Vec::new()
    }

    pub fn camera_of(_: &SourceName) -> Option<String> {
        None
    }

    pub fn controls(_: &str) -> Vec<Control> {
        Vec::new()
    }

    pub fn set_control(camera: &str, _: &str, _: i64) -> Result<Vec<Control>, String> {
        Err(format!("{camera}: this build leaves cameras out (feature `camera`)"))
    }
}
