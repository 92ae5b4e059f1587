//! Decodes PNG and JPEG files to pixels; the content decides the format.

use std::path::Path;

use image::metadata::Orientation;
use pulp::{Arch, WithSimd};

use super::coded::{self, EncodedPicture};
use super::color_space;
use super::fault::PictureFault;
use super::photo_metadata::{PhotoMetadata, SIXTEEN_BITS, TRANSPARENCY};
use super::samples::SampleFormat;
use super::transparency::over_white;
use super::upright::upright;
use bokehcam::color::round_to_8bit;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};

/// Working memory for decoding, kept from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    /// The content of a file that must be read completely: a JPEG, or a part of a recording's file.
    pub(super) file: Vec<u8>,
    /// One row of a PNG, or all pixels of a JPEG.
    pub(super) pixels: Vec<u8>,
    /// A right picture before its conversion to luma.
    right: ColorImage,
    /// Depth in the view of the depth camera, and in that of a colour camera without distortion.
    pub(super) measured: DepthMap,
    pub(super) drawn: DepthMap,
}

/// The encoding of depth in 16-bit pictures.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthUnits {
    /// Units per metre, > 0.
    pub(super) scale: f32,
    /// Another value that means unknown, besides 0.
    pub(super) invalid: Option<u16>,
}

/// The kind of a picture according to its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PictureKind {
    Color,
    Depth,
    Grey,
}

/// Reads width, height and kind of a picture from its header only.
pub(super) fn read_header(path: &Path) -> Result<((u32, u32), PictureKind), PictureFault> {
    let (size, samples) = coded::read_header(path)?;
    let kind = match samples {
        samples if samples.is_depth() => PictureKind::Depth,
        samples if samples.has_color() => PictureKind::Color,
        _ => PictureKind::Grey,
    };
    Ok((size, kind))
}

/// Decodes to 8-bit RGB as it is shown, in sRGB: grey is repeated, what is transparent is in front of white, 16 bits are
/// rounded to 8. With `expected`, a picture of another size is rejected before it is decoded. Returns colour profile, EXIF, and what was lost.
pub(super) fn read_color(
    path: &Path,
    expected: Option<(u32, u32)>,
    scratch: &mut Scratch,
    into: &mut ColorImage,
) -> Result<PhotoMetadata, PictureFault> {
    decode_color(EncodedPicture::open(path, &mut scratch.file)?, expected, &mut scratch.pixels, into)
}

/// Decodes as [`read_color`] does, and turns the picture upright by its orientation tag, which is then upright.
pub(super) fn read_photo(path: &Path) -> Result<(ColorImage, PhotoMetadata), PictureFault> {
    let (mut scratch, mut image) = (Scratch::default(), ColorImage::default());
    let mut metadata = read_color(path, None, &mut scratch, &mut image)?;
    drop(scratch);

    let orientation = metadata.take_orientation();
    Ok((upright(orientation).transform_color(image), metadata))
}

/// Rejects a picture of another size than `expected`.
pub(super) fn check_color_size(found: (u32, u32), expected: (u32, u32)) -> Result<(), PictureFault> {
    if found == expected { Ok(()) } else { Err(PictureFault::Size { found, expected }) }
}

/// Reads width and height of a picture from its header only.
pub(super) fn read_size(path: &Path) -> Result<(u32, u32), PictureFault> {
    coded::read_header(path).map(|(size, _)| size)
}

/// Reads width and height of a picture as it is turned upright by its orientation tag, from its header only.
pub(super) fn read_upright_size(path: &Path) -> Result<(u32, u32), PictureFault> {
    let size = read_size(path)?;
    // Faults are reported by whatever decodes the picture.
    let orientation = coded::read_orientation(path).unwrap_or(Orientation::NoTransforms);
    Ok(upright(orientation).rotated_size(size))
}

/// Decodes as [`read_color`] does, and turns the picture upright by its orientation tag; its size is then `expected`.
pub(super) fn read_upright(
    path: &Path,
    expected: (u32, u32),
    scratch: &mut Scratch,
    into: &mut ColorImage,
) -> Result<(), PictureFault> {
    let orientation = coded::read_orientation(path).unwrap_or(Orientation::NoTransforms);
    if orientation == Orientation::NoTransforms {
        return read_color(path, Some(expected), scratch, into).map(drop);
    }
    let found = read_upright_size(path)?;
    if found != expected {
        return Err(PictureFault::Size { found, expected });
    }
    read_color(path, None, scratch, into)?;
    *into = upright(orientation).transform_color(std::mem::take(into));
    Ok(())
}

/// Decodes an opened picture as [`read_color`] does. `pixels` is working memory.
pub(super) fn decode_color(
    coded: EncodedPicture,
    expected: Option<(u32, u32)>,
    pixels: &mut Vec<u8>,
    into: &mut ColorImage,
) -> Result<PhotoMetadata, PictureFault> {
    expected.map_or(Ok(()), |expected| check_color_size(coded.size(), expected))?;
    let mut metadata = decode_stored_color(coded, pixels, into)?;
    // What states colours no longer applies to what it has converted.
    if metadata.icc_profile.take_if(|profile| color_space::convert_to_srgb(profile, &mut into.rgb)).is_some() {
        metadata.png_chunks.retain(|(name, _)| !color_space::is_color_chunk(*name));
    }
    Ok(metadata)
}

