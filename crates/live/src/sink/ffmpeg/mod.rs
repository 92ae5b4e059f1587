//! Compressed video through the ffmpeg program, which reads time-stamped frames from its standard input.

mod command;
mod raw;

use std::io::{self, ErrorKind};
use std::ops::ControlFlow;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use self::command::Format;
use self::raw::RawVideo;
use super::output::OutputFile;
use super::pipe::Pipe;
use super::{Ending, Options, Sink, SinkError, Sound, Written, check_size};
use bokehcam::frame::ColorImage;
use bokehcam_files::atomic_file::PartFile;
use bokehcam_files::process::{Process, ProcessEnd};

/// Longest wait for an encoder to start reading; frames are sent to it in any case.
const STARTUP_TIMEOUT: Duration = Duration::from_secs(2);

/// A file encoded by a child process: H.264 in `.mp4` and `.mkv`, VP9 in `.webm`, ProRes 4444 in `.mov`, with the frames'
/// time stamps.
pub struct Ffmpeg {
    // Fields drop in this order: the process before the file that it writes.
    input: Option<RawVideo<Pipe>>,
    process: Process,
    format: Format,
    output: OutputFile,
    size: (u32, u32),
    sound: Option<Sound>,
    period_ns: u64,
    /// Times of the first and the last frame.
    span_ns: Option<(u64, u64)>,
    stop: Arc<AtomicBool>,
}

impl Ffmpeg {
    /// Starts ffmpeg, found through `PATH`, to write `path`, and waits until it reads: loading it takes tenths of a
    /// second, and the first frame would delay those behind it by that time.
    ///
    /// # Errors
    /// The file exists and `force` is not set, or ffmpeg is missing or cannot be started.
    pub fn create(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let output = OutputFile::create(path, options.force)?;
        let format = Format::for_path(path);
        let alpha = options.alpha && format.keeps_alpha();
        let form = (options.size.1, alpha);
        let mut command = command::encode_command(&format, output.part_path(), form, options.threads);
        let mut process = Process::start(&mut command, &options.stop).map_err(|cause| match cause.kind() {
            ErrorKind::NotFound => SinkError::NoFfmpeg { path: path.to_owned() },
            _ => SinkError::Write { path: path.to_owned(), cause },
        })?;
        let mut watchdog = process.watchdog();
        let pipe = match process.stdin() {
            Some(stdin) => Pipe::from_owned(OwnedFd::from(stdin), move |blocked| !watchdog.is_hung(blocked)),
            None => Err(ErrorKind::BrokenPipe.into()),
        };
        let input = pipe.and_then(|pipe| RawVideo::new(pipe, options.size, options.period_ns, alpha));
        let input = input.map_err(SinkError::write(path))?;
        input.writer.wait_drained(STARTUP_TIMEOUT).map_err(SinkError::write(path))?;
        Ok(Self {
            input: Some(input),
            process,
            format,
            output,
            size: options.size,
            sound: options.sound.clone(),
            period_ns: options.period_ns,
            span_ns: None,
            stop: Arc::clone(&options.stop),
        })
    }

    /// Whether a file of this name keeps an alpha channel.
    pub fn keeps_alpha_in(path: &Path) -> bool {
        Format::for_path(path).keeps_alpha()
    }

    /// Closes the input of ffmpeg and waits for its end, or kills it if it `is_hung`; then checks its outcome.
    fn finish_encoding(&mut self, is_hung: bool) -> Result<(), SinkError> {
        self.input = None;
        let ended = if is_hung { Ok(self.process.kill_hung()) } else { self.process.wait() };
        check_outcome(ended, self.output.path(), self.output.part_path())
    }

    /// Copies the file to one with the sound, and an mp4 to one with its index at the front. If that fails, for example
    /// on a full disk, the file stays as it is.
    fn improve_file(&mut self) {
        if let Some((sound, (first_ns, last_ns))) = self.sound.take().zip(self.span_ns) {
            let start_s = sound.start_s + first_ns as f64 / 1e9;
            let length_s = (last_ns - first_ns + self.period_ns) as f64 / 1e9;
            let sound = Sound { start_s, ..sound };
            let copy = |with_sound: bool| {
                let sound = (&sound, with_sound);
                self.copy(|from, to| command::sound_command(&self.format, from, sound, length_s, to))
            };
            let copied = copy(true).or_else(|error| {
                let error = error.to_string();
                let is_foreign = error.contains("not currently supported in container");
                let why = if is_foreign { "files of this kind do not hold it; .mkv and .mov do" } else { &*error };
                let (path, from) = (self.output.path().display(), sound.path.display());
                tracing::warn!("{path}: without the sound of {from}, which cannot be copied: {why}");
                copy(false)
            });
            if let Ok(part) = copied {
                return self.output.replace_part(part);
            }
        }
        if let Some(muxer) = self.format.faststart() {
            match self.copy(|from, to| command::faststart_command(muxer, from, to)) {
                Ok(part) => self.output.replace_part(part),
                Err(error) => tracing::info!("{}: its index stays fragmented: {error}", self.output.path().display()),
            }
        }
    }

