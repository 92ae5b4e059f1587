//! From `--depth` to depth from elsewhere: a recording's, or a depth camera's.

use super::error::CliError;
use super::options;
use super::source::{Source, Wanted, depth_of};
use super::unused::DepthFrom;
use super::values::DepthChoice;
use crate::capture::Brings;
use crate::clock::Clock;
use crate::depth::DepthSource;
use crate::depth::beside::Beside;
use crate::recording::{Options, Recording};

/// Gives `source` the depth that was chosen, where that is not its own and the effect needs it.
///
/// # Errors
/// It cannot be opened, or an option does not apply to it.
pub fn beside(source: Source, wanted: &Wanted, clock: &Clock) -> Result<Source, CliError> {
    let &Wanted { depth, from, keep_going, .. } = wanted;
    let usage = |text: &str| Err(CliError::Usage(text.to_string()));
    if depth.depth_calibration.is_some() && !matches!(from, DepthChoice::Device(_)) {
        return usage("--depth-calibration is for a depth camera: name it with --depth, such as --depth /dev/video2");
    }
    if !from.is_elsewhere() {
        return Ok(source);
    }
    if !wanted.uses_depth() {
        return usage("--depth names depth, and only --effect dof uses any: leave one of them out");
    }
    if source.camera.info().brings == Brings::Depth {
        return usage("the source knows its depth: leave --depth out");
    }
    let mut first = None;
    let (opened, depth_from): (Box<dyn DepthSource>, _) = match from {
        DepthChoice::Auto | DepthChoice::Recorded | DepthChoice::Stereo | DepthChoice::None => return Ok(source),
        DepthChoice::Folder(folder) => {
            let options = Options {
                depth_scale: depth.file_scale(),
                depth_invalid: Some(depth.depth_invalid),
                keep_going,
                ..Options::default()
            };
            let recording = Recording::open(folder, &options)?;
            let depth_from = depth_of(&recording);
            first = wanted.first_depth(&recording);
            (Box::new(Beside::new(recording, &folder.display().to_string())?), depth_from)
        }
        DepthChoice::Device(name) => (device(name, depth, clock)?, DepthFrom::Units),
    };
    Ok(Source { depth: Some(opened), depth_from, first_depth: first, ..source })
}

#[cfg(feature = "camera")]
fn device(name: &str, depth: &options::Depth, clock: &Clock) -> Result<Box<dyn DepthSource>, CliError> {
    use super::{calibration, defaults};
    use crate::depth::live::{LiveDepth, Units};
    use crate::v4l2::live::OpenError;
    let registration = depth.depth_calibration.as_deref().map(calibration::load).transpose()?;
    let units = Units { per_m: depth.depth_scale.unwrap_or(defaults::LIVE_DEPTH_SCALE), invalid: depth.depth_invalid };
    match LiveDepth::open(name, units, registration, clock.clone()) {
        Ok(camera) => Ok(Box::new(camera)),
        // A slip of the pen, as like as not.
        Err(error @ OpenError::Name(_)) => Err(CliError::Usage(format!(
            "--depth {name}: {error}; or use auto, recorded, stereo, none or a folder with a recording"
        ))),
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(feature = "camera"))]
fn device(name: &str, _: &options::Depth, _: &Clock) -> Result<Box<dyn DepthSource>, CliError> {
    Err(CliError::Usage(format!(
        "--depth {name}: there is no such folder, and this build leaves cameras out (feature `camera`)"
    )))
}
