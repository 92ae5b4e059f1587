//! Why there is no frame.

#[cfg(feature = "camera")]
use super::pixels::NoColor;
use crate::recording::RecordingError;
#[cfg(feature = "camera")]
use crate::v4l2::live::OpenError;

/// Why there is no frame.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The recording's picture cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// No frame lies between start and end.
    #[error(
        "{source_name} has no frame from {start_s} s to {}; it lasts {length_s:.3} s",
        end_s.map_or("its end".into(), |end_s| format!("{end_s} s"))
    )]
    EmptyRange {
        /// The recording.
        source_name: String,
        /// Start of the range.
        start_s: f64,
        /// End of the range.
        end_s: Option<f64>,
        /// From the first frame to the end of the last.
        length_s: f64,
    },
    /// A picture size or rate that no frame can have.
    #[error("a synthetic camera cannot make {width} x {height} pixels at {fps} frames per second")]
    Format {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Frames per second.
        fps: f64,
    },
    /// The camera cannot be opened.
    #[cfg(feature = "camera")]
    #[error(transparent)]
    Camera(#[from] OpenError),
    /// The camera gives no colours.
    #[cfg(feature = "camera")]
    #[error("{camera}: {source}")]
    NoColor {
        /// The camera.
        camera: String,
        /// Its format.
        source: NoColor,
    },
}
