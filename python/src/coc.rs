//! Circles of confusion from depth.

use bokehcam::look::CocRule;
use bokehcam::optics::CocField;
use numpy::{PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::prelude::*;

use crate::errors;

/// Writes the signed CoC radius in pixels for each value of `depth` (metres) to `out`, by the settings for a picture of
/// `size` (width, height), focused at `focus_m`.
#[pyfunction]
pub fn coc_from_depth(
    py: Python<'_>,
    depth: PyReadonlyArrayDyn<'_, f32>,
    size: (u32, u32),
    focus_m: f32,
    settings: Vec<(String, String)>,
    mut out: PyReadwriteArrayDyn<'_, f32>,
) -> PyResult<()> {
    let CocRule::Depth { lens, range_m, max_coc_px, .. } = errors::look(&settings)?.coc_rule(size) else {
        return Err(errors::value("the settings are for a blur without depth"));
    };
    let CocField::Depth(lens) = lens.coc_field(focus_m, range_m, size.0, max_coc_px) else { return Ok(()) };
    let (depth, out) = (depth.as_slice()?, out.as_slice_mut()?);
    py.detach(|| out.iter_mut().zip(depth).for_each(|(coc_px, &metres)| *coc_px = lens.coc_px(metres)));
    Ok(())
}
