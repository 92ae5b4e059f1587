//! Command lines of ffmpeg.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::container::Container;
use super::process::read_output_within;
use crate::color::YcbcrMatrix;

const PROGRAM: &str = "ffmpeg";

/// Output parameters of ffmpeg, selected by the file's extension.
pub(super) struct Format {
    pub container: Container,
    muxer: &'static [&'static str],
    encoder: &'static [&'static str],
    /// Unit of the frames' time stamps, as a fraction of a second.
    time_base: &'static str,
}

impl Format {
    /// Selects the format. Every format is written in pieces of a second, so that a truncated file can be played.
    pub(super) fn for_path(path: &Path) -> Self {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let matroska = |muxer, encoder| Self { container: Container::Matroska, muxer, encoder, time_base: "1:1000" };
        match extension.as_deref() {
            Some("webm") => matroska(&["-cluster_time_limit", "1000", "-f", "webm"], VP9),
            Some("mkv") => matroska(&["-cluster_time_limit", "1000", "-f", "matroska"], H264),
            _ => Self { container: Container::Mp4, muxer: FRAGMENTED_MP4, encoder: H264, time_base: MP4_TIME_BASE },
        }
    }
}

/// A tick that divides the usual frame periods, and long enough that a gap of half a day is below 2^28 ticks: readers
/// distrust longer ones.
const MP4_TIME_BASE: &str = "1:6000";

const FRAGMENTED_MP4: &[&str] =
    &["-movflags", "+frag_keyframe+delay_moov+default_base_moof", "-frag_duration", "1000000", "-f", "mp4"];

/// Visually lossless, at several times the speed of the default preset.
const H264: &[&str] = &["-c:v", "libx264", "-preset", "veryfast", "-crf", "18"];

const VP9: &[&str] =
    &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "5", "-row-mt", "1"];

/// Builds the command that encodes the Matroska stream on its standard input into the file `part`, with `threads`
/// threads.
pub(super) fn encode_command(format: &Format, part: &Path, height: u32, threads: Option<usize>) -> Command {
    let color = match YcbcrMatrix::for_height(height) {
        YcbcrMatrix::Bt601 => "smpte170m",
        // Players expect this for high definition.
        YcbcrMatrix::Bt709 | YcbcrMatrix::Bt2020 => "bt709",
    };
    // Tagged on the frames, for filters, and on the stream, for the muxer. 4:2:0 encoders refuse odd sizes.
    let filters = format!(
        "crop=trunc(iw/2)*2:trunc(ih/2)*2,\
         setparams=range=tv:colorspace={color}:color_primaries={color}:color_trc={color}"
    );
    let mut command = base_command();
    command
        .args(["-f", "matroska", "-i", "pipe:0"])
        .args(["-vf", &filters, "-pix_fmt", "yuv420p", "-color_range", "tv"])
        .args(["-colorspace", color, "-color_primaries", color, "-color_trc", color])
        .args([frame_timing_option(), "vfr", "-enc_time_base", format.time_base])
        .args(format.encoder)
        .args(threads.iter().flat_map(|threads| ["-threads".to_owned(), threads.to_string()]))
        // No random identifiers: the same frames produce the same file.
        .args(["-fflags", "+bitexact", "-flush_packets", "1"])
        .args(format.muxer)
        .arg(file_url(part))
        .stdin(Stdio::piped());
    command
}

/// Builds the command that copies `from` to `to` as an mp4 with its index in front, so that a player can start before
/// it has the whole file.
pub(super) fn faststart_command(from: &Path, to: &Path) -> Command {
    let mut command = base_command();
    command
        .arg("-i")
        .arg(file_url(from))
        .args(["-c", "copy", "-movflags", "+faststart", "-f", "mp4"])
        .arg(file_url(to));
    command.stdin(Stdio::null());
    command
}

/// Builds an ffmpeg command in a process group of its own, which logs only errors and overwrites its output file.
fn base_command() -> Command {
    let mut command = Command::new(PROGRAM);
    command
        .args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        // Ctrl-C on a terminal signals the whole group, and ffmpeg must survive until the last frame.
        .process_group(0);
    command
}

/// Prefixes the path as a file, so that ffmpeg interprets neither a dash as an option nor a colon as a protocol.
fn file_url(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

/// Returns the name of the option by which frames keep their times: `-fps_mode` since ffmpeg 5.1, `-vsync` before,
/// which later versions no longer support.
fn frame_timing_option() -> &'static str {
    let text = read_output_within(Command::new(PROGRAM).arg("-version"), Duration::from_secs(2));
    if text.as_deref().and_then(parse_version).is_some_and(|version| version < (5, 1)) { "-vsync" } else { "-fps_mode" }
}

/// Parses `ffmpeg version 5.1.9-0+deb12u1 Copyright ...` to (5, 1).
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let number = text.strip_prefix("ffmpeg version ")?.split_whitespace().next()?.trim_start_matches('n');
    let mut parts = number.split(|c: char| !c.is_ascii_digit());
    Some((parts.next()?.parse().ok()?, parts.next().and_then(|minor| minor.parse().ok()).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_as_builds_state_them() {
        for (text, expected) in [
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright (c) 2000-2026", Some((5, 1))),
            ("ffmpeg version n6.0-10-g1 Copyright", Some((6, 0))),
            ("ffmpeg version 4.4.2-0ubuntu0.22.04.1 Copyright", Some((4, 4))),
            ("ffmpeg version 7.1 Copyright", Some((7, 1))),
            ("ffmpeg version 8", Some((8, 0))),
            ("ffmpeg version N-109542-g0a7c6b4 Copyright", None),
            ("something else", None),
        ] {
            assert_eq!(parse_version(text), expected, "{text}");
        }
    }
}
