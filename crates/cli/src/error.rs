//! What can go wrong between the arguments and the pipeline.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bokehcam::bokeh::BokehError;
use bokehcam::calibration::CalibrationError;
use bokehcam::capture::CaptureError;
use bokehcam::depth::DepthError;
use bokehcam::files::input;
use bokehcam::look::LookError;
use bokehcam::pipeline::Fault;
use bokehcam::recording::RecordingError;
use bokehcam::sink::SinkError;
use bokehcam::source::SourceError;

/// Why a command did not do what was asked for.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The arguments do not make sense together.
    #[error("{0}")]
    Usage(String),
    /// The settings file cannot be used.
    #[error("{}:{line}: {what}", path.display())]
    Settings {
        path: PathBuf,
        line: usize,
        /// What is wrong, and what is accepted.
        what: String,
    },
    /// Something would be overwritten.
    #[error("{} exists: choose another name, or give --force to overwrite it", .0.display())]
    Exists(PathBuf),
    /// Something would be overwritten that never is.
    #[error("{} exists, and stays as it is: choose another name", .0.display())]
    #[cfg(feature = "camera")]
    Stays(PathBuf),
    /// A file or folder cannot be read or written.
    #[error("{}: {}", path.display(), input::said(source))]
    Io {
        /// The file or folder.
        path: PathBuf,
        source: io::Error,
    },
    /// The report of a run could not have its name.
    #[error("{error}; the report is kept as {}", kept.display())]
    ReportKept {
        error: Box<CliError>,
        /// The file.
        kept: PathBuf,
    },
    /// There is no window, or it failed.
    #[error(transparent)]
    #[cfg(feature = "window")]
    Window(#[from] bokehcam_window::window::WindowError),
    /// A preview ended without ever having shown a frame.
    #[error("{0}")]
    #[cfg(feature = "window")]
    NoFrames(String),
    /// An output of a preview failed.
    #[error("{0}")]
    #[cfg(feature = "window")]
    OutputFailed(String),
    /// No plate could be taken.
    #[error("no plate: {0}")]
    NoPlate(String),
    /// A run does not do what it was asked for.
    #[error("{0}")]
    Control(String),
    /// The service cannot be switched.
    #[error("{0}")]
    Service(String),
    /// A diagram cannot be drawn.
    #[error("the diagram cannot be drawn: {0}")]
    Diagram(String),
    /// No handler of signals can be set.
    #[error("signals cannot be handled: {0}")]
    Signals(String),
    /// This program was built so.
    #[error("this bokehcam was built without cameras: build it with the feature camera")]
    #[cfg(not(feature = "camera"))]
    NoCameras,
    /// A name leads to no device.
    #[error(transparent)]
    #[cfg(feature = "camera")]
    Node(#[from] bokehcam::v4l2::node::NodeError),
    /// A device of another sort.
    #[error("{}: this is no video device", .0.display())]
    #[cfg(feature = "camera")]
    NotVideo(PathBuf),
    /// A name means no camera of PipeWire's.
    #[error("there is no camera '{0}' in PipeWire; `bokehcam devices` lists what there is")]
    #[cfg(feature = "camera")]
    NoShared(String),
    /// `doctor` found something to be missing.
    #[error("there is no {0} to work with: see above for what to do")]
    #[cfg(feature = "camera")]
    NotReady(String),
    /// A picture or a recording cannot be read or written.
    #[error(transparent)]
    Recording(RecordingError),
    /// The settings make no look.
    #[error(transparent)]
    Look(#[from] LookError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// There is no depth.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The calibration of two eyes cannot be used.
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
            // Here it is known what the way to overwrite is called.
            RecordingError::Exists { path } => CliError::Exists(path),
            other => CliError::Recording(other),
        }
    }
}

impl CliError {
    /// For `map_err`: adds the file's path to an I/O error.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| CliError::Io { path, source }
    }

    /// Whether the caller has to write something differently.
    pub fn is_wrong_argument(&self) -> bool {
        if let CliError::Source(error) = self {
            return error.is_wrong_argument();
        }
        matches!(
            self,
            CliError::Usage(_)
                | CliError::Settings { .. }
                | CliError::Look(LookError::Lens)
                | CliError::Bokeh(BokehError::TooWide { .. })
        )
    }

    /// 2 for what the caller has to write differently, else 1.
    pub fn exit_code(&self) -> ExitCode {
        if self.is_wrong_argument() { ExitCode::from(2) } else { ExitCode::FAILURE }
    }

    /// Whether its cause is that the reader of our output went away, as in `... | head`: that is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(self);
        while let Some(error) = cause {
            if error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe) {
                return true;
            }
            cause = error.source();
        }
        false
    }
}
