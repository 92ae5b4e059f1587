//! From PNG and JPEG files to pixels. The format is told by the content, and the header is believed only up to
//! [`MAX_SIDE_PX`].

use std::fs::{self, File};
use std::io::{Cursor, ErrorKind, Read};
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder, ImageError, ImageFormat, Limits};

use super::fault::PictureFault;
use super::{MAX_SIDE_PX, depth_covers};
use crate::frame::{ColorImage, DepthMap, GrayImage};

/// More than the largest picture needs uncompressed: 8192 x 8192 pixels of 8 bytes.
const MAX_FILE_BYTES: u64 = 1 << 30;

/// Memory that a PNG's texts and profiles may take, which are not shown.
const MAX_METADATA_BYTES: u64 = 64 << 20;

/// Memory for decoding that is kept from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    file: Vec<u8>,
    pixels: Vec<u8>,
    right: ColorImage,
}

impl Scratch {
    /// Fills the file memory with the content of `path`.
    pub(super) fn read_file(&mut self, path: &Path) -> Result<&[u8], PictureFault> {
        let metadata = fs::metadata(path).map_err(|error| match error.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => PictureFault::Missing,
            _ => PictureFault::Io(error),
        })?;
        // Opening a pipe would wait for its other end.
        if !metadata.is_file() {
            return Err(PictureFault::NotAFile);
        }
        if metadata.len() > MAX_FILE_BYTES {
            return Err(PictureFault::FileSize { bytes: metadata.len() });
        }
        self.file.clear();
        File::open(path)?.take(MAX_FILE_BYTES).read_to_end(&mut self.file)?;
        Ok(&self.file)
    }

    /// How the picture read last is to be turned to stand upright.
    pub(super) fn orientation(&self) -> Orientation {
        // The picture was decoded; without a readable mark it stands as it is.
        open(&self.file)
            .and_then(|mut decoder| decoder.orientation().map_err(decode_fault))
            .unwrap_or(Orientation::NoTransforms)
    }
}

/// What depth is stored in.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthUnits {
    /// Units per metre.
    pub(super) scale: f32,
    /// A value that means unknown, besides 0.
    pub(super) invalid: Option<u16>,
}

/// What a picture is, as far as its header tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// It has colours.
    Color,
    /// 16-bit grey.
    Depth,
    /// 8-bit grey.
    Grey,
}

/// Columns and rows, and the kind, of the picture at `path`.
pub(super) fn header(path: &Path, scratch: &mut Scratch) -> Result<((u32, u32), Kind), PictureFault> {
    let decoder = open(scratch.read_file(path)?)?;
    let kind = match decoder.color_type() {
        ColorType::L16 => Kind::Depth,
        color_type if color_type.has_color() => Kind::Color,
        _ => Kind::Grey,
    };
    Ok((decoder.dimensions(), kind))
}

/// Decodes to 8-bit RGB; grey is repeated, transparency ignored, 16 bits rounded to 8. With `expected`, a picture of
/// another size is refused before it is decoded.
pub(super) fn color(
    path: &Path,
    expected: Option<(u32, u32)>,
    scratch: &mut Scratch,
    into: &mut ColorImage,
) -> Result<(), PictureFault> {
    scratch.read_file(path)?;
    let decoder = open(&scratch.file)?;
    let (found, color_type) = (decoder.dimensions(), decoder.color_type());
    if let Some(expected) = expected.filter(|&expected| expected != found) {
        return Err(PictureFault::Size { found, expected });
    }
    into.resize(found.0, found.1);
    if color_type == ColorType::Rgb8 {
        return decoder.read_image(&mut into.rgb).map_err(decode_fault);
    }
    read_pixels(decoder, &mut scratch.pixels)?;
    if color_type == ColorType::L8 {
        for (rgb, &grey) in into.rgb.as_chunks_mut::<3>().0.iter_mut().zip(&scratch.pixels) {
            *rgb = [grey; 3];
        }
        return Ok(());
    }
    let channels = if color_type.has_color() { [0, 1, 2] } else { [0, 0, 0] };
    for (rgb, pixel) in into.rgb.chunks_exact_mut(3).zip(pixels(&scratch.pixels, color_type)) {
        for (byte, channel) in rgb.iter_mut().zip(channels) {
            *byte = (pixel.sample(channel) * 255.0).round() as u8;
        }
    }
    Ok(())
}

/// Decodes what a right eye saw to luma, just as that of a left one is made of its colour. A picture of another size
/// than the `left` one is refused before it is decoded.
pub(super) fn right_luma(
    path: &Path,
    left: (u32, u32),
    scratch: &mut Scratch,
    into: &mut GrayImage,
) -> Result<(), PictureFault> {
    let mut right = std::mem::take(&mut scratch.right);
    let decoded = color(path, Some(left), scratch, &mut right);
    if decoded.is_ok() {
        into.set_luma_of(&right);
    }
    scratch.right = right;
    decoded.map_err(|fault| match fault {
        PictureFault::Size { found, expected: left } => PictureFault::EyeSize { found, left },
        fault => fault,
    })
}

