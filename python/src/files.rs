//! Reading and writing of single pictures.

use std::path::PathBuf;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::still;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::{errors, pictures};

/// Reads a PNG or JPEG, rotated upright.
#[pyfunction]
pub fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let ColorImage { width, height, rgb } = py.detach(|| still::read_color(&path)).map_err(errors::os)?;
    PyArray1::from_vec(py, rgb).reshape([height as usize, width as usize, 3])
}

/// Reads a depth map in metres, 0 = unknown.
#[pyfunction]
pub fn read_depth(
    py: Python<'_>,
    path: PathBuf,
    depth_scale: f32,
    depth_invalid: Option<u16>,
) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let read = || still::read_depth(&path, depth_scale, depth_invalid);
    let DepthMap { width, height, metres, .. } = py.detach(read).map_err(errors::os)?;
    PyArray1::from_vec(py, metres).reshape([height as usize, width as usize])
}

/// Writes a picture; replaces an existing file only with `overwrite`.
#[pyfunction]
pub fn write_image(py: Python<'_>, path: PathBuf, image: &Bound<'_, PyAny>, overwrite: bool) -> PyResult<()> {
    let color = pictures::color(image)?;
    py.detach(|| still::write_color(&path, &color, overwrite)).map_err(errors::os)
}
