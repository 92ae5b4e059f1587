//! Arrays as the library's own pictures, where it keeps them.

use bokehcam::color::encode_srgb;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrays;

/// Columns and rows of an array (rows, columns, ...).
pub fn size_of(shape: &[usize]) -> (u32, u32) {
    (shape[1] as u32, shape[0] as u32)
}

/// A picture as 8-bit sRGB: a copy, or linear light rounded to it.
///
/// # Errors
/// It is of another kind.
pub fn color(image: &Bound<'_, PyAny>) -> PyResult<ColorImage> {
    if let Ok(image) = arrays::read::<u8>(image) {
        let (width, height) = size_of(image.shape());
        return Ok(ColorImage { width, height, rgb: image.as_slice()?.to_vec() });
    }
    let image = arrays::read::<f32>(image)?;
    let ((width, height), light) = (size_of(image.shape()), image.as_slice()?);
    Ok(ColorImage { width, height, rgb: image.py().detach(|| light.iter().map(|&light| encode_srgb(light)).collect()) })
}

/// A picture for matching, and its colours if it has any.
///
/// # Errors
/// It is of another kind.
pub fn eye(image: &Bound<'_, PyAny>) -> PyResult<(GrayImage, Option<ColorImage>)> {
    let mut gray = GrayImage::default();
    if let Ok(image) = arrays::read::<u8>(image)
        && image.ndim() == 2
    {
        (gray.width, gray.height) = size_of(image.shape());
        gray.luma = image.as_slice()?.to_vec();
        return Ok((gray, None));
    }
    let color = color(image)?;
    gray.set_luma_of(&color);
    Ok((gray, Some(color)))
}

/// A depth map of an array (rows, columns) in metres.
///
/// # Errors
/// It is not contiguous, or not of two dimensions.
pub fn depth(metres: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<DepthMap> {
    if metres.ndim() != 2 {
        return Err(PyTypeError::new_err("depth has rows and columns"));
    }
    let (width, height) = size_of(metres.shape());
    Ok(DepthMap { width, height, metres: metres.as_slice()?.to_vec(), ..DepthMap::default() })
}
