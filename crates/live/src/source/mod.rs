//! Sources by name: a camera or two, a recording, a photo, the demonstration or the synthetic scene, with their depth.
//!
//! The command line, the window and other programs all open them like this:
//!
//! ```no_run
//! use bokehcam::look::Look;
//! use bokehcam_live::source::{Options, Source, SourceName};
//!
//! let name: SourceName = "recordings/portrait".parse()?;
//! let source = Source::open(&name, &Options::default(), Some(&Look::default()))?;
//! println!("{}: {:?} pixels", source.camera.info().name, source.camera.info().size);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod calib;
#[cfg_attr(not(feature = "camera"), path = "no_cameras.rs")]
mod cameras;
mod containers;
pub mod devices;
mod error;
mod external_depth;
#[cfg_attr(not(feature = "networks"), path = "no_networks.rs")]
pub mod installed;
mod look_files;
pub mod modes;
mod name;
mod networks;
mod opened;
pub mod options;
pub mod orientation;
pub mod photo;
#[cfg_attr(not(feature = "pipewire"), path = "no_pipewire_cameras.rs")]
mod pipewire_cameras;
pub mod registration;
pub mod single_camera;
mod stereo;
mod suggestion;
pub mod video;

pub use error::SourceError;
pub use look_files::register_look_files;
pub use name::{Kind, SourceName};
pub use networks::{find_person, installed_networks};
use opened::Opened;
pub use options::{DepthChoice, Frames, NetworkFile, Orientation, PlateFile, SingleCameraDepth, Size};
use orientation::SourceTransform;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::capture::side_by_side::SideBySide;
use crate::capture::{Camera, CaptureError, FrameData};
use crate::pipeline::{BlurSetup, Destination, Run};
use bokehcam::clock::Clock;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::DepthSource;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::plate::Guide;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{Look, LookFacts, Metres};
use bokehcam::optics::StereoRig;
use bokehcam_media::recording::{DepthUnit, Options as Reading, Recording, Scratch};

/// The origin of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthOrigin {
    /// No depth, or it is not used.
    #[default]
    Nothing,
    /// Values in units that need a scale, from 16-bit pictures and depth cameras.
    Units,
    /// Metres, or disparities that are converted to metres.
    Metres,
    /// Relative inverse depth from grey pictures.
    Relative,
    /// Stereo matching.
    Stereo,
    /// Networks; the distances are relative.
    Networks,
    /// Difference from a clean plate (a picture of the background): foreground or background.
    Plate,
}

impl DepthOrigin {
    /// Returns whether distances are relative, not in metres.
    pub fn is_relative(self) -> bool {
        matches!(self, Self::Relative | Self::Networks | Self::Plate)
    }

    /// Returns what its distances mean.
    pub fn metres(self) -> Metres {
        if self.is_relative() { Metres::Missing } else { Metres::Known }
    }

    /// Returns whether another origin may replace it: there is no depth, or it is inferred from the pictures alone.
    pub fn is_replaceable(self) -> bool {
        matches!(self, Self::Nothing | Self::Networks | Self::Plate)
    }
}

/// An opened source.
pub struct Source {
    /// The source of frames.
    pub camera: Box<dyn Camera>,
    /// The source of depth, unless the camera brings it.
    pub depth: Option<Box<dyn DepthSource>>,
    /// The stereo geometry, if depth is matched.
    pub rig: Option<StereoRig>,
    /// The origin of depth.
    pub depth_from: DepthOrigin,
    /// Describes the networks that infer depth, if any.
    pub networks: Option<String>,
    /// Describes the network that detects the person in focus, if depth is measured.
    pub persons: Option<String>,
    /// The progress of the clean plate, if depth is made from one.
    pub guide: Option<Arc<Guide>>,
    /// The first map of recorded depth, if the look uses depth.
    pub first_depth: Option<DepthMap>,
    /// What its files say besides.
    pub findings: Findings,
}

/// What the files of a source say besides pictures and depth.
#[derive(Debug, Default)]
pub struct Findings {
    /// What was assumed about them, a line each.
    pub notes: Vec<String>,
    /// A short description of where the depth of a photo comes from.
    pub depth_by: Option<String>,
    /// The focus that a photo was taken with, which replaces `auto`.
    pub focus: Option<FocusRule>,
    /// The sharp original inside a photo, which is then the picture.
    pub original: Option<Arc<ColorImage>>,
    /// Whether the depth of a photo fits it already.
    pub is_fitting: bool,
    /// The file names of a recording's pictures, without extension.
    pub picture_stems: Vec<String>,
}

