//! Disparity of rectified pairs.

use std::sync::Mutex;

use bokehcam::computing::ComputeOptions;
use bokehcam::depth::DepthError;
use bokehcam::depth::stereo::check::{Verdict, check_pair};
use bokehcam::depth::stereo::{Effort, Matcher as Matching, Pair};
use bokehcam::frame::DisparityMap;
use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::signals::wait_for;
use crate::{errors, pictures};

/// A matcher for pairs of one size.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Matcher {
    disparities: u32,
    /// `None` while a pair is matched, and after an interrupted match.
    matching: Mutex<Option<Box<dyn Matching>>>,
}

#[pymethods]
impl Matcher {
    /// Creates a matcher for pictures of `size` (width, height) and a multiple of 16 `disparities`, starting at 0.
    #[new]
    fn new(py: Python<'_>, size: (u32, u32), disparities: u32, effort: &str, threads: Option<usize>) -> PyResult<Self> {
        let effort: Effort = effort.parse().map_err(|what| errors::value(format!("effort: {what}")))?;
        let computing = ComputeOptions { threads, ..ComputeOptions::default() };
        let matching = py.detach(|| computing.create_matcher(disparities, effort, size)).map_err(errors::value)?;
        Ok(Self { disparities, matching: Mutex::new(Some(matching)) })
    }

    /// Returns the disparity in pixels (height, width) of `left`, 0 = unknown, and with `checks` a warning about a
    /// suspicious pair, if any.
    fn disparity<'py>(
        &self,
        py: Python<'py>,
        left: &Bound<'py, PyAny>,
        right: &Bound<'py, PyAny>,
        checks: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Option<String>)> {
        let ((left, color), (right, _)) = (pictures::stereo_image(left)?, pictures::stereo_image(right)?);
        let busy = || PyRuntimeError::new_err("the matcher is in use by another thread");
        let mut matching = self.matching.lock().map_err(errors::value)?.take().ok_or_else(busy)?;
        let disparities = self.disparities;
        let (matching, found) = wait_for(py, move || {
            let mut disparity = DisparityMap::default();
            let pair = Pair { left: &left, color: color.as_ref(), right: &right };
            let found = matching.compute_disparity(pair, &mut disparity).and_then(|()| {
                let verdict = if checks { Some(check_pair(&left, &right, disparities)?.verdict()) } else { None };
                Ok((disparity, verdict))
            });
            (matching, found.map_err(DepthError::from))
        })?;
        *self.matching.lock().map_err(errors::value)? = Some(matching);
        let (disparity, verdict) = found.map_err(errors::value)?;
        let warning = match verdict {
            Some(verdict @ Verdict::Misaligned { .. }) => {
                Some(format!("{verdict}, and the disparity is wrong; rectify it"))
            }
            Some(verdict @ (Verdict::Swapped | Verdict::Identical)) => Some(verdict.to_string()),
            _ => None,
        };
        let shape = [disparity.height as usize, disparity.width as usize];
        Ok((disparity.px.to_pyarray(py).reshape(shape)?, warning))
    }
}