/// Decodes 16-bit grey to metres. With `color_size`, a map that does not cover such a colour picture is refused.
pub(super) fn depth(
    path: &Path,
    units: DepthUnits,
    color_size: Option<(u32, u32)>,
    scratch: &mut Scratch,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    scratch.read_file(path)?;
    let decoder = open(&scratch.file)?;
    if decoder.color_type() != ColorType::L16 {
        return Err(PictureFault::NotDepth(match decoder.color_type() {
            ColorType::L8 => "an 8-bit grey picture",
            ColorType::La8 | ColorType::La16 => "grey with transparency",
            _ => "a colour picture",
        }));
    }
    let found = decoder.dimensions();
    if let Some(color) = color_size.filter(|&color| !depth_covers(found, color)) {
        return Err(PictureFault::DepthSize { found, color });
    }
    into.resize(found.0, found.1);
    read_pixels(decoder, &mut scratch.pixels)?;
    for (metres, bytes) in into.metres.iter_mut().zip(scratch.pixels.as_chunks().0) {
        let value = u16::from_ne_bytes(*bytes);
        *metres = if Some(value) == units.invalid { 0.0 } else { f32::from(value) / units.scale };
    }
    Ok(())
}

/// Decodes to grey, 0 to 1 as stored (not linearised): the luma of a colour, and darker as it is more transparent.
pub(super) fn grey(path: &Path) -> Result<(u32, u32, Vec<f32>), PictureFault> {
    let mut scratch = Scratch::default();
    scratch.read_file(path)?;
    let decoder = open(&scratch.file)?;
    let ((width, height), color_type) = (decoder.dimensions(), decoder.color_type());
    read_pixels(decoder, &mut scratch.pixels)?;
    let grey = pixels(&scratch.pixels, color_type).map(|pixel| {
        let luma = if color_type.has_color() {
            0.2126 * pixel.sample(0) + 0.7152 * pixel.sample(1) + 0.0722 * pixel.sample(2)
        } else {
            pixel.sample(0)
        };
        let alpha =
            if color_type.has_alpha() { pixel.sample(usize::from(color_type.channel_count()) - 1) } else { 1.0 };
        luma * alpha
    });
    Ok((width, height, grey.collect()))
}

/// One pixel as decoded: 8 or 16 bits a sample.
#[derive(Clone, Copy)]
struct Pixel<'a> {
    bytes: &'a [u8],
    is_wide: bool,
}

impl Pixel<'_> {
    /// The sample of `channel`, 0 to 1.
    fn sample(self, channel: usize) -> f32 {
        if self.is_wide {
            f32::from(u16::from_ne_bytes([self.bytes[2 * channel], self.bytes[2 * channel + 1]])) / 65535.0
        } else {
            f32::from(self.bytes[channel]) / 255.0
        }
    }
}

fn pixels(bytes: &[u8], color_type: ColorType) -> impl Iterator<Item = Pixel<'_>> {
    let is_wide = color_type.bytes_per_pixel() == 2 * color_type.channel_count();
    bytes.chunks_exact(usize::from(color_type.bytes_per_pixel())).map(move |bytes| Pixel { bytes, is_wide })
}

fn read_pixels(decoder: Box<dyn ImageDecoder + '_>, pixels: &mut Vec<u8>) -> Result<(), PictureFault> {
    // At most 8 bytes for each of `MAX_SIDE_PX` squared pixels.
    pixels.resize(decoder.total_bytes() as usize, 0);
    decoder.read_image(pixels).map_err(decode_fault)
}

/// Reads the header of a file's bytes, and refuses what is too large, empty or cut short.
fn open(bytes: &[u8]) -> Result<Box<dyn ImageDecoder + '_>, PictureFault> {
    let decoder: Box<dyn ImageDecoder + '_> = match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => {
            // Before the decoder, which would take memory for a row.
            if let Some([width, height]) = png_size(bytes) {
                check_size(width, height)?;
            }
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(MAX_METADATA_BYTES);
            Box::new(PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(decode_fault)?)
        }
        Ok(ImageFormat::Jpeg) => {
            // The decoder would fill up what is missing with grey.
            if !jpeg_is_whole(bytes) {
                return Err(PictureFault::Truncated);
            }
            Box::new(JpegDecoder::new(Cursor::new(bytes)).map_err(decode_fault)?)
        }
        _ if bytes.len() < 8 => return Err(PictureFault::Truncated),
        _ => return Err(PictureFault::Format("PNG or JPEG")),
    };
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    Ok(decoder)
}

pub(super) fn check_size(width: u32, height: u32) -> Result<(), PictureFault> {
    if width > MAX_SIDE_PX || height > MAX_SIDE_PX {
        Err(PictureFault::TooLarge { width, height })
    } else if width == 0 || height == 0 {
        Err(PictureFault::NoPixel { width, height })
    } else {
        Ok(())
    }
}

/// Columns and rows that the first chunk of a PNG claims.
fn png_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let [width, height] = bytes.get(16..24)?.as_chunks::<4>().0 else { return None };
    Some([u32::from_be_bytes(*width), u32::from_be_bytes(*height)])
}

/// Whether the markers of a JPEG lead to its end marker.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    const START: u8 = 0xD8;
    const END: u8 = 0xD9;
    let mut rest = bytes;
    loop {
        // Coded data has its FF bytes stuffed with 00 or is split by restart markers; FF may also pad a marker.
        let Some(at) = rest.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xD0..=0xD7 | 0xFF))
        else {
            return false;
        };
        let (marker, after) = (rest[at + 1], &rest[at + 2..]);
        rest = match marker {
            END => return true,
            START | 0x01 => after,
            // A segment says its length, so that what looks like a marker inside it is passed over.
            _ => {
                let Some(&[high, low]) = after.first_chunk() else { return false };
                let Some(next) = after.get(usize::from(u16::from_be_bytes([high, low]))..) else { return false };
                next
            }
        };
    }
}

fn decode_fault(error: ImageError) -> PictureFault {
    match error {
        ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        error => PictureFault::Damaged(error.to_string().replace('\n', " ")),
    }
}