/// Options for opening a source.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The range of frames.
    pub frames: Frames,
    /// The encoding of depth pictures.
    pub depth: options::Depth,
    /// Layout and geometry of a stereo source.
    pub stereo: options::Stereo,
    /// The options of networks.
    pub networks: options::Networks,
    /// The origin of depth.
    pub depth_choice: DepthChoice,
    /// The hardware for stereo matching.
    pub computing: ComputeOptions,
    /// Whether faulty lines in a recording's lists become frames that fail, instead of an error on opening.
    pub keep_going: bool,
    /// Whether the program acts as a filter of a PipeWire camera: pictures go only to the clients of that camera, and
    /// only while there are any.
    pub filters: bool,
}

/// The request to [`Source::open`].
struct OpenRequest<'a> {
    options: &'a Options,
    /// The look that the depth is for; `None` if depth is wanted as such, for example to record it.
    look: Option<&'a Look>,
    /// The picture of a photo, if it is decoded already.
    photo: Option<Arc<ColorImage>>,
}

/// Whether stereo depth is refined by default: refinement does not model the errors of stereo matching, but makes its
/// depth steadier.
const REFINES_STEREO: bool = true;

impl Source {
    /// Opens a source. `look` decides whether depth is needed; without one, any available depth is opened.
    ///
    /// # Errors
    /// The source cannot be read, has no frame between `--start` and `--end`, or an option does not apply to it.
    pub fn open(name: &SourceName, options: &Options, look: Option<&Look>) -> Result<Self, SourceError> {
        Self::open_requested(name, &OpenRequest { options, look, photo: None })
    }

    fn open_requested(name: &SourceName, request: &OpenRequest) -> Result<Self, SourceError> {
        let source = Self::open_with_own_depth(name, request)?;
        // Before networks and plates, which then see the pictures as people do.
        let transform = SourceTransform::new(request.options.frames.orientation, &source);
        let source = transform.apply_to_source(source)?;
        let source = networks::add_network_depth(source, request);
        let source = external_depth::add_external_depth(source, (name, &transform), request, &Clock::system())?;
        Ok(networks::add_person_detection(source, request))
    }

    /// Creates a source from a camera that the caller has opened; `depth` provides depth in metres for its frames.
    pub fn from_camera(camera: Box<dyn Camera>, depth: Option<Box<dyn DepthSource>>) -> Self {
        let has_depth = depth.is_some() || camera.info().frame_data == FrameData::Depth;
        let depth_from = if has_depth { DepthOrigin::Metres } else { DepthOrigin::Nothing };
        Self {
            camera,
            depth,
            rig: None,
            depth_from,
            networks: None,
            persons: None,
            guide: None,
            first_depth: None,
            findings: Findings::default(),
        }
    }

    /// Opens a source with its own depth: recorded, exact, or matched. Depth from another device or recording is added
    /// by [`external_depth::add_external_depth`].
    fn open_with_own_depth(name: &SourceName, request: &OpenRequest) -> Result<Self, SourceError> {
        let Options { frames, stereo, depth_choice, computing, .. } = request.options;
        name.check_frames(frames)?;
        request.check_effect()?;
        if request.options.depth.depth_unit == Some(DepthUnit::Disparity)
            && !matches!(name, SourceName::Photo(_))
            && depth_choice.map_folder().is_none()
        {
            let what = "--depth-unit disparity is only for the depth map of a photo, and folders of depth maps";
            return Err(SourceError::Usage(what.to_owned()));
        }
        let mut source = Opened::open(name, request)?;
        if stereo.side_by_side {
            let usage = |error: CaptureError| SourceError::Usage(error.to_string());
            source.camera = Box::new(SideBySide::new(source.camera).map_err(usage)?);
        }
        let info = source.camera.info();
        let depth_from = if info.frame_data == FrameData::Depth { DepthOrigin::Metres } else { source.depth_from };
        if stereo.side_by_side
            && source.depth.is_some()
            && matches!(depth_choice, DepthChoice::Auto | DepthChoice::Recorded)
        {
            return Err(SourceError::Usage(format!(
                "--side-by-side: the depth of {} belongs to whole pictures, not to their left halves; add --depth \
                 stereo or --depth none",
                info.name
            )));
        }
        if info.frame_data != FrameData::RightCamera {
            if *depth_choice == DepthChoice::Stereo {
                return Err(SourceError::Usage(format!(
                    "--depth stereo: {} has one camera; use two cameras LEFT,RIGHT, a recording of two cameras, or \
                     --side-by-side",
                    info.name
                )));
            }
            stereo.reject_options()?;
        } else if request.uses_stereo(source.depth.is_some()) {
            let depth = stereo::open_stereo(&info, &source.pair, source.disparities, stereo, computing)?;
            let rig = *depth.rig();
            let depth: Option<Box<dyn DepthSource>> = Some(Box::new(depth));
            let depth_from = DepthOrigin::Stereo;
            return Ok(Self { rig: Some(rig), depth_from, ..Self::from_camera(source.camera, depth) });
        }
        let Opened { camera, depth, first_depth, findings, .. } = source;
        Ok(Self { depth_from, first_depth, findings, ..Self::from_camera(camera, depth) })
    }

