//! Blurs a single picture, in the same way as a stream.

use super::frame_processor::reject_transparency;
use super::{Blur, Images, Input, Kept, Origin, Playback, Preprocessor};
use crate::bokeh::plan::Plan;
use crate::bokeh::{BokehError, cpu};
use crate::color::Picture16;
use crate::compute::thread_pool::core_count;
use crate::computing::ComputeOptions;
use crate::depth::backdrop::{Background, CutOut};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::Look;
use crate::optics::CocField;

/// A depth map of one picture.
pub enum Depth {
    /// Raw measurements, with holes and noise.
    Measured(DepthMap),
    /// Complete, as a blur used it.
    Final(DepthMap),
}

/// A blurred picture.
pub struct Rendered {
    /// Its colours; straight, not premultiplied, if it has alpha.
    pub color: ColorImage,
    /// Alpha of each pixel, 0 to 255, row by row, if the background of the look is transparent.
    pub alpha: Option<Vec<u8>>,
    /// Describes the executor.
    pub by: String,
}

/// Computes the circle of confusion of every pixel of `color`; returns it with the depth map, if it follows depth. A
/// measured map is returned with its holes filled; it is refined if the look asks for it, or leaves it open and the map
/// does not fit the picture. A virtual background is put into the picture. Uses all cores.
///
/// # Errors
/// [`BokehError::NoDepth`] if the blur follows depth and none is given; the look's background is transparent.
pub fn compute_coc_and_depth(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    reject_transparency(look)?;
    prepare(look, color, depth, core_count()).map(|Prepared { field, map, .. }| (field, map))
}

/// Everything that the blur needs besides the picture.
struct Prepared {
    field: CocField,
    map: Option<DepthMap>,
    /// What is kept of the picture, if the background is transparent.
    kept: Option<Pooled<Kept>>,
}

/// Does the same as [`compute_coc_and_depth`] for any background, on `threads` threads, with bit-identical results.
fn prepare(look: &Look, color: &mut ColorImage, depth: Option<Depth>, threads: usize) -> Result<Prepared, BokehError> {
    let (depth, mut map) = match depth {
        Some(Depth::Measured(map)) => (Origin::Single, Some(map)),
        Some(Depth::Final(map)) => (Origin::Finished, Some(map)),
        None => (Origin::Finished, None),
    };
    let playback = Playback::Still;
    let input = Input { size: color.size(), frames: Some(1), depth, knows_background: true, playback, threads };
    // A single picture is never cropped.
    let (field, composed) = Preprocessor::new(look, input).preprocess(color, map.as_mut(), 0)?;
    let map = map.filter(|_| matches!(field, CocField::Depth(_)));
    Ok(Prepared { field, map, kept: composed.kept })
}

/// Blurs the picture `color` as `look` says; returns it with a description of the executor. Effect `none` leaves it
/// unchanged.
///
/// # Errors
/// The blur follows depth and none is given, it is too wide for the picture, or the requested GPU does not exist; the
/// look's background is transparent ([`render_picture`]).
pub fn blur_picture(
    look: &Look,
    color: ColorImage,
    depth: Option<Depth>,
    computing: &ComputeOptions,
) -> Result<(ColorImage, String), BokehError> {
    reject_transparency(look)?;
    render_picture(look, color, depth, computing).map(|rendered| (rendered.color, rendered.by))
}

/// Does the same as [`blur_picture`], for transparent backgrounds, too.
///
/// # Errors
/// The blur follows depth and none is given, it is too wide for the picture, or the requested GPU does not exist.
pub fn render_picture(
    look: &Look,
    mut color: ColorImage,
    depth: Option<Depth>,
    computing: &ComputeOptions,
) -> Result<Rendered, BokehError> {
    let size = color.size();
    if look.coc_kind().is_none() {
        return Ok(Rendered { color, alpha: None, by: "not blurred".to_string() });
    }
    let Prepared { field: coc, map: depth, kept } = prepare(look, &mut color, depth, computing.thread_count())?;
    let (mut blur, mut images) = (Blur::default(), Images { color, depth, ..Images::default() });
    blur.set_look(look, (size, false), |settings| computing.create_blur(settings, size))?;
    blur.blur(&mut images, coc)?;
    let mut color = images.blurred;
    let alpha = match kept {
        None => None,
        Some(mut kept) => {
            let Kept { color: kept, map } = std::mem::take(&mut *kept);
            let mut images = Images { color: kept, depth: Some(map), ..Images::default() };
            blur.blur(&mut images, coc)?;
            let mut cut_out = CutOut::default();
            cut_out.unpremultiply(&mut color, &images.blurred);
            Some(cut_out.alpha)
        }
    };
    let [_, by] = blur.describe_executor();
    Ok(Rendered { color, alpha, by })
}

/// Does the same as [`blur_picture`] for 16-bit codes, always on the CPU, in linear light of their tone curves. `color`
/// shows the same light as 8-bit sRGB ([`Picture16::to_srgb`]); depth is processed with it.
///
/// # Errors
/// The blur follows depth and none is given, or it is too wide for the picture.
pub fn blur_picture_16bit(
    look: &Look,
    mut color: ColorImage,
    mut picture: Picture16,
    depth: Option<Depth>,
    threads: Option<usize>,
) -> Result<(Picture16, String), BokehError> {
    let size = color.size();
    let Some(settings) = look.blur_settings(size, false) else { return Ok((picture, "not blurred".to_string())) };
    settings.check(size)?;
    let (coc, depth) = prepare_16bit(look, &mut color, &mut picture, depth)?;
    drop(color);
    let plan = Plan::new(&settings, size.0, size.1);
    let (blurred, by) = cpu::blur_16bit(plan, threads, &picture, depth.as_ref(), &coc)?;
    Ok((blurred, format!("{by}, 16 bits")))
}

/// Does the same as [`compute_coc_and_depth`] for 16-bit codes, of which `color` shows the light as 8-bit sRGB.
///
/// # Errors
/// The same as for [`compute_coc_and_depth`].
pub fn prepare_16bit(
    look: &Look,
    color: &mut ColorImage,
    picture: &mut Picture16,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    let before = (look.background != Background::Blur).then(|| color.clone());
    let prepared = compute_coc_and_depth(look, color, depth)?;
    if let Some(before) = before {
        picture.take_changes(&before.rgb, &color.rgb);
    }
    Ok(prepared)
}
