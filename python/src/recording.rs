//! Recordings as random-access frames.

use std::path::PathBuf;

use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_media::recording::{self, Options, RecordingError, Scratch};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::errors;

/// An opened recording.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Recording(recording::Recording);

/// Colour (height, width, 3), depth in metres and the right camera's luma (height, width), if available.
type Frame<'py> = (Bound<'py, PyArray3<u8>>, Option<Bound<'py, PyArray2<f32>>>, Option<Bound<'py, PyArray2<u8>>>);

#[pymethods]
impl Recording {
    #[new]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        depth_scale: Option<f32>,
        depth_invalid: Option<u16>,
        keep_going: bool,
    ) -> PyResult<Self> {
        let options = Options { depth_scale, depth_invalid, keep_going, ..Options::default() };
        py.detach(|| recording::Recording::open(&path, &options)).map(Self).map_err(error)
    }

    fn layout(&self) -> &'static str {
        self.0.layout()
    }

    fn len(&self) -> usize {
        self.0.len()
    }

    fn size(&self) -> (u32, u32) {
        self.0.size()
    }

    fn period_ns(&self) -> u64 {
        self.0.period_ns()
    }

    fn has_depth(&self) -> bool {
        self.0.has_depth()
    }

    fn has_right(&self) -> bool {
        self.0.stereo_geometry().is_some()
    }

    fn disparities(&self) -> Option<u32> {
        self.0.disparity_count()
    }

    /// Returns the time of a frame; panics if the index is out of range.
    fn time_ns(&self, index: usize) -> u64 {
        self.0.time_ns(index)
    }

    fn read<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Frame<'py>> {
        let read = || -> Result<_, RecordingError> {
            let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
            let mut scratch = Scratch::default();
            self.0.read_color(index, &mut scratch, &mut color)?;
            if self.0.has_depth() {
                self.0.read_depth(index, &mut scratch, &mut depth)?;
            }
            if self.0.stereo_geometry().is_some() {
                self.0.read_right(index, &mut scratch, &mut right)?;
            }
            Ok((color, depth, right))
        };
        let (color, depth, right) = py.detach(read).map_err(error)?;
        let (width, height) = color.size();
        let rgb = PyArray1::from_vec(py, color.rgb).reshape([height as usize, width as usize, 3])?;
        let depth = self.0.has_depth().then(|| plane(py, depth.metres, depth.width)).transpose()?;
        let right = self.0.stereo_geometry().map(|_| plane(py, right.luma, right.width)).transpose()?;
        Ok((rgb, depth, right))
    }
}

fn plane<T: Element>(py: Python<'_>, values: Vec<T>, width: u32) -> PyResult<Bound<'_, PyArray2<T>>> {
    let (rows, columns) = (values.len() / (width as usize).max(1), width as usize);
    PyArray1::from_vec(py, values).reshape([rows, columns])
}

fn error(error: RecordingError) -> PyErr {
    match error {
        RecordingError::DepthScale(_) => errors::value(error),
        _ => errors::os(error),
    }
}
