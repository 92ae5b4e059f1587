//! Blurs a photo in the form that keeps most of it.

use std::mem;
use std::sync::Arc;

use crate::log;
use bokehcam::bokeh::BokehError;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::backdrop::{Background, BackgroundPicture};
use bokehcam::engine::still::{Depth, Rendered, render_picture};
use bokehcam::look::Look;
use bokehcam_media::recording::Photo;

/// Blurs a photo; returns a description of the executor.
pub(super) fn blur(
    photo: &mut Photo,
    depth: Option<Depth>,
    look: &Look,
    computing: &ComputeOptions,
) -> Result<String, BokehError> {
    let is_transparent = look.background == Background::Transparent;
    if is_transparent && photo.is_16bit {
        log::note("--behind transparent: what is blurred gets 8 bits; what is sharp keeps its 16");
    }
    let look = &adapt_background(look, photo);
    let wants_gpu = computing.backend == Backend::Gpu || computing.adapter.is_some();
    if wants_gpu && photo.codes.is_some() && !is_transparent {
        log::note("16 bits and tone curves other than sRGB's are blurred by the processor, not the GPU");
    }
    let (color, codes) = (mem::take(&mut photo.color), photo.codes.take());
    let Rendered { color, codes, alpha, by } = render_picture(look, color, codes, depth, computing)?;
    (photo.color, photo.codes) = (color, codes);
    alpha.iter().for_each(|alpha| photo.multiply_alpha(alpha));
    Ok(by)
}

/// Returns the look with the colours of its background converted to those of the photo, which keeps its colour space.
fn adapt_background(look: &Look, photo: &Photo) -> Look {
    let mut look = look.clone();
    match &mut look.background {
        Background::Color(rgb) => photo.convert_from_srgb(rgb),
        Background::Picture(picture) => {
            let mut image = picture.image.clone();
            photo.convert_from_srgb(&mut image.rgb);
            *picture = Arc::new(BackgroundPicture { file: picture.file.clone(), image });
        }
        Background::Video(_) if photo.metadata.icc_profile.is_some() => {
            log::note("--behind video: its colours are taken as those of the photo, which has its own colour profile");
        }
        Background::Blur | Background::Video(_) | Background::Transparent => {}
    }
    look
}
