//! Sources by name: a camera, two of them, a recording, a photo, the demonstration or the synthetic scene, with the depth
//! that goes with it.
//!
//! The command line, the window and other programs open them in one way:
//!
//! ```no_run
//! use bokehcam::look::Look;
//! use bokehcam::source::{Options, Source, SourceName};
//!
//! let name: SourceName = "recordings/portrait".parse()?;
//! let source = Source::open(&name, &Options::default(), Some(&Look::default()))?;
//! println!("{}: {:?} pixels", source.camera.info().name, source.camera.info().size);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod calib;
pub mod devices;
mod elsewhere;
mod error;
mod eyes;
pub mod modes;
mod name;
mod near;
mod networks;
pub mod one_camera;
mod opened;
pub mod options;
pub mod photo;
#[cfg(feature = "camera")]
pub mod registration;

pub use error::SourceError;
pub use name::{Kind, SourceName};
pub use networks::{find_person, installed as installed_networks, refuse_metres};
use opened::Opened;
pub use options::{DepthChoice, Frames, NetworkFile, OneCamera, PlateFile, Size};

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::capture::side_by_side::SideBySide;
use crate::capture::{Brings, Camera, CaptureError};
use crate::clock::Clock;
use crate::computing::Computing;
use crate::depth::DepthSource;
use crate::depth::focus::FocusRule;
use crate::depth::plate::Guide;
use crate::frame::DepthMap;
use crate::look::{Effect, Known, Look, Strength};
use crate::optics::StereoRig;
use crate::pipeline::{Blurring, Run};
use crate::recording::{Options as Reading, Recording, Scratch};
use crate::sink::Sink;

/// What depth comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthFrom {
    /// There is none, or it is not used.
    #[default]
    Nothing,
    /// Numbers in units of their own, as 16-bit pictures and depth cameras have them.
    Units,
    /// Metres, or disparities that become metres.
    Metres,
    /// Grey pictures of relative inverse depth.
    Relative,
    /// Two eyes.
    Eyes,
    /// Networks: relative distances.
    Networks,
    /// A picture of what is behind: what stands before it, and what does not.
    Plate,
}

impl DepthFrom {
    /// Whether it tells only what is nearer, and nothing in metres.
    pub fn is_relative(self) -> bool {
        matches!(self, Self::Relative | Self::Networks | Self::Plate)
    }

    /// Whether another way to depth may take its place: it is none, or made of the pictures alone.
    pub fn is_of_pictures(self) -> bool {
        matches!(self, Self::Nothing | Self::Networks | Self::Plate)
    }
}

/// An opened source.
pub struct Source {
    /// Gives the frames.
    pub camera: Box<dyn Camera>,
    /// Gives their depth, where the camera does not.
    pub depth: Option<Box<dyn DepthSource>>,
    /// Geometry of the two eyes, where depth is matched from them.
    pub rig: Option<StereoRig>,
    /// What depth comes from.
    pub depth_from: DepthFrom,
    /// What makes the depth, where networks do.
    pub networks: Option<String>,
    /// What finds the person to focus on, where the depth is measured.
    pub persons: Option<String>,
    /// How far the plate is, where that makes the depth.
    pub guide: Option<Arc<Guide>>,
    /// The first map of recorded depth, where the look uses depth.
    pub first_depth: Option<DepthMap>,
}

/// How a source is opened.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Which frames.
    pub frames: Frames,
    /// How depth pictures are read.
    pub depth: options::Depth,
    /// Layout and geometry of its two eyes.
    pub stereo: options::Stereo,
    /// How networks are run.
    pub networks: options::Networks,
    /// Where depth comes from.
    pub depth_choice: DepthChoice,
    /// What runs the stereo matching.
    pub computing: Computing,
    /// Faulty lines in a recording's frame lists become frames that fail, instead of an error on opening.
    pub keep_going: bool,
    /// The pictures of a camera of PipeWire's go to those who asked for that camera, and come while there are any.
    pub filters: bool,
}

/// What the caller of [`Source::open`] asked for.
struct Wanted<'a> {
    options: &'a Options,
    /// The look that the depth is for; `None` where depth is wanted for its own sake, as for recording it.
    look: Option<&'a Look>,
}

