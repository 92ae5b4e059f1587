//! Blurs a single picture of 8 or 16 bits, in the same way as a stream.

use super::frame_processor::reject_transparency;
use super::{Blur, Images, Input, Origin, Playback, Preprocessor};
use crate::bokeh::cpu::BandedBokeh;
use crate::bokeh::plan::Plan;
use crate::bokeh::{Bokeh, BokehError};
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
    /// Its colours; straight, not premultiplied, if it has alpha. Empty if there are `codes`.
    pub color: ColorImage,
    /// Its 16-bit codes, if it had them.
    pub codes: Option<Picture16>,
    /// Alpha of each pixel, 0 to 255, row by row, if the background of the look is transparent.
    pub alpha: Option<Vec<u8>>,
    /// Describes the executor.
    pub by: String,
}

/// Computes the circle of confusion of every pixel of `color`; returns it with the depth map, if it follows depth. A
/// measured map is returned with its holes filled; it is refined if the look asks for it, or leaves it open and the map
/// does not fit the picture. A virtual background is put into the picture. Uses `threads` threads, all cores when `None`,
/// with bit-identical results.
///
/// # Errors
/// [`BokehError::NoDepth`] if the blur follows depth and none is given; the look's background is transparent.
pub fn compute_coc_and_depth(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
    threads: Option<usize>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    reject_transparency(look)?;
    prepare(look, color, depth, threads).map(|(coc, depth, _)| (coc, depth))
}

/// The CoC and depth of a picture, and its foreground mask for a transparent background.
type Prepared = (CocField, Option<DepthMap>, Option<Pooled<Images>>);

/// Does the same as [`compute_coc_and_depth`] for any background.
fn prepare(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
    threads: Option<usize>,
) -> Result<Prepared, BokehError> {
    let (depth, mut map) = match depth {
        Some(Depth::Measured(map)) => (Origin::Single, Some(map)),
        Some(Depth::Final(map)) => (Origin::Finished, Some(map)),
        None => (Origin::Finished, None),
    };
    let (playback, threads) = (Playback::Still, threads.unwrap_or_else(core_count));
    let input = Input { size: color.size(), frames: Some(1), depth, knows_background: true, playback, threads };
    // A single picture is never cropped.
    let (coc, composed) = Preprocessor::new(look, input).preprocess(color, map.as_mut(), 0)?;
    Ok((coc, map.filter(|_| matches!(coc, CocField::Depth(_))), composed.kept))
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
    render_picture(look, color, None, depth, computing).map(|rendered| (rendered.color, rendered.by))
}

/// Does the same as [`blur_picture`], for transparent backgrounds, too, and for 16-bit `codes`, of which `color` shows
/// the same light as 8-bit sRGB ([`Picture16::to_srgb`]). These are blurred on the CPU, in linear light of their tone
/// curves; with a transparent background, blurred pixels get 8 bits.
///
/// # Errors
/// The blur follows depth and none is given, it is too wide for the picture, or the requested GPU does not exist.
pub fn render_picture(
    look: &Look,
    mut color: ColorImage,
    mut codes: Option<Picture16>,
    depth: Option<Depth>,
    computing: &ComputeOptions,
) -> Result<Rendered, BokehError> {
    let size = color.size();
    let Some(settings) = look.blur_settings(size, false) else {
        return Ok(Rendered { color, codes, alpha: None, by: "not blurred".to_string() });
    };
    settings.check(size)?;
    let before = (codes.is_some() && look.background != Background::Blur).then(|| color.clone());
    let (coc, depth, kept) = prepare(look, &mut color, depth, computing.threads)?;
    if let Some(codes) = codes.as_mut().filter(|_| look.background != Background::Transparent) {
        before.iter().for_each(|before| codes.take_changes(&before.rgb, &color.rgb));
        drop((before, color));
        let mut executor = BandedBokeh::new(Plan::new(&settings, size.0, size.1), computing.threads);
        let blurred = executor.blur_16bit(codes, depth.as_ref(), &coc)?;
        let by = format!("{}, 16 bits", executor.describe());
        return Ok(Rendered { color: ColorImage::default(), codes: Some(blurred), alpha: None, by });
    }
    let (mut blur, mut images) = (Blur::default(), Images { color, depth, ..Images::default() });
    blur.set_look(look, (size, false), |settings| computing.create_blur(settings, size))?;
    blur.blur(&mut images, coc)?;
    let mut color = images.blurred;
    let mut alpha = None;
    if let Some(mut kept) = kept {
        blur.blur(&mut kept, coc)?;
        let mut cut_out = CutOut::default();
        cut_out.unpremultiply(&mut color, &kept.blurred);
        alpha = Some(cut_out.alpha);
    }
    if let (Some(codes), Some(before)) = (&mut codes, before) {
        codes.take_changes(&before.rgb, &std::mem::take(&mut color).rgb);
    }
    let [_, by] = blur.describe_executor();
    Ok(Rendered { color, codes, alpha, by })
}
