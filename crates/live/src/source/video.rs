//! Video files as sources.

use std::io::Read;
use std::path::Path;

use super::{Frames, SourceError, SourceName, options};
use crate::capture::CaptureError;
use crate::capture::replay::PlayRange;
use crate::capture::video::{Video, warn_of_remarks};
use crate::depth::video::VideoDepth;
use crate::sink::Sound;
use bokehcam::depth::DepthError;
use bokehcam_files::input;
use bokehcam_media::recording::DepthUnit;
use bokehcam_media::recording::depth_file::has_same_view;
use bokehcam_media::recording::still;
use bokehcam_video::{VideoError, VideoFile};

/// Beginnings of video files: an offset, and the bytes there.
const SIGNATURES: [(usize, &[u8]); 13] = [
    // ISO 14496-12 and QuickTime; pictures in this container are told apart by their brand.
    (4, b"ftyp"),
    (4, b"moov"),
    (4, b"mdat"),
    (4, b"wide"),
    (4, b"skip"),
    // Matroska and WebM.
    (0, &[0x1a, 0x45, 0xdf, 0xa3]),
    (8, b"AVI "),
    (0, b"YUV4MPEG2"),
    (0, b"OggS"),
    (0, b"FLV\x01"),
    // ASF and WMV.
    (0, &[0x30, 0x26, 0xb2, 0x75, 0x8e, 0x66, 0xcf, 0x11]),
    // MPEG program streams, and transport streams of packets of 188 bytes.
    (0, &[0, 0, 1, 0xba]),
    (188, b"G"),
];

/// Brands of still pictures in the container of mp4.
const PICTURE_BRANDS: [&[u8]; 5] = [b"heic", b"heix", b"mif1", b"avif", b"miaf"];

/// Endings of the names of videos, for files whose beginning says nothing.
const EXTENSIONS: [&str; 12] = ["mp4", "mkv", "webm", "mov", "avi", "m4v", "y4m", "gif", "ts", "mpg", "mpeg", "wmv"];

/// Returns whether a file is a video, by its first bytes, or else by its name: a damaged one is refused with a reason.
pub fn is_video(path: &Path) -> bool {
    let mut first = Vec::with_capacity(256);
    // An unreadable file is reported when it is opened.
    let _ = input::open(path).and_then(|file| file.take(256).read_to_end(&mut first));
    let has = |at: usize, bytes: &[u8]| first.get(at..).is_some_and(|rest| rest.starts_with(bytes));
    let is_known =
        still::is_gif(path) || SIGNATURES.iter().any(|&(at, bytes)| has(at, bytes) && (at != 188 || has(0, b"G")));
    let is_picture = has(4, b"ftyp") && PICTURE_BRANDS.iter().any(|brand| has(8, brand));
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let is_named = extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str()));
    !is_picture && (is_known || is_named)
}

/// Parses the name of a video file; `None` if it is not one. Refuses an address with the command that opens it.
pub(super) fn parse(path: &Path) -> Option<Result<SourceName, SourceError>> {
    let text = path.to_string_lossy();
    let is_address =
        text.split_once("://").is_some_and(|(scheme, _)| scheme.bytes().all(|c| c.is_ascii_alphanumeric()));
    if is_address && !path.exists() {
        return Some(SourceError::usage_error(format!(
            "an address is opened by ffmpeg and piped: ffmpeg -i '{text}' -f yuv4mpegpipe - | bokehcam stream - --to SINK"
        )));
    }
    (path.is_file() && is_video(path)).then(|| Ok(SourceName::Video(path.to_owned())))
}

