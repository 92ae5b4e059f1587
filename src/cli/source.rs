//! From SOURCE to a camera and its depth.

use std::sync::Arc;

use super::config::Executor;
use super::error::CliError;
#[cfg(feature = "camera")]
use super::source_name::Named;
pub use super::source_name::SourceName;
use super::stereo;
use super::unused::DepthFrom;
use super::values::DepthChoice;
use super::{defaults, options};
use crate::capture::replay::{Part, Replay};
use crate::capture::side_by_side::SideBySide;
use crate::capture::synthetic::{Format, Synthetic};
#[cfg(feature = "camera")]
use crate::capture::two_eyes::TwoEyes;
#[cfg(feature = "camera")]
use crate::capture::v4l2::V4l2Camera;
use crate::capture::{Brings, Camera, CaptureError};
#[cfg(feature = "camera")]
use crate::clock::Clock;
use crate::compute::team::cores;
use crate::depth::DepthSource;
use crate::depth::focus::FocusRule;
use crate::depth::recorded::Recorded;
use crate::frame::DepthMap;
use crate::look::Look;
use crate::optics::StereoRig;
use crate::recording::{Options, Pair, Recording, Scratch};
use crate::scene::Scene;
#[cfg(feature = "camera")]
use crate::v4l2::{layout::Content, live::Wish};

/// An opened source.
pub struct Source {
    /// Gives the frames.
    pub camera: Box<dyn Camera>,
    /// Gives their depth, where the camera does not.
    pub depth: Option<Box<dyn DepthSource>>,
    /// The eyes that depth comes from, where it comes from two.
    pub rig: Option<StereoRig>,
    /// What depth comes from.
    pub depth_from: DepthFrom,
    /// The first map of recorded depth, where a distance was given that it can be compared with.
    pub first_depth: Option<DepthMap>,
}

/// How a source is wanted.
pub struct Wanted<'a> {
    /// Which frames.
    pub frames: &'a options::Source,
    /// How depth pictures are read.
    pub depth: &'a options::Depth,
    /// What is said of its two eyes.
    pub stereo: &'a options::Stereo,
    /// Where depth comes from.
    pub from: &'a DepthChoice,
    /// What its depth is for; `None` for itself.
    pub look: Option<&'a Look>,
    /// What matches its two eyes.
    pub executor: &'a Executor,
    /// Faulty lines of a recording's lists become frames that fail.
    pub keep_going: bool,
    /// The synthetic scene repeats itself, so that it can be played smoothly.
    pub cycle: bool,
}

/// Refinement of depth from two eyes, unless it is chosen: it knows nothing of how matching errs, but steadies it.
const REFINES_STEREO: bool = true;

impl Source {
    /// Opens a source.
    ///
    /// # Errors
    /// It cannot be read, it has no frame between `--start` and `--end`, or an option does not apply to it.
    pub fn open(name: &SourceName, wanted: &Wanted) -> Result<Self, CliError> {
        let Wanted { frames, stereo, .. } = wanted;
        name.check(frames)?;
        wanted.check_effect()?;
        let mut source = Opened::open(name, wanted)?;
        if stereo.side_by_side {
            let usage = |error: CaptureError| CliError::Usage(error.to_string());
            source.camera = Box::new(SideBySide::new(source.camera).map_err(usage)?);
        }
        let info = source.camera.info();
        let depth_from = if info.brings == Brings::Depth { DepthFrom::Metres } else { source.depth_from };
        if stereo.side_by_side
            && source.depth.is_some()
            && matches!(wanted.from, DepthChoice::Auto | DepthChoice::Recorded)
        {
            return Err(CliError::Usage(format!(
                "--side-by-side: the depth of {} is that of whole pictures, not of their left halves; add --depth stereo \
                 or --depth none",
                info.name
            )));
        }
        if info.brings != Brings::RightEye {
            if *wanted.from == DepthChoice::Stereo {
                return Err(CliError::Usage(format!(
                    "--depth stereo: {} has one eye; use two cameras LEFT,RIGHT, a recording with both eyes, or \
                     --side-by-side",
                    info.name
                )));
            }
            stereo.refuse()?;
        } else if wanted.matches(source.depth.is_some()) {
            let depth = stereo::open(&info, &source.pair, source.disparities, stereo, wanted.executor)?;
            let rig = *depth.rig();
            if let Some(look) = wanted.look {
                stereo::check_focus(&rig, look)?;
            }
            let depth: Option<Box<dyn DepthSource>> = Some(Box::new(depth));
            let depth_from = DepthFrom::Eyes;
            return Ok(Self { camera: source.camera, depth, rig: Some(rig), depth_from, first_depth: None });
        }
        let Opened { camera, depth, first_depth, .. } = source;
        Ok(Self { camera, depth, rig: None, depth_from, first_depth })
    }

    /// Whether its frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some() || self.camera.info().brings == Brings::Depth
    }

    /// Whether its depth was measured, so that refining it makes it better.
    pub fn is_measured(&self) -> bool {
        self.depth.is_some() && (self.rig.is_none() || REFINES_STEREO)
    }
}

