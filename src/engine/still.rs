//! Blurs a single picture, in the same way as a stream.

use super::{Blur, Images, Input, Origin, Preprocessor};
use crate::bokeh::cpu::CpuBokeh;
use crate::bokeh::plan::Plan;
use crate::bokeh::{Bokeh, BokehError};
use crate::color::Picture16;
use crate::computing::ComputeOptions;
use crate::depth::backdrop::Background;
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
/// does not fit the picture. A virtual background is put into the picture.
///
/// # Errors
/// [`BokehError::NoDepth`] if the blur follows depth and none is given.
pub fn compute_coc_and_depth(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    let (depth, mut map) = match depth {
        Some(Depth::Measured(map)) => (Origin::Single, Some(map)),
        Some(Depth::Final(map)) => (Origin::Finished, Some(map)),
        None => (Origin::Finished, None),
    };
    let input = Input { size: color.size(), frames: Some(1), depth, knows_background: true, threads: 1 };
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
    let (coc, depth) = compute_coc_and_depth(look, &mut color, depth)?;
    let (mut blur, mut images) = (Blur::default(), Images { color, depth, ..Images::default() });
    blur.set_look(look, (size, false), |settings| computing.create_blur(settings, size))?;
    blur.blur(&mut images, coc)?;
    let [_, by] = blur.describe_executor();
    Ok((images.blurred, by))
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
    let mut cpu = CpuBokeh::new(Plan::new(&settings, size.0, size.1), threads);
    let (coc, depth) = prepare_16bit(look, &mut color, &mut picture, depth)?;
    drop(color);
    let blurred = cpu.blur_16bit(&picture, depth.as_ref(), &coc)?;
    Ok((blurred, format!("{}, 16 bits", cpu.describe())))
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
