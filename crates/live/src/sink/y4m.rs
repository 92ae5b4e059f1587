//! YUV4MPEG2 (y4m): uncompressed video that players and encoders read from a file or a pipe.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::output::OutputFile;
use super::pipe::Pipe;
use super::rate::frame_rate;
use super::rate_converter::{Action, RateConverter};
use super::yuv::Converter;
use super::{Ending, Options, Sink, SinkError, check_size};
use crate::layout::Range;
use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;

/// Longest gap between frames that a file fills by repeating the last picture; longer ones are cut to this.
const MAX_GAP: Duration = Duration::from_secs(10);
/// Longest such gap in a stream; its viewer falls behind by the same time.
const MAX_LIVE_GAP: Duration = Duration::from_secs(1);

/// A y4m stream into any writer: 4:2:0, limited range, BT.709 from 720 rows on, else BT.601.
pub struct Y4m<W: Write> {
    writer: W,
    name: PathBuf,
    size: (u32, u32),
    converter: Converter,
    rate_converter: RateConverter,
    /// Header of the stream, until it is written.
    header: Vec<u8>,
    /// The last picture, with its header.
    picture: Vec<u8>,
    /// Number of bytes in the header and the complete pictures written.
    complete_bytes: u64,
}

impl<W: Write> Y4m<W> {
    /// Creates a stream into `writer`, which messages call `name`. The header is written with the first frame.
    pub fn new(writer: W, name: &Path, options: &Options) -> Self {
        Self::with_max_gap(writer, name, options, MAX_LIVE_GAP)
    }

    fn with_max_gap(writer: W, name: &Path, options: &Options, max_gap: Duration) -> Self {
        let (width, height) = options.size;
        let (rate, scale) = frame_rate(options.period_ns);
        let header = format!("YUV4MPEG2 W{width} H{height} F{rate}:{scale} Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n");
        Self {
            writer,
            name: name.to_owned(),
            size: options.size,
            converter: Converter::new(YcbcrMatrix::for_height(height), Range::Limited),
            rate_converter: RateConverter::new((rate, scale), max_gap),
            header: header.into_bytes(),
            picture: Vec::new(),
            complete_bytes: 0,
        }
    }

    /// Writes a frame captured at `time_ns`. To keep the rate constant, the previous picture is repeated where frames
    /// are missing, and a frame that comes too early is dropped.
    ///
    /// # Errors
    /// The frame has another size, or writing failed.
    pub fn write(&mut self, frame: &ColorImage, time_ns: u64) -> Result<(), SinkError> {
        check_size(self.size, frame.size())?;
        let missing = match self.rate_converter.schedule(time_ns) {
            Action::Skip => return Ok(()),
            Action::Repeat(missing) => missing,
            Action::RepeatAfterGap(missing, gap) => {
                let (name, max_s) = (self.name.display(), self.rate_converter.max_gap().as_secs());
                tracing::warn!("{name}: there was no picture for {} s, which become {max_s} s of video", gap.as_secs());
                missing
            }
        };
        for _ in 0..missing {
            self.write_picture()?;
        }
        self.picture.clear();
        self.picture.extend_from_slice(b"FRAME\n");
        self.converter.append_planes(frame, &mut self.picture);
        self.write_picture()
    }

    fn write_picture(&mut self) -> Result<(), SinkError> {
        self.write_header()?;
        self.writer.write_all(&self.picture).map_err(SinkError::write(&self.name))?;
        self.complete_bytes += self.picture.len() as u64;
        Ok(())
    }

    fn write_header(&mut self) -> Result<(), SinkError> {
        self.writer.write_all(&self.header).map_err(SinkError::write(&self.name))?;
        self.complete_bytes += self.header.len() as u64;
        self.header.clear();
        Ok(())
    }

    /// Writes the header if no frame has done so, and returns the writer.
    ///
    /// # Errors
    /// Writing failed.
    pub fn into_inner(mut self) -> Result<W, SinkError> {
        self.complete()?;
        Ok(self.writer)
    }

    /// Ends the stream; one without frames gets its header.
    fn complete(&mut self) -> Result<(), SinkError> {
        if self.rate_converter.dropped > 0 {
            let (name, dropped) = (self.name.display(), self.rate_converter.dropped);
            tracing::warn!("{name}: {dropped} frames came faster than its frame rate, and were left out");
        }
        self.write_header()?;
        self.writer.flush().map_err(SinkError::write(&self.name))
    }
}

impl Y4m<Pipe> {
    /// Creates a stream on standard output that bypasses the standard library's line buffer.
    ///
    /// # Errors
    /// Standard output is closed.
    pub fn stdout(options: &Options) -> Result<Self, SinkError> {
        let name = Path::new("standard output");
        let stdout = Pipe::stdout(&options.stop).map_err(SinkError::write(name))?;
        Ok(Self::new(stdout, name, options))
    }
}

/// Returns the kind of an error that means that the reader has gone (`BrokenPipe`) or has stalled (`TimedOut`).
fn reader_error_kind(error: &SinkError) -> Option<ErrorKind> {
    let SinkError::Write { cause, .. } = error else { return None };
    Some(cause.kind()).filter(|kind| matches!(kind, ErrorKind::BrokenPipe | ErrorKind::TimedOut))
}

/// A stream whose reader may go at any time, which ends the run without an error.
impl<W: Write + Send> Sink for Y4m<W> {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        match self.write(frame, time_ns) {
            Err(error) if reader_error_kind(&error) == Some(ErrorKind::TimedOut) => {
                tracing::warn!(
                    "{}: its reader has stopped reading, so the last picture is incomplete",
                    self.name.display()
                );
                // The header may be truncated as well: it must not be written again at the end.
                self.header.clear();
                Ok(ControlFlow::Break(()))
            }
            Err(error) if reader_error_kind(&error).is_some() => Ok(ControlFlow::Break(())),
            written => written.map(ControlFlow::Continue),
        }
    }

    fn finish(mut self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        match self.complete() {
            Err(error) if reader_error_kind(&error).is_some() => Ok(()),
            done => done,
        }
    }

    fn describe(&self) -> String {
        format!("y4m on {}", self.name.display())
    }
}

/// A y4m file.
pub struct Y4mFile {
    stream: Y4m<File>,
    output: OutputFile,
}

impl Y4mFile {
    /// Opens the file for writing, under a temporary name.
    ///
    /// # Errors
    /// The file exists and `force` is not set, or it cannot be written.
    pub fn create(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let output = OutputFile::create(path, options.force)?;
        let file = output.file().and_then(File::try_clone).map_err(SinkError::write(path))?;
        Ok(Self { stream: Y4m::with_max_gap(file, path, options, MAX_GAP), output })
    }

    /// Ends the file after a write error: cuts off an incomplete picture, and keeps the complete ones.
    fn fail(&mut self, error: SinkError) -> SinkError {
        // If that fails, players skip the incomplete picture.
        let _ = self.stream.writer.set_len(self.stream.complete_bytes);
        self.output.fail(error)
    }
}

impl Sink for Y4mFile {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        match self.output.check_exists().and_then(|()| self.stream.write(frame, time_ns)) {
            Ok(()) => {
                self.output.frames += 1;
                Ok(ControlFlow::Continue(()))
            }
            Err(error) => Err(self.fail(error)),
        }
    }

    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        if self.output.has_ended() {
            return Ok(());
        }
        match self.stream.complete() {
            Ok(()) => self.output.complete(ending),
            Err(error) => Err(self.fail(error)),
        }
    }

    fn describe(&self) -> String {
        format!("y4m file {}", self.output.path().display())
    }
}
