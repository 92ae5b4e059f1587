//! Access to NumPy arrays as slices.

use numpy::{Element, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// Input and output arrays of a picture, of 8-bit sRGB or linear light.
pub enum Image<'py> {
    /// 8-bit sRGB.
    Srgb(PyReadonlyArrayDyn<'py, u8>, PyReadwriteArrayDyn<'py, u8>),
    /// Linear light.
    Linear(PyReadonlyArrayDyn<'py, f32>, PyReadwriteArrayDyn<'py, f32>),
}

impl<'py> Image<'py> {
    /// Borrows a picture, and the output array of the same type.
    ///
    /// # Errors
    /// Fails if the types differ or are unsupported.
    pub fn from_arrays(image: &Bound<'py, PyAny>, out: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let (Ok(image), Ok(out)) = (read(image), write(out)) {
            return Ok(Self::Srgb(image, out));
        }
        match (read(image), write(out)) {
            (Ok(image), Ok(out)) => Ok(Self::Linear(image, out)),
            _ => Err(PyTypeError::new_err("image and out must be arrays of uint8, or of float32, that do not overlap")),
        }
    }
}

/// Borrows an array for reading.
///
/// # Errors
/// Fails if it has another type.
pub fn read<'py, T: Element>(array: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.cast::<numpy::PyArrayDyn<T>>()?.try_readonly()?)
}

/// Borrows an array for writing.
///
/// # Errors
/// Fails if it has another type, is read-only or is borrowed.
pub fn write<'py, T: Element>(array: &Bound<'py, PyAny>) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
    Ok(array.cast::<numpy::PyArrayDyn<T>>()?.try_readwrite()?)
}

/// Returns the index of the first number that is not finite, and the minimum and maximum; both are 0 for an empty
/// array.
#[pyfunction]
pub fn survey(py: Python<'_>, array: PyReadonlyArrayDyn<'_, f32>) -> PyResult<(Option<usize>, f32, f32)> {
    let values = array.as_slice()?;
    py.detach(|| {
        let (mut low, mut high, mut faults) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES], [0.0f32; LANES]);
        let (vectors, rest) = values.as_chunks::<LANES>();
        // Vectorisable: comparisons instead of `min`, and a product that is NaN for any factor that is not finite.
        let mut add = |values: &[f32]| {
            for (k, &value) in values.iter().enumerate() {
                low[k] = if value < low[k] { value } else { low[k] };
                high[k] = if value > high[k] { value } else { high[k] };
                faults[k] += value * 0.0;
            }
        };
        vectors.iter().for_each(|vector| add(vector));
        add(rest);
        if faults.iter().sum::<f32>() != 0.0 {
            return Ok((values.iter().position(|value| !value.is_finite()), 0.0, 0.0));
        }
        let (low, high) =
            (low.into_iter().fold(f32::INFINITY, f32::min), high.into_iter().fold(f32::NEG_INFINITY, f32::max));
        Ok(if values.is_empty() { (None, 0.0, 0.0) } else { (None, low, high) })
    })
}

/// Number of values per vector.
const LANES: usize = 16;
