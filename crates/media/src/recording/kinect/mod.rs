//! Recordings of Azure Kinect (its SDK's `k4arecorder`), and of cameras with the same format (Orbbec Femto): a Matroska
//! file with the tracks `COLOR`, `DEPTH` and `IR`, and the device's calibration. Every picture stands alone.

mod calibration;
mod ebml;
mod file;
mod scan;
mod track;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::contents::{Contents, DepthFormat, Layout, ListedFrame, PictureSource, RecordingFolder, warn_of_damage};
use super::decode::DepthUnits;
use super::error::RecordingError;
use super::{Options, Unpaired, depth_covers, pair};
use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam_files::input;
use file::KinectFile;
use track::{Block, ColorFormat, Track};

pub(super) const LAYOUT: Layout = Layout {
    name: "Azure Kinect",
    expected_files: "a file .mkv of Azure Kinect or Orbbec Femto",
    matches: |path| is_kinect(path).unwrap_or(false),
    open,
};

const COLOR: &str = "COLOR";
const DEPTH: &str = "DEPTH";
const INFRARED: &str = "IR";

/// Units of depth per metre.
const DEPTH_SCALE: f32 = 1000.0;

/// Returns whether a file is such a recording, and no other video: by its tracks and tags.
fn is_kinect(path: &Path) -> io::Result<bool> {
    let mut file = input::open(path)?;
    let mut start = [0; scan::MAGIC.len()];
    file.read_exact(&mut start)?;
    if start != scan::MAGIC {
        return Ok(false);
    }
    let found = scan::scan_start(&file)?;
    let has_grey16 = [DEPTH, INFRARED].iter().any(|name| found.track(name).is_some_and(Track::is_grey16));
    let has_color = || found.track(COLOR).is_some_and(|track| track.color_format().is_some());
    Ok(has_grey16 || found.has_kinect_tags() && has_color())
}

/// Returns the track of colour, which has pictures, and their format.
fn find_color(found: &scan::Contents) -> Result<(&Track, ColorFormat), String> {
    let no_color = "it has no colour pictures (track COLOR); record with the colour camera on";
    let color = found.track(COLOR).ok_or(no_color)?;
    let format = color.color_format().ok_or_else(|| {
        let format = color.format.escape_debug();
        format!("its colour pictures have the format {format}, which is not read; record them as MJPG")
    })?;
    if color.in_order().is_empty() {
        let damage = found.damage.as_ref().map_or(String::new(), |damage| format!(" ({damage})"));
        return Err(format!("no colour picture in it is whole{damage}; copy it again"));
    }
    Ok((color, format))
}

/// Finds the pictures, and pairs those of colour and depth.
fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let path = &folder.dir;
    let name = path.display().to_string();
    let fault = |what: String| RecordingError::File { path: path.clone(), what };
    let file = input::open(path).map_err(RecordingError::io("open the recording", path))?;
    let found = scan::scan(&file, &name).map_err(RecordingError::io("read the recording", path))?;
    let (color, color_format) = find_color(&found).map_err(fault)?;
    let colors = color.in_order();
    warn_of_damage(&name, found.damage.as_deref());
    let depth = found.track(DEPTH).filter(|track| track.is_grey16() && !track.blocks.is_empty());
    if depth.is_none() {
        let mode = found.tag("K4A_DEPTH_MODE").map_or(String::new(), |mode| format!(" ({})", mode.escape_debug()));
        tracing::warn!("{name} was recorded without depth{mode}; its colour is played");
    }
    let frames = pair_frames(&found, &colors, depth);
    if frames.is_empty() {
        return Err(fault("no depth map in it was taken within half a frame of a colour picture".to_owned()));
    }
    let uncalibrated = depth.filter(|_| options.depth_calibration.is_none());
    let read = |depth: &Track| read_calibration(&file, &found, depth.size, color.size);
    let calibration = uncalibrated.map(read).transpose();
    let depth_size = depth.map_or((0, 0), |depth| depth.size);
    if let (Err(reason), true) = (&calibration, depth_covers(depth_size, color.size)) {
        tracing::warn!(
            "{name} {reason}: depth is taken as if it had the view of the colour camera (--depth-calibration)"
        );
    }
    options.warn_of_inverse_unit(&name, depth.is_some());
    let source = |track: &str, at: usize| PictureSource::from_path(format!("{track}, frame {at}").into());
    let listed = frames.iter().enumerate().map(|(at, (color, depth))| ListedFrame {
        time_ns: Some(found.time_ns(color.ticks)),
        color: source(COLOR, at),
        right: None,
        depth: depth.map(|_| source(DEPTH, at)),
    });
    let unpaired = Unpaired::beside(frames.len(), colors.len(), depth.map(|depth| depth.blocks.len()));
    let invalid = options.depth_invalid.filter(|&invalid| invalid != 0);
    let units = DepthUnits { scale: DEPTH_SCALE, invalid };
    Ok(Contents {
        frames: listed.collect(),
        depth: depth.map(|_| DepthFormat::StatedUnits(units)),
        depth_calibration: calibration.as_ref().ok().copied().flatten(),
        unpaired,
        has_times: true,
        container: Some(Box::new(KinectFile {
            color_format,
            color_size: color.size,
            depth_size,
            units,
            uncalibrated: calibration.err(),
            frames,
            file,
        })),
        ..Contents::default()
    })
}

/// Returns the colour picture and the depth map of each frame: those that were taken within half a frame.
fn pair_frames(found: &scan::Contents, colors: &[Block], depth: Option<&Track>) -> Vec<(Block, Option<Block>)> {
    let depths = depth.map(Track::in_order);
    let times_ns = |blocks: &[Block]| blocks.iter().map(|block| found.time_ns(block.ticks)).collect::<Vec<_>>();
    let pairs = pair::pair_frames(&times_ns(colors), depths.as_deref().map(times_ns).as_deref()).into_iter();
    pairs.map(|(color, depth)| (colors[color], depths.as_ref().zip(depth).map(|(depths, at)| depths[at]))).collect()
}

/// Reads the calibration.
///
/// # Errors
/// It is missing or invalid; the reason in one line, which follows the file's name.
fn read_calibration(
    file: &File,
    found: &scan::Contents,
    depth_size: (u32, u32),
    color_size: (u32, u32),
) -> Result<RgbdCalibration, String> {
    let name = found.tag("K4A_CALIBRATION_FILE").unwrap_or(calibration::FILE);
    let attached = found.read_attachment(file, name).map_err(|error| input::format_io_error(&error))?;
    let json = attached.ok_or_else(|| "has no calibration".to_owned())?;
    let fault = |what: String| format!("has a calibration that cannot be used ({what})");
    let calibration = calibration::parse(&json, depth_size, color_size).map_err(fault)?;
    calibration.validate().map_err(|error| fault(error.to_string()))?;
    Ok(calibration)
}
