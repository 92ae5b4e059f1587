//! Sources by name: a camera, two of them, a recording or the synthetic scene, with the depth that goes with it.
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
mod name;
mod near;
mod opened;
pub mod options;
#[cfg(feature = "camera")]
pub mod registration;

pub use error::SourceError;
pub use name::{Kind, SourceName};
use opened::Opened;
pub use options::{DepthChoice, Frames, Size};

use crate::capture::side_by_side::SideBySide;
use crate::capture::{Brings, Camera, CaptureError};
use crate::clock::Clock;
use crate::computing::Computing;
use crate::depth::DepthSource;
use crate::depth::focus::FocusRule;
use crate::frame::DepthMap;
use crate::look::{Effect, Look, Strength};
use crate::optics::StereoRig;
use crate::recording::{Options as Reading, Recording, Scratch};

/// What depth comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthFrom {
    /// There is none, or it is not used.
    Nothing,
    /// Numbers in units of their own, as 16-bit pictures and depth cameras have them.
    Units,
    /// Metres, or disparities that become metres.
    Metres,
    /// Two eyes.
    Eyes,
}

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

/// How a source is opened.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Which frames.
    pub frames: Frames,
    /// How depth pictures are read.
    pub depth: options::Depth,
    /// What is said of its two eyes.
    pub stereo: options::Stereo,
    /// Where depth comes from.
    pub depth_choice: DepthChoice,
    /// What matches its two eyes.
    pub computing: Computing,
    /// Faulty lines of a recording's lists become frames that fail.
    pub keep_going: bool,
    /// The synthetic scene repeats itself, so that it can be played smoothly.
    pub cycle: bool,
}

/// How a source is opened, and what its depth is for; `None` for itself.
struct Wanted<'a> {
    options: &'a Options,
    look: Option<&'a Look>,
}

/// Refinement of depth from two eyes, unless it is chosen: it knows nothing of how matching errs, but steadies it.
const REFINES_STEREO: bool = true;

impl Source {
    /// Opens a source.
    ///
    /// # Errors
    /// It cannot be read, it has no frame between `--start` and `--end`, or an option does not apply to it.
    pub fn open(name: &SourceName, options: &Options, look: Option<&Look>) -> Result<Self, SourceError> {
        let wanted = Wanted { options, look };
        elsewhere::beside(Self::open_own(name, &wanted)?, &wanted, &Clock::system())
    }

    /// A camera of one's own, and what gives depth to its frames, in metres.
    pub fn of(camera: Box<dyn Camera>, depth: Option<Box<dyn DepthSource>>) -> Self {
        let has_depth = depth.is_some() || camera.info().brings == Brings::Depth;
        let depth_from = if has_depth { DepthFrom::Metres } else { DepthFrom::Nothing };
        Self { camera, depth, rig: None, depth_from, first_depth: None }
    }

    /// Opens a source with its own depth.
    fn open_own(name: &SourceName, wanted: &Wanted) -> Result<Self, SourceError> {
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
        } else if wanted.matches(source.depth.is_some()) {
            let depth = eyes::open(&info, &source.pair, source.disparities, stereo, computing)?;
            let rig = *depth.rig();
            if let Some(look) = wanted.look {
                eyes::check_focus(&rig, look)?;
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

    /// A look as far as this source allows it, opened with these options.
    ///
    /// # Errors
    /// It needs depth that there is not, or a distance of focus.
    pub fn fitting_look(&self, look: &Look, options: &Options) -> Result<Look, SourceError> {
        fitting_look(look, &options.depth_choice, self.has_depth())
    }

    /// Whether its depth was measured, so that refining it makes it better.
    pub fn is_measured(&self) -> bool {
        self.depth.is_some() && (self.rig.is_none() || REFINES_STEREO)
    }
}

impl Wanted<'_> {
    /// How a recording with depth pictures is read.
    fn reading(&self) -> Reading {
        let Options { depth, keep_going, .. } = self.options;
        Reading {
            depth_scale: depth.file_scale(),
            depth_invalid: Some(depth.depth_invalid),
            keep_going: *keep_going,
            ..Reading::default()
        }
    }

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

    fn check_effect(&self) -> Result<(), SourceError> {
        if self.options.depth_choice == DepthChoice::Stereo && !self.uses_depth() {
            let what = "--depth stereo: only --effect dof uses depth; leave one of them out";
            return Err(SourceError::Usage(what.to_string()));
        }
        Ok(())
    }

    /// Whether two eyes are matched, where there are two, and depth of another kind or not.
    fn matches(&self, has_depth: bool) -> bool {
        match self.options.depth_choice {
            DepthChoice::Stereo => true,
            DepthChoice::Auto => self.uses_depth() && !has_depth,
            _ => false,
        }
    }
}

/// The look as far as a source with depth or without allows it.
///
/// # Errors
/// It needs depth that there is not, or a distance of focus.
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
    let look = look.for_source(uses_depth);
    let has_distance = look.effect.follows_depth() || matches!(look.focus, FocusRule::Metres(_));
    if matches!(look.strength, Strength::Lens(_)) && !has_distance {
        return SourceError::usage(
            "a lens without depth needs --focus METRES: its blur depends on the distance of focus",
        );
    }
    Ok(look)
}
