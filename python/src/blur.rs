//! Blur by a CoC radius per pixel.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use bokehcam::bokeh::slices::{Radii, Sample, SliceBlur};
use bokehcam::look::Effect;
use bokehcam::optics::CocField;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::aperture::Aperture;
use crate::arrays::Image;
use crate::errors;
use crate::signals::Signals;

/// An executor for pictures of one size. Concurrent calls are serialised.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Blur {
    /// Uniform radius in pixels; `None` if each pixel has its own.
    radius_px: Option<f32>,
    executor: Mutex<SliceBlur>,
}

#[pymethods]
impl Blur {
    /// Creates an executor for pictures of `size` (width, height) and radii up to `max_px` (in front of the focal
    /// plane, behind it), or with `uniform` for one radius everywhere, the second of `max_px`.
    #[new]
    #[pyo3(signature = (size, max_px, uniform, settings, aperture, threads))]
    fn new(
        py: Python<'_>,
        size: (u32, u32),
        max_px: (f32, f32),
        uniform: bool,
        settings: Vec<(String, String)>,
        aperture: &Aperture,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let mut look = errors::look(&settings)?;
        look.effect = if uniform { Effect::Blur } else { Effect::Dof };
        (look.aperture, look.rim) = (aperture.shape.clone(), aperture.rim);
        let mut settings = look.blur_settings(size, false).ok_or_else(|| errors::value("nothing to blur"))?;
        (settings.near_max_px, settings.far_max_px) = max_px;
        let executor = py.detach(|| SliceBlur::new(&settings, size, threads)).map_err(errors::value)?;
        Ok(Self { radius_px: uniform.then_some(max_px.1), executor: Mutex::new(executor) })
    }

    /// Blurs `image` (height, width, 3) into `out`, by the radii `coc` (height, width) unless the radius is uniform.
    fn blur(
        &self,
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        coc: Option<PyReadonlyArray2<'_, f32>>,
        out: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let field = CocField::Uniform { radius_px: self.radius_px.unwrap_or(0.0) };
        let coc = match &coc {
            Some(coc) => Radii::Each(coc.as_slice()?),
            None => Radii::Field(&field, None),
        };
        match Image::from_arrays(image, out)? {
            Image::Srgb(image, mut out) => blur(py, &self.executor, image.as_slice()?, coc, out.as_slice_mut()?),
            Image::Linear(image, mut out) => blur(py, &self.executor, image.as_slice()?, coc, out.as_slice_mut()?),
        }
    }
}

/// Blurs without holding Python's GIL, until done or a signal arrives.
pub fn blur<T: Sample>(
    py: Python<'_>,
    executor: &Mutex<SliceBlur>,
    pixels: &[T],
    coc: Radii<'_>,
    out: &mut [T],
) -> PyResult<()> {
    py.detach(|| {
        let mut signals = Signals::new();
        // A panic leaves no state for the next frame: `blur` starts afresh.
        let mut executor = executor.lock().unwrap_or_else(PoisonError::into_inner);
        match executor.blur(pixels, coc, out, || signals.poll()).map_err(errors::value)? {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => signals.raise(),
        }
    })
}
