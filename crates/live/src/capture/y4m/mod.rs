//! A stream of y4m on standard input as a camera: raw pictures at a constant rate, from any program.

mod convert;
mod header;

use std::io::{self, IsTerminal};
use std::time::Duration;

use self::convert::Converter;
use self::header::Header;
use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, MAX_WAIT, SourceInfo};
use bokehcam::frame::Stamp;
use bokehcam_files::pipe_reader::{Filled, PipeReader};

/// The name of standard input as a source.
pub const NAME: &str = "-";

/// The name in messages.
const STANDARD_INPUT: &str = "standard input";

/// The first word of a frame.
const FRAME: &[u8] = b"FRAME";

/// Maximum length of a header line; they have less than 100 bytes.
const MAX_LINE_BYTES: usize = 1024;

/// Frames per second of a stream that does not state them.
const DEFAULT_FPS: f64 = 30.0;

/// A late frame is skipped only if it arrives within this time. A later one was written just now by a live program, so
/// that it is the newest.
const SKIP_PATIENCE: Duration = Duration::from_millis(5);

/// Reads the pictures of a stream in order.
pub struct Y4m {
    lines: LineReader,
    header: Header,
    converter: Converter,
    fps: f64,
    limit: Option<u64>,
    picture: Vec<u8>,
    /// Bytes of the picture that have arrived; `None` before the line in front of it.
    filled: Option<usize>,
    /// Number of frames that have arrived.
    arrived: u64,
    /// Number of frames read or skipped.
    delivered: u64,
    has_ended: bool,
}

impl Y4m {
    /// Reads the header of the stream on standard input, and waits for it. Ends after `limit` frames.
    ///
    /// # Errors
    /// Standard input is a terminal or closed, or the header is not one of y4m.
    pub fn stdin(limit: Option<u64>) -> Result<Self, CaptureError> {
        if io::stdin().is_terminal() {
            return Err(fault(
                "it is a terminal: pipe y4m into it, such as `ffmpeg -i FILE.mp4 -f yuv4mpegpipe - | ...`",
            ));
        }
        Self::new(PipeReader::stdin().map_err(|error| fault(error.to_string()))?, limit)
    }

    fn new(pipe: PipeReader, limit: Option<u64>) -> Result<Self, CaptureError> {
        let mut lines = LineReader { pipe, line: Vec::new() };
        while lines.read(MAX_WAIT)? == Filled::Waiting {}
        let header = Header::parse(&String::from_utf8_lossy(&lines.take())).map_err(fault)?;
        if header.is_interlaced {
            tracing::warn!("{STANDARD_INPUT}: interlaced pictures are shown as they are; give ffmpeg -vf yadif");
        }
        if header.fps.is_none() {
            tracing::info!("{STANDARD_INPUT}: without a frame rate, assumed to have {DEFAULT_FPS} frames per second");
        }
        let converter = Converter::new(&header).map_err(|error| fault(error.to_string()))?;
        Ok(Self {
            lines,
            picture: vec![0; converter.picture_bytes()],
            converter,
            fps: header.fps.unwrap_or(DEFAULT_FPS),
            header,
            limit,
            filled: None,
            arrived: 0,
            delivered: 0,
            has_ended: false,
        })
    }

    fn time_ns(&self, frame: u64) -> u64 {
        (frame as f64 / self.fps * 1e9).round() as u64
    }

    /// Reads the next picture as far as it arrives; waits up to `patience` for each part of it.
    fn prepare(&mut self, patience: Duration) -> Result<Filled, CaptureError> {
        if self.arrived > self.delivered {
            return Ok(Filled::Whole);
        }
        if self.has_ended || self.limit.is_some_and(|limit| self.delivered >= limit) {
            return Ok(Filled::End);
        }
        if self.filled.is_none() {
            match self.lines.read(patience)? {
                Filled::Waiting => return Ok(Filled::Waiting),
                Filled::End if self.lines.line.is_empty() => {
                    self.has_ended = true;
                    return Ok(Filled::End);
                }
                Filled::End | Filled::Whole => {}
            }
            let line = self.lines.take();
            if !line.strip_prefix(FRAME).is_some_and(|rest| rest.is_empty() || rest[0] == b' ') {
                return Err(self.fault("a frame does not begin with FRAME"));
            }
        }
        let mut filled = self.filled.unwrap_or(0);
        let result = self.lines.pipe.fill(&mut self.picture, &mut filled, patience);
        self.filled = Some(filled);
        match result.map_err(|error| fault(error.to_string()))? {
            Filled::End => Err(self.fault("it ends within a frame")),
            Filled::Waiting => Ok(Filled::Waiting),
            Filled::Whole => {
                (self.filled, self.arrived) = (None, self.arrived + 1);
                Ok(Filled::Whole)
            }
        }
    }

    fn fault(&self, what: &str) -> CaptureError {
        fault(format!("{what}, after {} frames; start the program that writes it again", self.arrived))
    }
}

/// Reads header lines byte by byte: nothing behind them may be read.
struct LineReader {
    pipe: PipeReader,
    line: Vec<u8>,
}

impl LineReader {
    /// Reads a line, without its end, into `line`, as far as it arrives within `patience`.
    fn read(&mut self, patience: Duration) -> Result<Filled, CaptureError> {
        loop {
            let mut byte = [0];
            match self.pipe.fill(&mut byte, &mut 0, patience).map_err(|error| fault(error.to_string()))? {
                Filled::Whole if byte == *b"\n" => return Ok(Filled::Whole),
                Filled::Whole if self.line.len() < MAX_LINE_BYTES => self.line.extend(byte),
                Filled::Whole => return Err(fault(format!("a header line is longer than {MAX_LINE_BYTES} bytes"))),
                other => return Ok(other),
            }
        }
    }

    fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.line)
    }
}

fn fault(what: impl Into<String>) -> CaptureError {
    CaptureError::Y4m { source_name: STANDARD_INPUT.to_owned(), what: what.into() }
}

impl Camera for Y4m {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: STANDARD_INPUT.to_owned(),
            size: self.header.size_px,
            period_ns: self.time_ns(1),
            frames: self.limit,
            live: false,
            frame_data: FrameData::Color,
        }
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        match self.prepare(MAX_WAIT) {
            Ok(Filled::Whole) => {}
            Ok(Filled::Waiting) => return Ok(Captured::Waiting),
            Ok(Filled::End) => return Ok(Captured::End),
            Err(fault) => {
                // What follows cannot be told apart into frames.
                self.has_ended = true;
                return Ok(Captured::Corrupt(fault));
            }
        }
        self.converter.convert(&self.picture, buffers.color);
        let time_ns = self.time_ns(self.delivered);
        self.delivered += 1;
        Ok(Captured::Frame(Stamp { index: self.delivered as usize - 1, time_ns, captured_ns: None }))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.delivered;
        // A fault comes again with the next frame.
        while self.time_ns(self.delivered) < until_ns && matches!(self.prepare(SKIP_PATIENCE), Ok(Filled::Whole)) {
            self.delivered += 1;
        }
        self.delivered - from
    }
}

#[cfg(test)]
mod tests;
