//! Command lines of ffmpeg and ffprobe.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::process::read_output_within;

/// The program that decodes and encodes.
pub const FFMPEG: &str = "ffmpeg";
/// The program that describes files.
pub const FFPROBE: &str = "ffprobe";

/// Builds a command of ffmpeg or ffprobe in a process group of its own, which logs only errors.
pub fn base_command(program: &str) -> Command {
    let mut command = Command::new(program);
    command
        .args(["-hide_banner", "-loglevel", "error"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        // Ctrl-C on a terminal signals the whole group, and an encoder must survive until the last frame.
        .process_group(0);
    command
}

/// Prefixes the path as a file, so that ffmpeg interprets neither a dash as an option nor a colon as a protocol.
pub fn file_url(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

/// Returns the name of the option by which frames keep their times: `-fps_mode` since ffmpeg 5.1, `-vsync` before,
/// which later versions no longer support.
pub fn frame_timing_option() -> &'static str {
    let text = read_output_within(Command::new(FFMPEG).arg("-version"), Duration::from_secs(2));
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
