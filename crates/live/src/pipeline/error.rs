use std::any::Any;
use std::io;

use crate::capture::CaptureError;
use crate::sink::SinkError;
use crate::stats::Report;
use bokehcam::bokeh::BokehError;
use bokehcam::compute::panic_message;
use bokehcam::depth::DepthError;

/// The error of a failed run, with the report up to the failure.
#[derive(Debug, thiserror::Error)]
#[error("{fault}")]
pub struct PipelineError {
    /// The fault that ended it.
    pub fault: Fault,
    /// The report up to the failure.
    pub report: Box<Report>,
}

/// A fault that ends a run early.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Depth(#[from] DepthError),
    #[error(transparent)]
    Bokeh(#[from] BokehError),
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// The blur needs depth that the source lacks.
    #[error("the effect dof needs depth, and {source_name} has none; use --effect blur or tilt-shift")]
    NoDepth { source_name: String },
    /// The executor returned frames out of order, or none.
    #[error("the blur executor did not return the oldest frame: please report this")]
    LostFrame,
    #[error("the {stage} stage panicked: {message}; please report this")]
    Panic { stage: &'static str, message: String },
    /// The system could not create a thread.
    #[error("cannot start the thread of the {stage} stage: {cause}")]
    Thread { stage: &'static str, cause: io::Error },
}

impl Fault {
    pub(super) fn from_panic(stage: &'static str, payload: &(dyn Any + Send)) -> Self {
        Self::Panic { stage, message: panic_message(payload).to_owned() }
    }
}
