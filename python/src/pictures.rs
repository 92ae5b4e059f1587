//! Conversion of arrays to the library's pictures.

use bokehcam::color::encode_srgb;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrays;

/// Returns width and height of an array (rows, columns, ...).
pub fn size_of(shape: &[usize]) -> (u32, u32) {
    (shape[1] as u32, shape[0] as u32)
}

/// Converts a picture to 8-bit sRGB: a copy, or linear light rounded to it.
///
/// # Errors
/// Fails if its type is unsupported.
pub fn color(image: &Bound<'_, PyAny>) -> PyResult<ColorImage> {
    if let Ok(image) = arrays::read::<u8>(image) {
        let (width, height) = size_of(image.shape());
        return Ok(ColorImage { width, height, rgb: image.as_slice()?.to_vec() });
    }
    let image = arrays::read::<f32>(image)?;
    let ((width, height), light) = (size_of(image.shape()), image.as_slice()?);
    Ok(ColorImage { width, height, rgb: image.py().detach(|| light.iter().map(|&light| encode_srgb(light)).collect()) })
}

/// Converts a picture to luma for stereo matching, and to colour if it has any.
///
/// # Errors
/// Fails if its type is unsupported.
pub fn stereo_image(image: &Bound<'_, PyAny>) -> PyResult<(GrayImage, Option<ColorImage>)> {
    let mut gray = GrayImage::default();
    if let Ok(image) = arrays::read::<u8>(image)
        && image.ndim() == 2
    {
        (gray.width, gray.height) = size_of(image.shape());
        gray.luma = image.as_slice()?.to_vec();
        return Ok((gray, None));
    }
    let color = color(image)?;
    gray.set_luma_from(&color);
    Ok((gray, Some(color)))
}

/// Converts an array (rows, columns) in metres to a depth map.
///
/// # Errors
/// Fails if it is not contiguous, or not two-dimensional.
pub fn depth(metres: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<DepthMap> {
    if metres.ndim() != 2 {
        return Err(PyTypeError::new_err("depth must have rows and columns"));
    }
    let (width, height) = size_of(metres.shape());
    Ok(DepthMap { width, height, metres: metres.as_slice()?.to_vec(), ..DepthMap::default() })
}