impl Wanted<'_> {
    /// Whether the effect is one that uses depth.
    pub fn uses_depth(&self) -> bool {
        self.look.is_none_or(|look| look.effect.follows_depth())
    }

    /// The first depth map of a recording, where the focus is in metres. A faulty one is told in its turn.
    pub fn first_depth(&self, recording: &Recording) -> Option<DepthMap> {
        let is_compared = self.look.is_some_and(|look| matches!(look.focus, FocusRule::Metres(_)));
        let mut map = DepthMap::default();
        let is_compared = is_compared && recording.has_depth();
        let read = is_compared.then(|| recording.read_depth(0, &mut Scratch::default(), &mut map))?;
        read.ok().map(|()| map)
    }

    fn check_effect(&self) -> Result<(), CliError> {
        if *self.from == DepthChoice::Stereo && !self.uses_depth() {
            let what = "--depth stereo: only --effect dof uses depth; leave one of them out";
            return Err(CliError::Usage(what.to_string()));
        }
        Ok(())
    }

    /// Whether two eyes are matched, where there are two, and depth of another kind or not.
    fn matches(&self, has_depth: bool) -> bool {
        match self.from {
            DepthChoice::Stereo => true,
            DepthChoice::Auto => self.uses_depth() && !has_depth,
            _ => false,
        }
    }
}

/// A source before its two eyes, if it has two, are looked at.
struct Opened {
    camera: Box<dyn Camera>,
    depth: Option<Box<dyn DepthSource>>,
    depth_from: DepthFrom,
    first_depth: Option<DepthMap>,
    /// What it says of its two eyes.
    pair: Pair,
    /// The disparities that occur in it.
    disparities: Option<u32>,
}

impl Opened {
    fn open(name: &SourceName, wanted: &Wanted) -> Result<Self, CliError> {
        let Wanted { frames, depth, .. } = *wanted;
        let of = |camera| Self {
            camera,
            depth: None,
            depth_from: DepthFrom::Nothing,
            first_depth: None,
            pair: Pair::Unstated,
            disparities: None,
        };
        match name {
            SourceName::Synthetic => {
                let size = frames.size.unwrap_or(defaults::SIZE);
                let camera = Synthetic::new(Format {
                    size: (size.width, size.height),
                    fps: frames.fps.unwrap_or(defaults::FPS),
                    frames: frames.frames,
                    threads: cores(),
                    cycle: wanted
                        .cycle
                        .then(|| Scene::portrait().period_s() * frames.fps.unwrap_or(defaults::FPS))
                        .map(|n| n as u64),
                })?;
                Ok(of(Box::new(camera)))
            }
            SourceName::Folder(folder) => {
                let options = Options {
                    depth_scale: depth.file_scale(),
                    depth_invalid: Some(depth.depth_invalid),
                    keep_going: wanted.keep_going,
                    ..Options::default()
                };
                let recording = Arc::new(Recording::open(folder, &options)?);
                let name = folder.display().to_string();
                let part = Part {
                    start_s: frames.start.unwrap_or(0.0),
                    end_s: frames.end,
                    looped: frames.repeat,
                    frames: frames.frames,
                };
                let mut camera = Replay::new(Arc::clone(&recording), &name, &part)?;
                let pair = recording.pair().cloned();
                if pair.is_some() && wanted.matches(recording.has_depth()) {
                    camera = camera.with_right_eye();
                }
                let disparities = recording.disparities();
                let depth_from = depth_of(&recording);
                let first_depth = wanted.first_depth(&recording);
                let depth = match recording.has_depth() {
                    true => Some(Box::new(Recorded::new(recording, &name)?) as Box<dyn DepthSource>),
                    false => None,
                };
                Ok(Self {
                    depth,
                    depth_from,
                    first_depth,
                    pair: pair.unwrap_or(Pair::Unstated),
                    disparities,
                    ..of(Box::new(camera))
                })
            }
            #[cfg(feature = "camera")]
            SourceName::Camera(camera) => {
                let camera = V4l2Camera::open(&camera.name, wish(frames), frames.control.clone(), frames.frames)?;
                Ok(of(Box::new(camera)))
            }
            #[cfg(feature = "camera")]
            SourceName::Cameras([left, right]) => {
                let open = |eye: &Named| V4l2Camera::open(&eye.name, wish(frames), frames.control.clone(), None);
                let eyes = TwoEyes::new(open(left)?, open(right)?, Clock::system(), frames.frames)?;
                Ok(of(Box::new(eyes)))
            }
        }
    }
}

/// What the depth of a recording is.
pub fn depth_of(recording: &Recording) -> DepthFrom {
    match recording.has_depth() {
        false => DepthFrom::Nothing,
        true if recording.has_depth_in_units() => DepthFrom::Units,
        true => DepthFrom::Metres,
    }
}

#[cfg(feature = "camera")]
fn wish(frames: &options::Source) -> Wish {
    Wish {
        content: Content::Color,
        size_px: frames.size.map(|size| (size.width, size.height)),
        fps: frames.fps,
        fourcc: frames.format,
    }
}
