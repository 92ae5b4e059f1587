//! Video codecs as calls use them, through ffmpeg.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::str::FromStr;

use bokehcam::frame::ColorImage;
use bokehcam_video::command::{FFMPEG, base_command, file_url};

/// Bit rate of a call.
const RATE: &str = "1M";
/// Frames per second.
const FPS: &str = "30";

/// A codec of calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// H.264 by libx264, without delay.
    X264,
    /// VP8 by libvpx, in real time.
    Vp8,
}

impl Codec {
    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::X264 => "x264",
            Self::Vp8 => "vp8",
        }
    }

    fn options(self) -> &'static [&'static str] {
        match self {
            Self::X264 => &["-c:v", "libx264", "-tune", "zerolatency"],
            Self::Vp8 => &["-c:v", "libvpx", "-deadline", "realtime"],
        }
    }

    /// Returns pictures of one even size as they arrive, at 1 Mbit/s and 30 frames per second.
    ///
    /// # Errors
    /// ffmpeg is missing or lacks the codec; the temporary file cannot be written.
    pub fn transmit(self, pictures: &[ColorImage]) -> io::Result<Vec<ColorImage>> {
        let (width, height) = pictures.first().map_or((0, 0), ColorImage::size);
        let folder = tempfile::tempdir()?;
        let (raw, sent) = (folder.path().join("raw"), folder.path().join("call.mkv"));
        let mut file = File::create(&raw)?;
        pictures.iter().try_for_each(|picture| file.write_all(&picture.rgb))?;
        let size = format!("{width}x{height}");
        let mut command = base_command(FFMPEG);
        command.args(["-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size, "-framerate", FPS, "-i"]);
        command.arg(file_url(&raw)).args(self.options()).args(["-pix_fmt", "yuv420p", "-b:v", RATE]);
        run(command.arg(file_url(&sent)))?;
        decode(&sent, (width, height))
    }
}

impl FromStr for Codec {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        let found = [Self::X264, Self::Vp8].into_iter().find(|codec| codec.name() == name);
        found.ok_or_else(|| format!("there is no codec {name}: use x264 or vp8"))
    }
}

/// Returns whether ffmpeg can be run.
pub fn has_ffmpeg() -> bool {
    run(base_command(FFMPEG).arg("-version")).is_ok()
}

/// Decodes all pictures of a video, whose size (columns, rows) they have.
///
/// # Errors
/// ffmpeg is missing or cannot read the file.
pub fn decode(path: &Path, (width, height): (u32, u32)) -> io::Result<Vec<ColorImage>> {
    let mut command = base_command(FFMPEG);
    command.arg("-i").arg(file_url(path)).args(["-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"]);
    let bytes = run(command.stdout(Stdio::piped()))?.stdout;
    let pictures = bytes.chunks_exact((width * height * 3).max(1) as usize);
    Ok(pictures.map(|rgb| ColorImage { width, height, rgb: rgb.to_vec() }).collect())
}

fn run(command: &mut Command) -> io::Result<Output> {
    let output = command.output().map_err(|error| io::Error::new(error.kind(), format!("ffmpeg: {error}")))?;
    match output.status.success() {
        true => Ok(output),
        false => {
            let said = String::from_utf8_lossy(&output.stderr);
            Err(io::Error::other(format!("ffmpeg: {}", said.lines().next().unwrap_or("failed"))))
        }
    }
}
