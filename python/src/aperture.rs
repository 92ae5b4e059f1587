//! Lens openings.

use std::sync::Arc;

use bokehcam::bokeh::aperture::{self, Picture, Shape};
use bokehcam::bokeh::low_rank::Decomposition;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::prelude::*;

use crate::errors;

/// A lens opening, with its soft rim.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Aperture {
    pub shape: aperture::Aperture,
    pub rim: f32,
}

/// Columns `(rank, size)`, rows `(rank, size)`, singular values `(size,)` and the relative error.
type LowRank<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, f64);

#[pymethods]
impl Aperture {
    /// By settings named as on the command line, or with the outline of a grey `picture`, 0 to 1.
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

    /// The mask of `size` x `size` cells, which sums to 1.
    fn kernel<'py>(&self, py: Python<'py>, size: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mask = py.detach(|| normalised(&self.shape.mask(size, self.rim)));
        mask.values.to_pyarray(py).reshape([size, size])
    }

    /// About `count` points of the opening `(n, 2)` in units of its radius, evenly spread; the rim is taken as hard.
    fn points<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = py.detach(|| aperture::lens_points(&self.shape, count));
        let values: Vec<f64> = points.iter().flat_map(|point| [point.x, point.y]).collect();
        values.to_pyarray(py).reshape([points.len(), 2])
    }

    /// The first `rank` terms of the mask's singular value decomposition.
    fn low_rank<'py>(&self, py: Python<'py>, rank: usize, size: usize) -> PyResult<LowRank<'py>> {
        let terms = py.detach(|| Decomposition::of(&normalised(&self.shape.mask(size, self.rim))));
        let scaled = |vectors: &[f64]| -> Vec<f64> {
            let of_term = |(term, vector): (usize, &[f64])| -> Vec<f64> {
                let weight = terms.sigma[term].sqrt();
                vector.iter().map(|value| value * weight).collect()
            };
            vectors.chunks(size).take(rank).enumerate().flat_map(of_term).collect()
        };
        let array = |values: Vec<f64>| values.to_pyarray(py).reshape([rank, size]);
        let (columns, rows) = (array(scaled(&terms.u))?, array(scaled(&terms.v))?);
        Ok((columns, rows, terms.sigma.to_pyarray(py), terms.relative_error(rank)))
    }
}

fn normalised(mask: &aperture::Mask) -> aperture::Mask {
    let sum: f64 = mask.values.iter().sum();
    aperture::Mask { values: mask.values.iter().map(|value| value / sum).collect(), ..*mask }
}