    /// Runs the command that copies the file to a new one, and returns that.
    fn copy(&self, command: impl Fn(&Path, &Path) -> Command) -> Result<PartFile, SinkError> {
        let path = self.output.path();
        let part = PartFile::create(path).map_err(SinkError::write(path))?;
        let mut command = command(self.output.part_path(), part.part_path());
        let ended = Process::start(&mut command, &self.stop).and_then(|mut process| process.wait());
        check_outcome(ended, path, part.part_path()).map(|()| part)
    }

    /// Writes a frame; without an alpha channel, it is opaque.
    fn write(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> Written {
        check_size(self.size, frame.size())?;
        let Some(input) = &mut self.input else { return Ok(ControlFlow::Break(())) };
        if let Err(error) = self.output.check_exists() {
            // It still completes the file, which can be copied; its result adds no information.
            let _ = self.finish_encoding(false);
            return Err(self.output.fail(error));
        }
        let Err(cause) = input.write_frame(frame, alpha, time_ns) else {
            self.output.frames += 1;
            self.span_ns = Some((self.span_ns.map_or(time_ns, |(first_ns, _)| first_ns), time_ns));
            return Ok(ControlFlow::Continue(()));
        };
        let path = self.output.path().to_owned();
        let error = match cause.kind() {
            // ffmpeg closes its input only by exiting: its exit status is more informative than the broken pipe.
            ErrorKind::BrokenPipe | ErrorKind::TimedOut => {
                match self.finish_encoding(cause.kind() == ErrorKind::TimedOut) {
                    Ok(()) => SinkError::Ffmpeg { path, status: "ended early".into(), stderr: String::new() },
                    Err(error) => error,
                }
            }
            _ => SinkError::Write { path, cause },
        };
        Err(self.output.fail(error))
    }
}

/// Messages of ffmpeg about frames missing from a file, though its exit status may be success.
const LOSS_MESSAGES: [&str; 5] =
    ["av_interleaved_write_frame", "Error writing", "Error muxing", "No space left", "Input/output error"];

/// Fails unless ffmpeg succeeded, reported no losses, and wrote to the file `part`. `path` is for the message.
fn check_outcome(ended: io::Result<ProcessEnd>, path: &Path, part: &Path) -> Result<(), SinkError> {
    let ProcessEnd { status, stderr } = ended.map_err(SinkError::write(path))?;
    let path = path.to_owned();
    let failed = |status: &str| match stderr.contains("No space left on device") {
        true => SinkError::Full { path: path.clone() },
        false => SinkError::Ffmpeg { path: path.clone(), status: status.into(), stderr: stderr.clone() },
    };
    match status {
        None => Err(failed("it hung, and was killed")),
        Some(status) if !status.success() => Err(failed(&status.to_string())),
        Some(_) if LOSS_MESSAGES.iter().any(|message| stderr.contains(message)) => Err(failed("frames are missing")),
        Some(_) if part.metadata().map_err(SinkError::write(&path))?.len() == 0 => Err(failed("it wrote nothing")),
        Some(_) => Ok(()),
    }
}

impl Sink for Ffmpeg {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Written {
        self.write(frame, &[], time_ns)
    }

    fn keeps_alpha(&self) -> bool {
        self.input.as_ref().is_some_and(RawVideo::has_alpha)
    }

    fn write_with_alpha(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> Written {
        self.write(frame, alpha, time_ns)
    }

    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        if self.output.has_ended() {
            return Ok(());
        }
        if self.output.frames == 0 {
            tracing::warn!("{}: there was no frame, so there is no file", self.output.path().display());
            self.output.discard();
            return Ok(());
        }
        let ended = self.finish_encoding(false);
        match self.output.check_exists().and(ended) {
            Ok(()) => {
                self.improve_file();
                self.output.complete(ending)
            }
            Err(error) => Err(self.output.fail(error)),
        }
    }

    fn describe(&self) -> String {
        format!("ffmpeg to {}", self.output.path().display())
    }
}
