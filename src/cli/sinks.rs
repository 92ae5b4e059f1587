//! From `--to` to one sink.

use std::path::Path;

use super::error::CliError;
use super::options;
use crate::sink::{Options, Sink, Target, Tee};

/// Whether what was asked of the sinks fits together; `devices` are those that frames come from.
///
/// # Errors
/// Two sinks write to one place, one writes to the source, or an option needs a virtual camera where there is none.
pub fn check(targets: &[Target], stream: &options::Stream, devices: &[&Path]) -> Result<(), CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    for (at, target) in targets.iter().enumerate() {
        if targets[..at].iter().any(|other| other.collides_with(target)) {
            return usage(format!("--to {target}: given twice; each sink needs a place of its own"));
        }
        if devices.iter().any(|device| target.is_device(device)) {
            return usage(format!("--to {target}: this is the source itself; take a virtual camera of its own"));
        }
    }
    let has_camera = targets.iter().any(Target::is_camera);
    if stream.on_demand && !has_camera {
        return usage("--on-demand needs a virtual camera, to be told who watches: add --to /dev/videoN".to_string());
    }
    match stream.out_size {
        Some(_) if !has_camera => usage("--out-size is for a virtual camera: add --to /dev/videoN".to_string()),
        Some(size) if !size.width.is_multiple_of(2) => usage(format!(
            "--out-size {}x{}: a virtual camera needs an even width, such as {}",
            size.width,
            size.height,
            size.width + 1
        )),
        _ => Ok(()),
    }
}

/// Opens all sinks as one.
///
/// # Errors
/// One cannot be opened; the others are then given up.
pub fn open(targets: &[Target], options: &Options) -> Result<Box<dyn Sink>, CliError> {
    let mut sinks = targets.iter().map(|target| target.open(options)).collect::<Result<Vec<_>, _>>()?;
    Ok(match sinks.pop() {
        Some(only) if sinks.is_empty() => only,
        last => {
            sinks.extend(last);
            Box::new(Tee::new(sinks))
        }
    })
}
