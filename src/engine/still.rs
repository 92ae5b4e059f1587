//! Blurs a single picture, in the same way as a stream.

use super::{Blur, Images, Input, Origin, Preprocessor};
use crate::bokeh::BokehError;
use crate::compute::thread_pool::core_count;
use crate::computing::ComputeOptions;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
use crate::optics::CocField;

/// A depth map of one picture.
pub enum Depth {
    /// Raw measurements, with holes and noise.
    Measured(DepthMap),
    /// Complete, as a blur used it.
    Final(DepthMap),
}

/// Computes the circle of confusion of every pixel of `color`; returns it with the depth map, if it follows depth. A
/// measured map is returned with its holes filled; it is refined if the look asks for it, or leaves it open and the map
/// does not fit the picture. A virtual background is put into the picture. Uses all cores.
///
/// # Errors
/// [`BokehError::NoDepth`] if the blur follows depth and none is given.
pub fn compute_coc_and_depth(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    compute_with_threads(look, color, depth, core_count())
}

/// Does the same as [`compute_coc_and_depth`] on `threads` threads; the results are bit-identical.
fn compute_with_threads(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
    threads: usize,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    let (depth, mut map) = match depth {
        Some(Depth::Measured(map)) => (Origin::Single, Some(map)),
        Some(Depth::Final(map)) => (Origin::Finished, Some(map)),
        None => (Origin::Finished, None),
    };
    let input = Input { size: color.size(), frames: Some(1), depth, knows_background: true, threads };
    // A single picture is never cropped.
    let (field, _) = Preprocessor::new(look, input).preprocess(color, map.as_mut(), 0)?;
    Ok((field, map.filter(|_| matches!(field, CocField::Depth(_)))))
}

/// Blurs the picture `color` as `look` says; returns it with a description of the executor. Effect `none` leaves it
/// unchanged.
///
/// # Errors
/// The blur follows depth and none is given, it is too wide for the picture, or the requested GPU does not exist.
pub fn blur_picture(
    look: &Look,
    mut color: ColorImage,
    depth: Option<Depth>,
    computing: &ComputeOptions,
) -> Result<(ColorImage, String), BokehError> {
    let size = color.size();
    if look.coc_kind().is_none() {
        return Ok((color, "not blurred".to_string()));
    }
    let (coc, depth) = compute_with_threads(look, &mut color, depth, computing.thread_count())?;
    let (mut blur, mut images) = (Blur::default(), Images { color, depth, ..Images::default() });
    blur.set_look(look, (size, false), |settings| computing.create_blur(settings, size))?;
    blur.blur(&mut images, coc)?;
    let [_, by] = blur.describe_executor();
    Ok((images.blurred, by))
}