/// What refuses metres for relative inverse depth.
pub const INVERSE_TELLS: &str = "inverse depth without a scale tells";

/// Whether depth from two eyes is refined by default: refinement does not model the errors of stereo matching, but
/// makes its depth steadier.
const REFINES_STEREO: bool = true;

impl Source {
    /// Opens a source. `look` decides whether depth is needed; without one, any depth there is gets opened.
    ///
    /// # Errors
    /// It cannot be read, it has no frame between `--start` and `--end`, or an option does not apply to it.
    pub fn open(name: &SourceName, options: &Options, look: Option<&Look>) -> Result<Self, SourceError> {
        let wanted = Wanted { options, look };
        let source = Self::open_with_own_depth(name, &wanted)?;
        let source = networks::for_lone_camera(source, &wanted);
        let source = elsewhere::with_external_depth(source, name, &wanted, &Clock::system())?;
        Ok(networks::for_focus(source, &wanted))
    }

    /// A source from a camera that the caller has opened; `depth` gives depth in metres for its frames.
    pub fn of(camera: Box<dyn Camera>, depth: Option<Box<dyn DepthSource>>) -> Self {
        let has_depth = depth.is_some() || camera.info().brings == Brings::Depth;
        let depth_from = if has_depth { DepthFrom::Metres } else { DepthFrom::Nothing };
        Self { camera, depth, rig: None, depth_from, networks: None, persons: None, guide: None, first_depth: None }
    }

    /// Opens a source with the depth it has by itself: recorded, exact, or matched from its two eyes. Depth from
    /// another device or recording is added by [`elsewhere::with_external_depth`].
    fn open_with_own_depth(name: &SourceName, wanted: &Wanted) -> Result<Self, SourceError> {
        let Options { frames, stereo, depth_choice, computing, .. } = wanted.options;
        name.check(frames)?;
        wanted.check_effect()?;
        let mut source = Opened::open(name, wanted)?;
        if stereo.side_by_side {
            let usage = |error: CaptureError| SourceError::Usage(error.to_string());
            source.camera = Box::new(SideBySide::new(source.camera).map_err(usage)?);
        }
        let info = source.camera.info();
        let depth_from = if info.brings == Brings::Depth { DepthFrom::Metres } else { source.depth_from };
        if stereo.side_by_side
            && source.depth.is_some()
            && matches!(depth_choice, DepthChoice::Auto | DepthChoice::Recorded)
        {
            return Err(SourceError::Usage(format!(
                "--side-by-side: the depth of {} is that of whole pictures, not of their left halves; add --depth stereo \
                 or --depth none",
                info.name
            )));
        }
        if info.brings != Brings::RightEye {
            if *depth_choice == DepthChoice::Stereo {
                return Err(SourceError::Usage(format!(
                    "--depth stereo: {} has one eye; use two cameras LEFT,RIGHT, a recording with both eyes, or \
                     --side-by-side",
                    info.name
                )));
            }
            stereo.refuse()?;
        } else if wanted.uses_stereo(source.depth.is_some()) {
            let depth = eyes::open(&info, &source.pair, source.disparities, stereo, computing)?;
            let rig = *depth.rig();
            if let Some(look) = wanted.look {
                eyes::check_focus(&rig, look)?;
            }
            let depth: Option<Box<dyn DepthSource>> = Some(Box::new(depth));
            let depth_from = DepthFrom::Eyes;
            return Ok(Self { rig: Some(rig), depth_from, ..Self::of(source.camera, depth) });
        }
        let Opened { camera, depth, first_depth, .. } = source;
        Ok(Self { depth_from, first_depth, ..Self::of(camera, depth) })
    }

