//! Errors between the arguments and the pipeline.

use std::error::Error;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bokehcam::bokeh::BokehError;
use bokehcam::calibration::CalibrationError;
use bokehcam::compute::panic_message;
use bokehcam::depth::DepthError;
use bokehcam::look::LookError;
use bokehcam_files::input;
use bokehcam_live::capture::CaptureError;
use bokehcam_live::pipeline::Fault;
use bokehcam_live::sink::SinkError;
use bokehcam_live::source::SourceError;
use bokehcam_media::recording::RecordingError;

/// Error of a command.
#[allow(missing_docs)] // The messages name the fields.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The arguments contradict each other.
    #[error("{0}")]
    Usage(String),
    /// The settings file cannot be used.
    #[error("{}:{line}: {what}", path.display())]
    Settings {
        path: PathBuf,
        line: usize,
        /// The fault, and the accepted values.
        what: String,
    },
    /// The output exists.
    #[error("{} exists: choose another name, or give --force to overwrite it", .0.display())]
    Exists(PathBuf),
    /// The output exists, and the command has no way to overwrite.
    #[error("{} exists, and stays as it is: choose another name", .0.display())]
    NeverReplaced(PathBuf),
    /// A file or folder cannot be read or written.
    #[error("{}: {}", path.display(), input::format_io_error(source))]
    Io { path: PathBuf, source: io::Error },
    /// The report could not be renamed to its final path.
    #[error("{error}; the report is kept as {}", kept.display())]
    ReportKept { error: Box<CliError>, kept: PathBuf },
    /// A preview ended before its first frame.
    #[error("{0}")]
    NoFrames(String),
    /// An output of a preview failed.
    #[error("{0}")]
    OutputFailed(String),
    /// The snapshot has its settings, but not the picture that it was made from.
    #[error(
        "{}: there is no such file: a snapshot holds its settings, and a preview saves its picture beside it if \
         Reproducible snapshots, under More, is on; or use the settings for another picture: render PICTURE --like \
         NAME.png", .0.display()
    )]
    NoOriginal(PathBuf),
    /// Some of many pictures were not rendered; the reasons are printed.
    #[error("{0}")]
    Incomplete(String),
    /// The plate could not be taken.
    #[error("no plate: {0}")]
    NoPlate(String),
    /// A running instance refused a request.
    #[error("{0}")]
    Control(String),
    /// The service cannot be switched on or off.
    #[error("{0}")]
    Service(String),
    /// A diagram cannot be drawn.
    #[error("the diagram cannot be drawn: {0}")]
    Diagram(String),
    /// A part of the program panicked.
    #[error("a fault in bokehcam: {0}; please report this")]
    Panic(String),
    /// The signal handler cannot be set.
    #[error("signals cannot be handled: {0}")]
    Signals(String),
    /// This program was built without cameras.
    #[error("this bokehcam was built without cameras: build it with the feature camera")]
    NoCameras,
    /// There is no window, or it failed; or a name matches no device.
    #[error(transparent)]
    Part(Box<dyn Error + Send + Sync>),
    /// The file is not a video device.
    #[error("{}: this is not a video device", .0.display())]
    NotVideo(PathBuf),
    /// The name matches no PipeWire camera.
    #[error("there is no camera '{0}' in PipeWire; `bokehcam devices` lists the cameras")]
    NoPipeWireCamera(String),
    /// `doctor` found essential parts missing.
    #[error("there is no {0}: see above for what to do")]
    NotReady(String),
    /// A picture or a recording cannot be read or written.
    #[error(transparent)]
    Recording(RecordingError),
    /// The settings do not form a valid look.
    #[error(transparent)]
    Look(#[from] LookError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// Depth cannot be computed.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The stereo calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The source cannot be opened.
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A stage of the pipeline failed.
    #[error(transparent)]
    Run(#[from] Fault),
    #[error(transparent)]
    Bokeh(#[from] BokehError),
}

impl From<RecordingError> for CliError {
    fn from(error: RecordingError) -> Self {
        match error {
            // This error names the command line's `--force`.
            RecordingError::Exists { path } => CliError::Exists(path),
            other => CliError::Recording(other),
        }
    }
}

impl CliError {
    /// Does a part of a command. A panic becomes an error, so that complete outputs can still be finished.
    pub fn catch_panic<T>(work: impl FnOnce() -> Result<T, Self>) -> Result<T, Self> {
        let done = catch_unwind(AssertUnwindSafe(work));
        done.unwrap_or_else(|panic| Err(Self::Panic(panic_message(&*panic).to_owned())))
    }

    /// Returns a converter for `map_err` that adds the file's path to an I/O error.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| CliError::Io { path, source }
    }

    /// Whether the command line is at fault.
    pub fn is_wrong_argument(&self) -> bool {
        match self {
            CliError::Source(error) => return error.is_wrong_argument(),
            CliError::Look(error) => return error.is_wrong_argument(),
            _ => {}
        }
        matches!(
            self,
            CliError::Usage(_)
                | CliError::Settings { .. }
                | CliError::Bokeh(BokehError::TooWide { .. } | BokehError::Transparent)
        )
    }

    /// Returns 2 if the command line is at fault, else 1.
    pub fn exit_code(&self) -> ExitCode {
        if self.is_wrong_argument() { ExitCode::from(2) } else { ExitCode::FAILURE }
    }

    /// Whether the reader of the output closed it, as in `... | head`, which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        let mut cause: Option<&(dyn Error + 'static)> = Some(self);
        while let Some(error) = cause {
            if error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe) {
                return true;
            }
            cause = error.source();
        }
        false
    }
}
