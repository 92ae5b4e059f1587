//! Compressed video through the ffmpeg program: y4m into its standard input.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, ErrorKind};
use std::ops::ControlFlow;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::thread::{self, JoinHandle};

use super::staged::Staged;
use super::y4m::Y4m;
use super::yuv::Matrix;
use super::{Options, Sink, SinkError};
use crate::frame::ColorImage;

/// Lines of ffmpeg's complaint that are kept: the cause comes last, but not always alone.
const LAST_LINES: usize = 4;

/// A file encoded by a child process: H.264 in `.mp4` and `.mkv`, VP9 in `.webm`.
pub struct Ffmpeg {
    // Dropped in this order: the process before the file that it writes.
    encoder: Encoder,
    staged: Staged,
}

struct Encoder {
    child: Child,
    /// `None` once the input is closed.
    input: Option<Y4m<ChildStdin>>,
    complaint: Option<JoinHandle<VecDeque<String>>>,
}

impl Ffmpeg {
    /// Starts ffmpeg, found through `PATH`, to write `path`.
    ///
    /// # Errors
    /// The file exists and `force` is not set, or ffmpeg is missing or cannot be started.
    pub fn create(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let staged = Staged::new(path, options.force)?;
        let mut child = command(&staged, options).spawn().map_err(|cause| match cause.kind() {
            ErrorKind::NotFound => SinkError::NoFfmpeg { path: path.to_owned() },
            _ => SinkError::Write { path: path.to_owned(), cause },
        })?;
        let input = child.stdin.take().map(|stdin| Y4m::new(stdin, path, options));
        // Read all the while, or a talkative ffmpeg would stand still with its pipe full, and this program with it.
        let complaint = child.stderr.take().map(|stderr| thread::spawn(move || last_lines(stderr)));
        Ok(Self { encoder: Encoder { child, input, complaint }, staged })
    }

    /// Waits for the end of the process, which must be a good one.
    fn wait(&mut self) -> Result<(), SinkError> {
        let encoder = &mut self.encoder;
        encoder.input = None;
        let status = encoder.child.wait().map_err(SinkError::write(self.staged.path()))?;
        if status.success() {
            return Ok(());
        }
        let said = encoder.complaint.take().and_then(|reader| reader.join().ok()).unwrap_or_default();
        let said = Vec::from(said).join(" | ");
        Err(SinkError::Ffmpeg { path: self.staged.path().to_owned(), status: status.to_string(), said })
    }
}

fn command(staged: &Staged, options: &Options) -> Command {
    let extension = staged.path().extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let (muxer, encoder): (&str, &[&str]) = match extension.as_deref() {
        Some("webm") => ("webm", VP9),
        Some("mkv") => ("matroska", H264),
        // The index in front, so that a player can start before it has the whole file.
        _ => ("mp4 -movflags +faststart", H264),
    };
    let color = match Matrix::for_height(options.size.1) {
        Matrix::Bt601 => "smpte170m",
        Matrix::Bt709 => "bt709",
    };
    // Tagged on the frames, for filters, and on the stream, for the muxer. 4:2:0 encoders refuse odd sizes.
    let filters = format!(
        "crop=trunc(iw/2)*2:trunc(ih/2)*2,\
         setparams=range=tv:colorspace={color}:color_primaries={color}:color_trc={color}"
    );
    // Named as a file, so that neither a dash nor a colon in it means anything.
    let mut output = OsString::from("file:");
    output.push(staged.part());
    let mut command = Command::new("ffmpeg");
    command
        .args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-f", "yuv4mpegpipe", "-i", "pipe:0"])
        .args(["-vf", &filters, "-pix_fmt", "yuv420p", "-color_range", "tv"])
        .args(["-colorspace", color, "-color_primaries", color, "-color_trc", color])
        .args(encoder)
        .arg("-f")
        .args(muxer.split(' '))
        .arg(output)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        // Ctrl-C on a terminal goes to the whole group, and ffmpeg must live to see the last frame.
        .process_group(0);
    command
}

/// Visually lossless, at several times the speed of the default preset.
const H264: &[&str] = &["-c:v", "libx264", "-preset", "veryfast", "-crf", "18"];

const VP9: &[&str] =
    &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "5", "-row-mt", "1"];

fn last_lines(stderr: ChildStderr) -> VecDeque<String> {
    let mut lines = VecDeque::with_capacity(LAST_LINES + 1);
    for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line).trim().to_owned();
        if !line.is_empty() {
            lines.push_back(line);
        }
        if lines.len() > LAST_LINES {
            lines.pop_front();
        }
    }
    lines
}

impl Sink for Ffmpeg {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        let Some(input) = &mut self.encoder.input else { return Ok(ControlFlow::Break(())) };
        match input.write(frame) {
            // ffmpeg closes its input only by ending: how it ended tells more than the broken pipe.
            Err(SinkError::Write { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => {
                self.wait()?;
                let (status, said) = ("ended early".into(), String::new());
                Err(SinkError::Ffmpeg { path: self.staged.path().to_owned(), status, said })
            }
            written => written.map(ControlFlow::Continue),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<(), SinkError> {
        if let Some(input) = self.encoder.input.take() {
            match input.into_inner() {
                Err(SinkError::Write { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => {}
                done => drop(done?),
            }
        }
        self.wait()?;
        self.staged.commit()
    }

    fn describe(&self) -> String {
        format!("ffmpeg to {}", self.staged.path().display())
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // Without effect on a process that has ended and was waited for.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