/// Opens a video file. `by_index` counts frames from the first one of the file, also after `--start`.
///
/// # Errors
/// The file is not a readable video, the range has no frame, or an option does not fit.
pub(super) fn open(path: &Path, frames: &Frames, by_index: bool) -> Result<Video, SourceError> {
    let file = VideoFile::open(path).map_err(CaptureError::from)?;
    warn_of_remarks(&file);
    let size_px = frames.size.map_or(file.size_px, |size| (size.width, size.height));
    if !has_same_view(size_px, file.size_px) {
        let ((width, height), (from_width, from_height)) = (size_px, file.size_px);
        tracing::warn!("--size {width}x{height} distorts the pictures, which are {from_width}x{from_height}");
    }
    if by_index && frames.fps.is_some() {
        return SourceError::usage_error(
            "--fps changes the number of frames, and --depth FILE needs the same number: leave --fps out",
        );
    }
    Ok(Video::open(file, size_px, frames.fps, play_range(frames), !by_index)?)
}

/// Returns the sound and the title, date and place of the played part of a video file, if it has any; warns of what is
/// left out.
///
/// # Errors
/// The file is unreadable.
pub fn find_sound(path: &Path, frames: &Frames) -> Result<Option<Sound>, SourceError> {
    let file = VideoFile::open(path).map_err(CaptureError::from)?;
    if file.has_sound && frames.repeat {
        tracing::warn!("{}: a loop is written without its sound", path.display());
    }
    if file.has_subtitles {
        tracing::warn!("{}: written without its subtitles", path.display());
    }
    let start_s = frames.start.unwrap_or(0.0) + file.offset_s;
    Ok(((file.has_sound || file.has_tags) && !frames.repeat)
        .then(|| Sound { path: path.to_owned(), start_s: start_s.max(0.0) }))
}

/// Opens the depth in the video `file` for the frames of the source `name`, of `color_px`.
///
/// # Errors
/// The source is not a video, or has another number of frames or another aspect ratio; the file is unreadable.
pub(super) fn open_depth(
    file: &Path,
    color_px: (u32, u32),
    name: &SourceName,
    options: &options::Depth,
) -> Result<VideoDepth, SourceError> {
    let SourceName::Video(color) = name else {
        return SourceError::usage_error(format!(
            "--depth {}: a video of depth belongs to a video, frame by frame, and {name} is none",
            file.display()
        ));
    };
    let (depth, color) = (VideoFile::open(file), VideoFile::open(color));
    let (depth, color) = (depth.map_err(DepthError::from)?, color.map_err(DepthError::from)?);
    if let (Some(frames), Some(needed)) = (depth.frames, color.frames)
        && frames != needed
    {
        return Err(DepthError::from(VideoError::FrameCount { path: depth.path, frames, needed }).into());
    }
    if depth.is_16bit_grey && options.depth_unit != Some(DepthUnit::Inverse) && !options.depth_invert {
        return SourceError::usage_error(format!(
            "--depth {0}: grey of 16 bits may be distances, and a video states no unit; --depth-unit inverse takes \
             it as relative, and for distances make maps: ffmpeg -i {0} -fps_mode passthrough MAPS/%06d.png, then --depth MAPS --depth-unit \
             millimetres",
            file.display()
        ));
    }
    let unused = [
        (options.depth_unit.is_some_and(|unit| unit != DepthUnit::Inverse), "--depth-unit"),
        (options.depth_fit.is_some(), "--depth-fit"),
        (options.depth_invalid != 0, "--depth-invalid"),
    ];
    for (_, option) in unused.iter().filter(|(is_given, _)| *is_given) {
        tracing::warn!("without effect here: {option} (a video of depth is relative)");
    }
    warn_of_remarks(&depth);
    if depth.has_alpha {
        tracing::warn!("{}: its transparency is ignored", file.display());
    }
    let near = if options.depth_invert { "black" } else { "white" };
    tracing::info!("{}: relative depth, {near} is near; --depth-invert takes the other end", file.display());
    Ok(VideoDepth::open(depth, color_px, options.depth_invert).map_err(DepthError::from)?)
}

/// Returns the part of a recording or video to play.
pub(super) fn play_range(frames: &Frames) -> PlayRange {
    PlayRange { start_s: frames.start.unwrap_or(0.0), end_s: frames.end, looped: frames.repeat, frames: frames.frames }
}