    /// Whether its frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some() || self.camera.info().brings == Brings::Depth
    }

    /// A look adapted to this source, which was opened with `options`.
    ///
    /// # Errors
    /// As for [`fitting_look`].
    pub fn fitting_look(&self, look: &Look, options: &Options) -> Result<Look, SourceError> {
        fitting_look(look, &options.depth_choice, self.has_depth())
    }

    /// Whether its depth was measured (and not computed exactly), so that refinement improves it.
    pub fn is_measured(&self) -> bool {
        let is_made = matches!(self.depth_from, DepthFrom::Networks | DepthFrom::Plate);
        self.depth.is_some() && !is_made && (self.rig.is_none() || REFINES_STEREO)
    }

    /// A run of its frames ([`Run::of`]), which are blurred so, into `sink`, as fast as it goes. `stop` ends the run.
    pub fn into_run(self, blurring: Blurring, sink: Box<dyn Sink>, stop: &AtomicBool) -> Run<'_> {
        let measured = self.is_measured();
        Run { measured, ..Run::of(self.camera, self.depth, blurring, sink, stop) }
    }
}

impl Wanted<'_> {
    /// How a recording with depth pictures is read.
    fn reading(&self) -> Reading {
        let Options { depth, keep_going, .. } = self.options;
        Reading {
            depth_scale: depth.file_scale(),
            depth_unit: depth.file_unit(),
            depth_invalid: Some(depth.depth_invalid),
            keep_going: *keep_going,
            ..Reading::default()
        }
    }

    /// Whether the effect is one that uses depth.
    pub fn uses_depth(&self) -> bool {
        self.look.is_none_or(|look| look.effect.follows_depth())
    }

    /// The first depth map of a recording, to see what its numbers are; `None` where the look does not use depth. A faulty map
    /// is no error here: it is reported when the frame is read.
    pub fn first_depth(&self, recording: &Recording) -> Option<DepthMap> {
        let mut map = DepthMap::default();
        let is_used = self.look.is_some_and(|look| look.effect.follows_depth()) && recording.has_depth();
        let read = is_used.then(|| recording.read_depth(0, &mut Scratch::default(), &mut map))?;
        read.ok().map(|()| map)
    }

    /// Refuses a look that needs real distances for relative ones.
    fn check_relative(&self, depth_from: DepthFrom) -> Result<(), SourceError> {
        let is_used = depth_from == DepthFrom::Relative && self.uses_depth();
        self.look.filter(|_| is_used).map_or(Ok(()), |look| refuse_metres(look, INVERSE_TELLS))
    }

    fn check_effect(&self) -> Result<(), SourceError> {
        if self.options.depth_choice == DepthChoice::Stereo && !self.uses_depth() {
            let what = "--depth stereo: only --effect dof uses depth; leave one of them out";
            return Err(SourceError::Usage(what.to_string()));
        }
        Ok(())
    }

    /// Whether depth comes from stereo matching, if the source has two eyes; `has_depth` tells whether it has depth of
    /// another kind, which `auto` prefers.
    fn uses_stereo(&self, has_depth: bool) -> bool {
        match self.options.depth_choice {
            DepthChoice::Stereo => true,
            DepthChoice::Auto => self.uses_depth() && !has_depth,
            _ => false,
        }
    }
}

/// The look adapted to a source with or without depth: without, depth of field becomes tilt-shift.
///
/// # Errors
/// The look needs depth that there is not, or its lens needs a focus distance.
pub fn fitting_look(look: &Look, depth: &DepthChoice, has_depth: bool) -> Result<Look, SourceError> {
    let uses_depth = has_depth && *depth != DepthChoice::None;
    if look.effect == Effect::Dof && !uses_depth {
        return SourceError::usage(match has_depth {
            true => "--effect dof needs depth: leave --depth none out, or use --effect blur or tilt-shift",
            false => "--effect dof needs depth, and the source has none: use --effect blur or tilt-shift",
        });
    }
    if *depth == DepthChoice::Recorded && !has_depth {
        return SourceError::usage("--depth recorded: the source has no depth");
    }
    let look = look.for_source(Known { has_depth: uses_depth, ..Known::default() });
    let has_distance = look.effect.follows_depth() || matches!(look.focus, FocusRule::Metres(_));
    if matches!(look.strength, Strength::Lens(_)) && !has_distance {
        return SourceError::usage(
            "a lens without depth needs --focus METRES: its blur depends on the distance of focus",
        );
    }
    Ok(look)
}
