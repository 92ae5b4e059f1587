//! YUV4MPEG2: uncompressed video that players and encoders read from a file or a pipe.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::ops::ControlFlow;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};

use super::rate::frame_rate;
use super::staged::Staged;
use super::yuv::{Converter, Matrix};
use super::{Options, Sink, SinkError, check_size};
use crate::frame::ColorImage;

/// A y4m stream into anything that takes bytes: 4:2:0, limited range, BT.709 from 720 rows on, else BT.601.
pub struct Y4m<W: Write> {
    to: W,
    name: PathBuf,
    size: (u32, u32),
    converter: Converter,
    /// Header of the stream where it is not written yet, header of the frame, planes.
    bytes: Vec<u8>,
}

impl<W: Write> Y4m<W> {
    /// A stream into `to`, which `name` stands for in messages. The header goes out with the first frame.
    pub fn new(to: W, name: &Path, options: &Options) -> Self {
        let (width, height) = options.size;
        let (rate, scale) = frame_rate(options.period_ns);
        let header = format!("YUV4MPEG2 W{width} H{height} F{rate}:{scale} Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n");
        let converter = Converter::new(Matrix::for_height(height));
        Self { to, name: name.to_owned(), size: options.size, converter, bytes: header.into_bytes() }
    }

    /// Writes one frame.
    ///
    /// # Errors
    /// The frame has another size, or writing failed.
    pub fn write(&mut self, frame: &ColorImage) -> Result<(), SinkError> {
        check_size(self.size, frame)?;
        self.bytes.extend_from_slice(b"FRAME\n");
        self.converter.append(frame, &mut self.bytes);
        let written = self.to.write_all(&self.bytes);
        self.bytes.clear();
        written.map_err(SinkError::write(&self.name))
    }

    /// Writes the header if no frame has done so, and gives the writer back.
    ///
    /// # Errors
    /// Writing failed.
    pub fn into_inner(mut self) -> Result<W, SinkError> {
        self.to.write_all(&self.bytes).and_then(|()| self.to.flush()).map_err(SinkError::write(&self.name))?;
        Ok(self.to)
    }
}

impl Y4m<File> {
    /// A stream on standard output, past the standard library's line buffer.
    ///
    /// # Errors
    /// Standard output is closed.
    pub fn stdout(options: &Options) -> Result<Self, SinkError> {
        let name = Path::new("standard output");
        let stdout = io::stdout().as_fd().try_clone_to_owned().map_err(SinkError::write(name))?;
        Ok(Self::new(File::from(stdout), name, options))
    }
}

/// A stream whose reader may go at any time, which ends the run but is no fault.
impl<W: Write + Send> Sink for Y4m<W> {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        match self.write(frame) {
            Err(SinkError::Write { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => Ok(ControlFlow::Break(())),
            written => written.map(ControlFlow::Continue),
        }
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        match self.into_inner() {
            Err(SinkError::Write { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => Ok(()),
            done => done.map(drop),
        }
    }

    fn describe(&self) -> String {
        format!("y4m on {}", self.name.display())
    }
}

/// A y4m file.
pub struct Y4mFile {
    stream: Y4m<File>,
    staged: Staged,
}

impl Y4mFile {
    /// Opens the file for writing, beside its name.
    ///
    /// # Errors
    /// It exists and `force` is not set, or cannot be written.
    pub fn create(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let staged = Staged::new(path, options.force)?;
        let file = File::create(staged.part()).map_err(SinkError::write(path))?;
        Ok(Self { stream: Y4m::new(file, path, options), staged })
    }
}

impl Sink for Y4mFile {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        self.stream.write(frame).map(ControlFlow::Continue)
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        self.stream.into_inner()?;
        self.staged.commit()
    }

    fn describe(&self) -> String {
        format!("y4m file {}", self.staged.path().display())
    }
}
