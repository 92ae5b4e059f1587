//! Decodes picture files to luma.

use std::path::Path;

use super::coded::EncodedPicture;
use super::decode::{Scratch, check_depth_size};
use super::fault::PictureFault;
use super::photo_metadata::PhotoMetadata;
use super::samples::GREY_TOLERANCE;
use bokehcam::color::luminance;
use bokehcam::frame::DepthMap;

/// Decodes relative inverse depth (8 or 16 bits, grey, or RGB with grey content) to distances relative to the nearest
/// one. A map that does not cover a picture of `color` pixels is rejected.
pub(super) fn read_inverse_depth(
    path: &Path,
    white_is_far: bool,
    color: (u32, u32),
    scratch: &mut Scratch,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let found = coded.size();
    check_depth_size(found, color)?;
    into.resize(found.0, found.1);
    decode_grey(coded, &mut scratch.pixels, &mut into.metres)?;
    for value in &mut into.metres {
        *value = DepthMap::relative_to_metres(if white_is_far { 1.0 - *value } else { *value });
    }
    Ok(())
}

/// Decodes to width, height and grey values, 0 to 1 as stored (not linearised): luma for a colour picture, multiplied
/// by alpha if there is one.
pub(super) fn read_grey(path: &Path) -> Result<(u32, u32, Vec<f32>), PictureFault> {
    let mut scratch = Scratch::default();
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let (width, height) = coded.size();
    let mut grey = vec![0.0; width as usize * height as usize];
    decode_grey(coded, &mut scratch.pixels, &mut grey)?;
    Ok((width, height, grey))
}

fn decode_grey(coded: EncodedPicture, pixels: &mut Vec<u8>, grey: &mut [f32]) -> Result<(), PictureFault> {
    decode_luma(coded, pixels, |at, pixel| grey[at] = pixel.luma * pixel.alpha).map(drop)
}

/// A pixel as stored (not linearised), 0 to 1.
pub(super) struct LumaPixel {
    pub(super) luma: f32,
    /// 1 without alpha.
    pub(super) alpha: f32,
    /// Whether its channels differ by more than compression makes them.
    pub(super) is_colored: bool,
}

/// Decodes an opened picture, and calls `on_pixel` with the place of each pixel and the pixel. `pixels` is working memory.
pub(super) fn decode_luma(
    coded: EncodedPicture,
    pixels: &mut Vec<u8>,
    mut on_pixel: impl FnMut(usize, LumaPixel),
) -> Result<PhotoMetadata, PictureFault> {
    let samples = coded.samples();
    coded.decode_runs(pixels, |run, row| {
        let places = (run.first..).step_by(run.step);
        for (at, pixel) in places.zip(row.chunks_exact(samples.bytes_per_pixel())) {
            let sample = |channel: usize| f32::from(samples.code(pixel, channel)) / samples.white();
            let (luma, chroma) = match samples.has_color() {
                true => {
                    let [red, green, blue] = [sample(0), sample(1), sample(2)];
                    (luminance(red, green, blue), (red - green).abs().max((blue - green).abs()))
                }
                false => (sample(0), 0.0),
            };
            let alpha = if samples.has_alpha() { sample(samples.channels - 1) } else { 1.0 };
            on_pixel(at, LumaPixel { luma, alpha, is_colored: chroma > GREY_TOLERANCE });
        }
    })
}
