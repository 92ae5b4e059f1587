//! Errors of frame sources.

use std::error::Error;

use super::pixels::NoColor;
use bokehcam::frame::transform::Area;
use bokehcam_media::recording::RecordingError;
use bokehcam_video::VideoError;

/// Why a source delivers no frame.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The recording's picture cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The video file cannot be read.
    #[error(transparent)]
    Video(#[from] VideoError),
    /// A stream is not y4m, or ends too early.
    #[error("{source_name}: {what}")]
    Y4m {
        source_name: String,
        /// What is wrong, and what to do.
        what: String,
    },
    /// No frame lies between start and end.
    #[error(
        "{source_name} has no frame from {start_s} s to {}; it lasts {length_s:.3} s",
        end_s.map_or("its end".into(), |end_s| format!("{end_s} s"))
    )]
    EmptyRange { source_name: String, start_s: f64, end_s: Option<f64>, length_s: f64 },
    /// A picture size or rate that is not supported.
    #[error("a synthetic camera cannot make {width} x {height} pixels at {fps} frames per second")]
    Format { width: u32, height: u32, fps: f64 },
    /// The program was built without a synthetic camera.
    #[error(
        "synthetic: this program was built without that scene; build it with the feature lab, or use `demo`, a \
         recording of it"
    )]
    NoSynthetic,
    /// The built-in demonstration cannot be decoded.
    #[error("demo: it cannot be decoded: {0}")]
    Demo(String),
    /// Side-by-side pictures need an even width.
    #[error(
        "--side-by-side: the pictures of {source_name} are {width}x{height}; left and right pictures side by side need \
         an even width"
    )]
    OddWidth { source_name: String, width: u32, height: u32 },
    /// Side-by-side needs both views in one picture.
    #[error("--side-by-side needs pictures that show left and right side by side, and those of {source_name} do not")]
    NotSideBySide { source_name: String },
    /// Both cameras need the same size.
    #[error(
        "{} gives {}x{} and {} gives {}x{}: both cameras need the same size; choose one that both support with --size",
        names[0], left.0, left.1, names[1], right.0, right.1
    )]
    SizesDiffer {
        /// Left camera, then right camera.
        names: [String; 2],
        left: (u32, u32),
        right: (u32, u32),
    },
    /// The part to keep is not within the pictures.
    #[error(
        "--crop {}: the pictures of {source_name} are {}x{} after --rotate; choose a part of them",
        area.map(|area| area.to_string()).unwrap_or_default(), size_px.0, size_px.1
    )]
    AreaOutside { source_name: String, area: Option<Area>, size_px: (u32, u32) },
    /// The camera cannot be opened.
    #[error(transparent)]
    Camera(Box<dyn Error + Send + Sync>),
    /// The camera delivers no colour pictures.
    #[error("{camera}: {source}")]
    NoColor { camera: String, source: NoColor },
}
