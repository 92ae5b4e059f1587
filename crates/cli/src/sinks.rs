//! Conversion of `--to` options to one sink.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::files::refuse_overwriting_source;
use super::options::{Stream, Streaming};
use bokehcam::look::BackgroundSetting;
use bokehcam_files::place;
use bokehcam_live::sink::{Backpressure, Options, Sink, Sound, Target, Tee};
use bokehcam_live::source::{DepthChoice, Frames, SourceName, video};

/// Refuses sinks that collide with each other or with an input, and options that need other sinks.
///
/// # Errors
/// Fails if two sinks write to one place, a sink overwrites an input, or an option lacks the virtual camera that it
/// needs.
pub fn check_targets(targets: &[Target], parts: &Streaming, source: &SourceName) -> Result<(), CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    let Streaming { stream, blur, .. } = parts;
    let devices = source.device_nodes();
    let depth_path = match &blur.depth {
        DepthChoice::Folder(path) | DepthChoice::Video(path) => Some(path.as_path()),
        _ => None,
    };
    let behind = blur.look.0.behind.as_ref();
    let files = [depth_path, behind.and_then(BackgroundSetting::file)].into_iter().flatten().map(Path::to_owned);
    let inputs: Vec<PathBuf> = source.input_paths().into_iter().chain(files).collect();
    if behind.is_some_and(BackgroundSetting::is_transparent)
        && let Some(target) = targets.iter().find(|target| !target.keeps_alpha())
    {
        return usage(format!(
            "--behind transparent: --to {target} keeps no transparency; use DIR/ (PNG), FILE.webm (VP9) or FILE.mov \
             (ProRes 4444)"
        ));
    }
    for (index, target) in targets.iter().enumerate() {
        for read in &inputs {
            let path = target.path().filter(|_| !target.is_camera());
            path.map_or(Ok(()), |path| refuse_overwriting_source("--to", path, read))?;
        }
        if targets[..index].iter().any(|other| other.collides_with(target)) {
            return usage(format!("--to {target}: given twice; each output needs its own place"));
        }
        // The frames of a folder sink could overwrite a file within it.
        let lies_in = |other: &Target| match (other, target.path()) {
            (Target::Folder(folder), Some(path)) => {
                place::resolve_links(path).starts_with(place::resolve_links(folder))
            }
            _ => false,
        };
        if let Some(folder) = targets.iter().find(|other| *other != target && lies_in(other)) {
            return usage(format!(
                "--to {target}: that folder is for the pictures of --to {folder}; choose another place"
            ));
        }
        if devices.iter().any(|device| target.is_device(device)) {
            return usage(format!("--to {target}: this is the source itself; use a separate virtual camera"));
        }
    }
    check_virtual_cameras(targets, stream, source)
}

/// Refuses a filter without its camera, and options of virtual cameras without one.
fn check_virtual_cameras(targets: &[Target], stream: &Stream, source: &SourceName) -> Result<(), CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    if targets.contains(&Target::Filter) && source.pipewire_name().is_none() {
        return usage(format!(
            "--to filter: {source} is not a PipeWire camera; give it as pipewire:NAME, as listed by `bokehcam devices`"
        ));
    }
    if targets.contains(&Target::Filter) && targets.contains(&Target::Window) {
        return usage("--to filter: cannot be combined with a window, which keeps the camera open".to_string());
    }
    let has_camera = targets.iter().any(Target::is_camera);
    if stream.on_demand && !has_camera {
        return usage(
            "--on-demand needs a virtual camera, which reports its readers: add --to pipewire or --to /dev/videoN"
                .to_string(),
        );
    }
    match stream.out_size {
        Some(_) if !has_camera => {
            usage("--out-size is for a virtual camera: add --to pipewire or --to /dev/videoN".to_string())
        }
        Some(size) if !size.width.is_multiple_of(2) => usage(format!(
            "--out-size {}x{}: a virtual camera needs an even width, such as {}",
            size.width,
            size.height,
            size.width + 1
        )),
        _ => Ok(()),
    }
}

/// Returns the sound of a video, if an output stores it.
///
/// # Errors
/// Fails if the video is unreadable.
pub fn find_sound(targets: &[Target], source: &SourceName, frames: &Frames) -> Result<Option<Sound>, CliError> {
    match source {
        SourceName::Video(path) if targets.iter().any(|target| matches!(target, Target::Video(_))) => {
            Ok(video::find_sound(path, frames)?)
        }
        _ => Ok(None),
    }
}

/// Opens all sinks as one. With [`Backpressure::Block`] all files get every frame, except while `closed` is set.
///
/// # Errors
/// Fails if one cannot be opened; the others are discarded.
pub fn open_targets(
    targets: &[Target],
    options: &Options,
    backpressure: Backpressure,
    closed: &Arc<AtomicBool>,
) -> Result<Box<dyn Sink>, CliError> {
    let mut sinks = targets.iter().map(|target| target.open(options)).collect::<Result<Vec<_>, _>>()?;
    Ok(match sinks.pop() {
        Some(only) if sinks.is_empty() => only,
        last => {
            sinks.extend(last);
            Box::new(Tee::new(sinks, backpressure, Arc::clone(closed))?)
        }
    })
}