/// Decodes an opened picture as [`read_color`] does, but in its own colour space.
pub(super) fn decode_stored_color(
    coded: EncodedPicture,
    pixels: &mut Vec<u8>,
    into: &mut ColorImage,
) -> Result<PhotoMetadata, PictureFault> {
    let ((width, height), samples) = (coded.size(), coded.samples());
    into.resize(width, height);
    if samples == (SampleFormat { channels: 3, is_16bit: false }) {
        return coded.decode_rgb(pixels, &mut into.rgb);
    }
    let channels = if samples.has_color() { [0, 1, 2] } else { [0; 3] };
    let mut metadata = coded.decode_runs(pixels, |first, row| {
        for (rgb, pixel) in
            into.rgb.as_chunks_mut::<3>().0[first..].iter_mut().zip(row.chunks_exact(samples.bytes_per_pixel()))
        {
            let sample = |channel: usize| match samples.is_16bit {
                true => round_to_8bit(samples.code(pixel, channel)),
                false => pixel[channel],
            };
            *rgb = channels.map(sample);
            if samples.has_alpha() {
                let alpha = sample(samples.channels - 1);
                *rgb = rgb.map(|code| over_white(code, alpha));
            }
        }
    })?;
    let lost = [(samples.has_alpha(), TRANSPARENCY), (samples.is_16bit, SIXTEEN_BITS)];
    metadata.lost_properties.extend(lost.iter().filter(|(is_lost, _)| *is_lost).map(|(_, words)| words));
    Ok(metadata)
}

/// Decodes a right picture to luma, from RGB as for the left one. A picture whose size differs from `left` is rejected
/// before it is decoded.
pub(super) fn read_right_luma(
    path: &Path,
    left: (u32, u32),
    scratch: &mut Scratch,
    into: &mut GrayImage,
) -> Result<(), PictureFault> {
    // Moved out, as `color` needs the rest of the scratch memory.
    let mut right = std::mem::take(&mut scratch.right);
    let decoded = read_color(path, Some(left), scratch, &mut right);
    if decoded.is_ok() {
        into.set_luma_from(&right);
    }
    scratch.right = right;
    decoded.map(drop).map_err(|fault| match fault {
        PictureFault::Size { found, expected: left } => PictureFault::EyeSize { found, left },
        fault => fault,
    })
}

/// Decodes 16-bit grey to metres.
pub(super) fn read_depth(
    path: &Path,
    units: DepthUnits,
    scratch: &mut Scratch,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let white = if matches!(coded, EncodedPicture::Png(_)) { None } else { coded::read_pnm_white(path) };
    let units = white.map_or(units, |white| units.scaled(f32::from(u16::MAX) / white));
    decode_depth(coded, units, &mut scratch.pixels, into)
}

/// Decodes an opened picture as [`read_depth`] does. `pixels` is working memory.
pub(super) fn decode_depth(
    coded: EncodedPicture,
    units: DepthUnits,
    pixels: &mut Vec<u8>,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let samples = coded.samples();
    if !samples.is_depth() {
        return Err(match (samples.has_color(), samples.has_alpha()) {
            (true, _) => PictureFault::NotDepth("a colour picture"),
            (false, true) => PictureFault::NotDepth("grey with transparency"),
            (false, false) => PictureFault::NotDepth("an 8-bit grey picture"),
        });
    }
    let (width, height) = coded.size();
    into.resize(width, height);
    let arch = Arch::new();
    coded.decode_runs(pixels, |first, row| {
        let (values, metres) = (row.as_chunks().0, &mut into.metres[first..]);
        arch.dispatch(ConvertToMetres { values, units, metres });
    })?;
    Ok(())
}

impl DepthUnits {
    /// Returns the units of codes that are multiplied, and none of which is above 65535 then.
    fn scaled(self, factor: f32) -> Self {
        let invalid = self.invalid.map(|code| (f32::from(code) * factor).round());
        let invalid = invalid.filter(|&code| code <= f32::from(u16::MAX)).map(|code| code as u16);
        Self { scale: self.scale * factor, invalid }
    }

    /// Converts a big-endian value to metres; 0 if it is unknown.
    #[inline(always)]
    pub(super) fn to_metres(self, value: [u8; 2]) -> f32 {
        // 0 is unknown in any case.
        let (value, invalid) = (u16::from_be_bytes(value), self.invalid.unwrap_or(0));
        let depth_m = f32::from(value) / self.scale;
        if (value != invalid) & DepthMap::is_known(depth_m) { depth_m } else { 0.0 }
    }
}

/// Converts adjacent values to metres.
struct ConvertToMetres<'a> {
    values: &'a [[u8; 2]],
    units: DepthUnits,
    metres: &'a mut [f32],
}

impl WithSimd for ConvertToMetres<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { values, units, metres } = self;
        for (metres, &value) in metres.iter_mut().zip(values) {
            *metres = units.to_metres(value);
        }
    }
}
