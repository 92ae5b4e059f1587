//! Apertures.

use std::sync::Arc;

use bokehcam::bokeh::aperture::{self, Picture, Shape};
use bokehcam::bokeh::low_rank::Decomposition;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::prelude::*;

use crate::errors;

/// An aperture with its soft rim.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Aperture {
    pub shape: aperture::Aperture,
    pub rim: f32,
}

/// Column vectors `(rank, size)`, row vectors `(rank, size)`, singular values `(size,)` and the relative error.
type LowRank<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, f64);

#[pymethods]
impl Aperture {
    /// Creates an aperture from settings named like the flags, or from the outline of a grey `picture`, 0 to 1.
    #[new]
    fn new(settings: Vec<(String, String)>, picture: Option<PyReadonlyArray2<'_, f32>>) -> PyResult<Self> {
        let look = errors::look(&settings)?;
        let mut shape = look.aperture;
        if let Some(picture) = picture {
            let [height, width] = [picture.shape()[0], picture.shape()[1]].map(|side| side as u32);
            let grey = picture.as_slice()?.to_vec();
            shape.shape = Shape::Picture(Arc::new(Picture { file: None, width, height, grey }));
        }
        Ok(Self { shape, rim: look.rim })
    }

    /// Returns the mask of `size` x `size` cells, normalised to sum 1.
    fn kernel<'py>(&self, py: Python<'py>, size: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mask = py.detach(|| normalise(&self.shape.to_mask(size, self.rim)));
        mask.values.to_pyarray(py).reshape([size, size])
    }

    /// Returns about `count` evenly spread points of the aperture `(n, 2)`, in units of its radius, without the soft
    /// rim.
    fn points<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = py.detach(|| aperture::lens_points(&self.shape, count));
        let values: Vec<f64> = points.iter().flat_map(|point| [point.x, point.y]).collect();
        values.to_pyarray(py).reshape([points.len(), 2])
    }

    /// Returns the first `rank` terms of the mask's singular value decomposition.
    fn low_rank<'py>(&self, py: Python<'py>, rank: usize, size: usize) -> PyResult<LowRank<'py>> {
        let terms = py.detach(|| Decomposition::new(&normalise(&self.shape.to_mask(size, self.rim))));
        let scaled = |vectors: &[f64]| -> Vec<f64> {
            let scale_term = |(term, vector): (usize, &[f64])| -> Vec<f64> {
                let weight = terms.sigma[term].sqrt();
                vector.iter().map(|value| value * weight).collect()
            };
            vectors.chunks(size).take(rank).enumerate().flat_map(scale_term).collect()
        };
        let array = |values: Vec<f64>| values.to_pyarray(py).reshape([rank, size]);
        let (columns, rows) = (array(scaled(&terms.u))?, array(scaled(&terms.v))?);
        Ok((columns, rows, terms.sigma.to_pyarray(py), terms.relative_error(rank)))
    }
}

fn normalise(mask: &aperture::Mask) -> aperture::Mask {
    let sum: f64 = mask.values.iter().sum();
    aperture::Mask { values: mask.values.iter().map(|value| value / sum).collect(), ..*mask }
}
