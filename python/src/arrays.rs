//! Arrays as slices.

use numpy::{Element, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// An array that is read, of 8-bit sRGB or linear light.
pub enum Image<'py> {
    /// 8-bit sRGB.
    Srgb(PyReadonlyArrayDyn<'py, u8>, PyReadwriteArrayDyn<'py, u8>),
    /// Linear light.
    Linear(PyReadonlyArrayDyn<'py, f32>, PyReadwriteArrayDyn<'py, f32>),
}

impl<'py> Image<'py> {
    /// A picture, and the array of the same kind that its result goes to.
    ///
    /// # Errors
    /// They are of another kind, or not of one.
    pub fn of(image: &Bound<'py, PyAny>, out: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let (Ok(image), Ok(out)) = (read(image), write(out)) {
            return Ok(Self::Srgb(image, out));
        }
        match (read(image), write(out)) {
            (Ok(image), Ok(out)) => Ok(Self::Linear(image, out)),
            _ => Err(PyTypeError::new_err("image and out are arrays of uint8, or of float32, that do not overlap")),
        }
    }
}

/// An array that is read.
///
/// # Errors
/// It has another type.
pub fn read<'py, T: Element>(array: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.cast::<numpy::PyArrayDyn<T>>()?.try_readonly()?)
}

/// An array that is written.
///
/// # Errors
/// It has another type, is read-only or in use.
pub fn write<'py, T: Element>(array: &Bound<'py, PyAny>) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
    Ok(array.cast::<numpy::PyArrayDyn<T>>()?.try_readwrite()?)
}

/// The index of the first number that is not finite, and the least and the largest of an array; both 0 of an empty one.
#[pyfunction]
pub fn survey(py: Python<'_>, array: PyReadonlyArrayDyn<'_, f32>) -> PyResult<(Option<usize>, f32, f32)> {
    let values = array.as_slice()?;
    py.detach(|| {
        let (mut low, mut high, mut odd) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES], [0.0f32; LANES]);
        let (vectors, rest) = values.as_chunks::<LANES>();
        // Comparisons instead of `min`, and a product that is not 0 where a factor is not finite: vector code.
        let mut add = |values: &[f32]| {
            for (k, &value) in values.iter().enumerate() {
                low[k] = if value < low[k] { value } else { low[k] };
                high[k] = if value > high[k] { value } else { high[k] };
                odd[k] += value * 0.0;
            }
        };
        vectors.iter().for_each(|vector| add(vector));
        add(rest);
        if odd.iter().sum::<f32>() != 0.0 {
            return Ok((values.iter().position(|value| !value.is_finite()), 0.0, 0.0));
        }
        let (low, high) =
            (low.into_iter().fold(f32::INFINITY, f32::min), high.into_iter().fold(f32::NEG_INFINITY, f32::max));
        Ok(if values.is_empty() { (None, 0.0, 0.0) } else { (None, low, high) })
    })
}

/// Numbers that are looked at side by side.
const LANES: usize = 16;
