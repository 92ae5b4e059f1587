//! Decodes picture files to luma.

use std::path::Path;

use super::coded::{EncodedPicture, read_pnm_white};
use super::decode::Scratch;
use super::fault::PictureFault;
use super::photo_metadata::PhotoMetadata;
use super::samples::{GREY_TOLERANCE, MAX_COLORED};
use super::upright::upright;
use bokehcam::color::luminance;
use bokehcam::frame::DepthMap;

/// Decodes relative inverse depth (8 or 16 bits, grey, or RGB with grey content) to distances relative to the nearest
/// one; what is transparent, or has the code `invalid`, is unknown. Colours are rejected.
pub(super) fn read_inverse_depth(
    path: &Path,
    (white_is_far, invalid): (bool, Option<u16>),
    scratch: &mut Scratch,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let found = coded.size();
    let white = read_pnm_white(path).unwrap_or(coded.samples().white());
    into.resize(found.0, found.1);
    let mut colored = 0;
    decode_luma(coded, &mut scratch.pixels, |at, LumaPixel { luma, alpha, is_colored }| {
        colored += usize::from(is_colored && alpha > 0.0);
        let is_unknown = alpha == 0.0 || invalid == Some((luma * white).round() as u16);
        let near = if white_is_far { 1.0 - luma } else { luma };
        into.metres[at] = if is_unknown { 0.0 } else { DepthMap::relative_to_metres(near) };
    })?;
    let is_grey = colored as f32 <= MAX_COLORED * into.metres.len() as f32;
    if is_grey { Ok(()) } else { Err(PictureFault::ColoredDepth) }
}

/// Decodes to width, height and grey values, 0 to 1 as stored (not linearised): luma for a colour picture, multiplied
/// by alpha if there is one. The picture is upright by its orientation tag.
pub(super) fn read_grey(path: &Path) -> Result<(u32, u32, Vec<f32>), PictureFault> {
    let mut scratch = Scratch::default();
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let size = coded.size();
    let mut grey = vec![0.0; size.0 as usize * size.1 as usize];
    let mut metadata = decode_luma(coded, &mut scratch.pixels, |at, pixel| grey[at] = pixel.luma * pixel.alpha)?;
    let transform = upright(metadata.take_orientation());
    let (width, height) = transform.rotated_size(size);
    Ok((width, height, if transform.is_identity() { grey } else { transform.apply_to_pixels(&grey, size) }))
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
    coded.decode_runs(pixels, |first, row| {
        for (at, pixel) in (first..).zip(row.chunks_exact(samples.bytes_per_pixel())) {
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