    /// Returns whether its frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some() || self.camera.info().frame_data == FrameData::Depth
    }

    /// Returns what its distances mean.
    pub fn metres(&self) -> Metres {
        let is_assumed = self.rig.is_some_and(|rig| !rig.metric);
        if is_assumed { Metres::Assumed } else { self.depth_from.metres() }
    }

    /// Returns what this source, which was opened with `options`, allows a look. Nothing is known about outputs.
    ///
    /// # Errors
    /// The options want depth that the source lacks.
    pub fn look_facts(&self, options: &Options) -> Result<LookFacts, SourceError> {
        let mut facts = options.depth_choice.look_facts(self.has_depth(), self.metres())?;
        facts.size = self.camera.info().size;
        Ok(facts)
    }

    /// Returns whether its depth is measured (not computed exactly), so that refinement improves it. The depth of a photo
    /// is that only if it does not fit the photo.
    pub fn is_measured(&self) -> bool {
        let is_made = matches!(self.depth_from, DepthOrigin::Networks | DepthOrigin::Plate);
        let is_exact = is_made || self.findings.is_fitting;
        self.depth.is_some() && !is_exact && (self.rig.is_none() || REFINES_STEREO)
    }

    /// Creates a run of its frames ([`Run::with_blur`]) with this blur into `sink`, as fast as possible. `stop` ends the run.
    pub fn into_run<'a>(self, blurring: BlurSetup, sink: Destination<'a>, stop: &'a AtomicBool) -> Run<'a> {
        let measured = self.is_measured();
        Run { measured, ..Run::with_blur(self.camera, self.depth, blurring, sink, stop) }
    }
}

impl Options {
    /// Returns the options for reading a recording.
    pub fn recording_options(&self) -> Reading {
        let Self { frames, depth, keep_going, .. } = self;
        Reading {
            depth_scale: depth.depth_scale,
            depth_unit: depth.depth_unit.unwrap_or(DepthUnit::Metres),
            depth_invert: depth.depth_invert,
            depth_invalid: Some(depth.depth_invalid),
            depth_fit: depth.depth_fit,
            period_ns: frames.fps.map(|fps| (1e9 / fps) as u64),
            size: frames.size.map(|size| (size.width, size.height)),
            topics: frames.topic.clone(),
            follow_links: frames.follow_links,
            keep_going: *keep_going,
            ..Reading::default()
        }
    }
}

impl OpenRequest<'_> {
    /// Returns whether the effect uses depth.
    pub fn uses_depth(&self) -> bool {
        self.look.is_none_or(|look| look.effect.follows_depth())
    }

    /// Reads the first depth map of a recording, to inspect its values; `None` if the look does not use depth. A faulty
    /// map is not an error here: it is reported when the frame is read.
    pub fn read_first_depth(&self, recording: &Recording) -> Option<DepthMap> {
        let mut map = DepthMap::default();
        let is_used = self.look.is_some_and(|look| look.effect.follows_depth()) && recording.has_depth();
        let read = is_used.then(|| recording.read_depth(0, &mut Scratch::default(), &mut map))?;
        read.ok().map(|()| map)
    }

    fn check_effect(&self) -> Result<(), SourceError> {
        if self.options.depth_choice == DepthChoice::Stereo && !self.uses_depth() {
            return SourceError::usage_error(
                "--depth stereo: only --effect dof uses depth; leave --depth or --effect out",
            );
        }
        Ok(())
    }

    /// Returns whether depth comes from stereo matching, if the source is stereo; `has_depth` says whether it has other
    /// depth, which `auto` prefers.
    fn uses_stereo(&self, has_depth: bool) -> bool {
        match self.options.depth_choice {
            DepthChoice::Stereo => true,
            DepthChoice::Auto => self.uses_depth() && !has_depth,
            _ => false,
        }
    }
}
