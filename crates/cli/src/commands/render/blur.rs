//! Blurs a photo in the form that keeps most of it.

use std::mem;

use crate::log;
use bokehcam::bokeh::BokehError;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::backdrop::Background;
use bokehcam::engine;
use bokehcam::engine::still::{Depth, Rendered};
use bokehcam::look::Look;
use bokehcam::recording::Photo;

/// Blurs a photo; returns a description of the executor.
pub(super) fn blur(
    photo: &mut Photo,
    depth: Option<Depth>,
    look: &Look,
    computing: &ComputeOptions,
) -> Result<String, BokehError> {
    let color = mem::take(&mut photo.color);
    let is_transparent = look.background == Background::Transparent;
    let Some(picture) = photo.codes.take_if(|_| !is_transparent) else {
        if photo.is_16bit {
            log::note("--behind transparent: what is blurred gets 8 bits; what is sharp keeps its 16");
        }
        let before = photo.codes.is_some().then(|| color.clone());
        let Rendered { color, alpha, by } = engine::still::render_picture(look, color, depth, computing)?;
        if let (Some(codes), Some(before)) = (&mut photo.codes, before) {
            codes.take_changes(&before.rgb, &color.rgb);
        }
        photo.color = color;
        alpha.iter().for_each(|alpha| photo.multiply_alpha(alpha));
        return Ok(by);
    };
    if computing.backend == Backend::Gpu || computing.adapter.is_some() {
        log::note("16 bits and tone curves other than sRGB's are blurred by the processor, not the GPU");
    }
    let (blurred, executor) = engine::still::blur_picture_16bit(look, color, picture, depth, computing.threads)?;
    photo.codes = Some(blurred);
    Ok(executor)
}
