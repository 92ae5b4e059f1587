//! Encoded picture files: detected by their first bytes, limited by their header, and decoded row by row.
//!
//! The memory for a file is bounded before it is decoded: at most [`MAX_SIDE_PX`](super::MAX_SIDE_PX) columns and rows, and
//! [`MAX_PIXELS`](super::MAX_PIXELS) pixels.
//! Besides the pixels, a PNG needs one row, or all if it is interlaced; a JPEG needs three times the file (up to [`MAX_JPEG_BYTES`]) and 6 bytes per
//! pixel; other files need what `decoders` allows.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use image::codecs::{bmp::BmpDecoder, gif::GifDecoder, pnm::PnmDecoder, webp::WebPDecoder};
use image::metadata::Orientation;
use image::{AnimationDecoder, ColorType, ImageDecoder, ImageFormat};
use tiff::tags::Tag;

use super::color_space;
use super::decoders::{
    PICTURES, check_size, create_decoder, create_jpeg_decoder, create_png_decoder, decode_with, guard, sample_format,
};
use super::fault::{PictureFault, decoder_fault, open_fault, png_fault};
use super::file_kind::{self, FileKind};
use super::heif;
use super::jpeg;
use super::photo_metadata::{self, PhotoMetadata};
use super::samples::SampleFormat;
use bokehcam_files::input;

/// Far more than a photograph of `MAX_PIXELS` needs.
const MAX_JPEG_BYTES: u64 = 192 << 20;

/// Part of a JPEG that has its EXIF: a segment of 64 KiB, after those of JFIF and other small ones.
const MAX_EXIF_START_BYTES: u64 = 256 << 10;

/// A picture whose header was read.
pub(super) enum EncodedPicture<'a> {
    /// Decoded straight from disk.
    Png(Box<png::Reader<BufReader<File>>>),
    /// Decoded at once: a JPEG or another format; with the colour of the number 0 in its palette, if it has one.
    Whole(Box<dyn ImageDecoder + 'a>, Option<[u8; 3]>),
}

impl<'a> EncodedPicture<'a> {
    /// Opens a PNG, JPEG, WebP, TIFF, BMP, PNM, GIF (its first frame) or, by an installed program, HEIC; `memory` receives a file that must be read completely.
    pub(super) fn open(path: &Path, memory: &'a mut Vec<u8>) -> Result<Self, PictureFault> {
        guard(|| Self::open_unguarded(path, memory))
    }

    fn open_unguarded(path: &Path, memory: &'a mut Vec<u8>) -> Result<Self, PictureFault> {
        let (mut file, kind) = open_detected(path)?;
        let coded = match kind {
            Some(FileKind::Png) => Self::open_png(file)?,
            Some(FileKind::Jpeg) => {
                let ((width, height), _) = jpeg::read_header(&mut BufReader::new(&mut file))?;
                check_size(width, height)?;
                read_from_start(file, MAX_JPEG_BYTES, memory)?;
                Self::Whole(create_jpeg_decoder(memory)?, None)
            }
            Some(FileKind::Other(format)) => {
                let bmp = (format == ImageFormat::Bmp).then(|| BmpDecoder::new(BufReader::new(&file)).ok());
                let background = bmp.flatten().and_then(|bmp| bmp.get_palette()?.first().copied());
                file.rewind()?;
                Self::Whole(create_decoder(file, format)?, background)
            }
            Some(file_kind::HEIC) => match open_detected(&heif::convert(path)?.picture)? {
                // The file stays open after its folder is removed.
                (file, Some(FileKind::Png)) => Self::open_png(file)?,
                _ => return Err(PictureFault::Damaged("its conversion gave no PNG".into())),
            },
            _ => return Err(FileKind::fault(kind, PICTURES)),
        };
        let (width, height) = coded.size();
        check_size(width, height)?;
        Ok(coded)
    }

    /// Opens a PNG or JPEG in memory.
    pub(super) fn open_bytes(bytes: &'a [u8]) -> Result<Self, PictureFault> {
        let kind = FileKind::detect(&bytes[..bytes.len().min(file_kind::START_BYTES)]);
        let decoder = guard(|| match kind {
            Some(FileKind::Png) => decode_with(Cursor::new(bytes), ImageFormat::Png),
            Some(FileKind::Jpeg) => create_jpeg_decoder(bytes),
            kind => Err(FileKind::fault(kind, "PNG or JPEG")),
        });
        decoder.map(|decoder| Self::Whole(decoder, None))
    }

    fn open_png(file: File) -> Result<Self, PictureFault> {
        Ok(Self::Png(Box::new(create_png_decoder(file)?.read_info().map_err(png_fault)?)))
    }

    /// Returns the colour profile, before the pixels.
    pub(super) fn icc_profile(&mut self) -> Option<Vec<u8>> {
        match self {
            Self::Png(reader) => color_space::of_png(reader.info()),
            Self::Whole(decoder, _) => guard(|| Ok(photo_metadata::profile_of(&mut **decoder))).ok().flatten(),
        }
    }

    /// Returns the colour of the number 0 in the palette of a PNG or BMP, as RGB; `None` without a palette.
    pub(super) fn palette_background(&self) -> Option<[u8; 3]> {
        match self {
            Self::Png(reader) if reader.info().color_type == png::ColorType::Indexed => {
                reader.info().palette.as_deref()?.first_chunk().copied()
            }
            Self::Png(_) => None,
            Self::Whole(_, background) => *background,
        }
    }

    pub(super) fn size(&self) -> (u32, u32) {
        match self {
            Self::Png(reader) => reader.info().size(),
            Self::Whole(decoder, _) => decoder.dimensions(),
        }
    }

    pub(super) fn samples(&self) -> SampleFormat {
        match self {
            Self::Png(reader) => {
                let (color, depth) = reader.output_color_type();
                SampleFormat { channels: color.samples(), is_16bit: depth == png::BitDepth::Sixteen }
            }
            Self::Whole(decoder, _) => sample_format(decoder.color_type()),
        }
    }

    /// Decodes a picture of 8-bit RGB into `into`; all but a PNG avoid the copy that [`EncodedPicture::decode_runs`] makes. The
    /// caller checks that the samples are 8-bit RGB.
    pub(super) fn decode_rgb(self, memory: &mut Vec<u8>, into: &mut [u8]) -> Result<PhotoMetadata, PictureFault> {
        match self {
            Self::Whole(mut decoder, _) if decoder.color_type() == ColorType::Rgb8 => guard(|| {
                let metadata = PhotoMetadata::from_decoder(&mut *decoder);
                decoder.read_image(into).map_err(decoder_fault)?;
                Ok(metadata)
            }),
            other => other.decode_runs(memory, |first, row| into[3 * first..][..row.len()].copy_from_slice(row)),
        }
    }

    /// Decodes the picture and calls `on_run` for every run of pixels with the index of its first one and its bytes, in the
    /// format of [`EncodedPicture::samples`]: a row of a PNG, or a whole picture. `memory` is working memory.
    pub(super) fn decode_runs(
        self,
        memory: &mut Vec<u8>,
        on_run: impl FnMut(usize, &[u8]),
    ) -> Result<PhotoMetadata, PictureFault> {
        guard(|| self.decode_runs_unguarded(memory, on_run))
    }

    fn decode_runs_unguarded(
        mut self,
        memory: &mut Vec<u8>,
        mut on_run: impl FnMut(usize, &[u8]),
    ) -> Result<PhotoMetadata, PictureFault> {
        let bytes_per_pixel = self.samples().bytes_per_pixel();
        let (width, height) = self.size();
        let (width, height) = (width as usize, height as usize);
        match self {
            Self::Png(ref mut reader) if reader.info().interlaced => {
                memory.resize(width * height * bytes_per_pixel, 0);
                reader.next_frame(memory).map_err(png_fault)?;
                on_run(0, memory);
                let _ = reader.finish();
                Ok(PhotoMetadata::from_png(reader.info()))
            }
            Self::Png(ref mut reader) => {
                memory.resize(width * bytes_per_pixel, 0);
                for row in 0..height {
                    reader.read_row(memory).map_err(png_fault)?.ok_or(PictureFault::Truncated)?;
                    on_run(row * width, memory);
                }
                // Reading beyond the last row makes the decoder check the end of the coded data.
                reader.read_row(memory).map_err(png_fault)?;
                // Metadata may follow the pixels; a fault in it must not reject the picture.
                let _ = reader.finish();
                Ok(PhotoMetadata::from_png(reader.info()))
            }
            Self::Whole(mut decoder, _) => {
                let metadata = PhotoMetadata::from_decoder(&mut *decoder);
                let is_16bit = sample_format(decoder.color_type()).is_16bit;
                memory.resize(width * height * bytes_per_pixel, 0);
                decoder.read_image(memory).map_err(decoder_fault)?;
                if is_16bit {
                    // The decoder writes samples as this machine does.
                    let samples = memory.as_chunks_mut().0;
                    samples.iter_mut().for_each(|sample| *sample = u16::from_ne_bytes(*sample).to_be_bytes());
                }
                on_run(0, memory);
                Ok(metadata)
            }
        }
    }
}

/// Reads width, height and samples of a picture from its header only.
pub(super) fn read_header(path: &Path) -> Result<((u32, u32), SampleFormat), PictureFault> {
    let (file, kind) = open_detected(path)?;
    let (size, samples) = guard(|| match kind {
        Some(FileKind::Png) => {
            let mut decoder = create_png_decoder(file)?;
            let info = decoder.read_header_info().map_err(png_fault)?;
            // A palette is expanded to RGB.
            let channels = if info.color_type == png::ColorType::Indexed { 3 } else { info.color_type.samples() };
            Ok((info.size(), SampleFormat { channels, is_16bit: info.bit_depth == png::BitDepth::Sixteen }))
        }
        Some(FileKind::Jpeg) => jpeg::read_header(&mut BufReader::new(file)),
        Some(FileKind::Other(format)) => {
            let decoder = create_decoder(file, format)?;
            Ok((decoder.dimensions(), sample_format(decoder.color_type())))
        }
        _ => Err(FileKind::fault(kind, PICTURES)),
    })?;
    check_size(size.0, size.1)?;
    Ok((size, samples))
}

/// Returns the largest number of a PNM, such as 4095: the decoder scales its numbers to all bits of a sample.
pub(super) fn read_pnm_white(path: &Path) -> Option<f32> {
    let (file, _) = open_detected(path).ok().filter(|(_, kind)| *kind == Some(FileKind::Other(ImageFormat::Pnm)))?;
    let header = guard(|| Ok(PnmDecoder::new(BufReader::new(file)).map_err(decoder_fault)?.into_inner().1));
    Some(header.ok()?.maximal_sample() as f32)
}

/// Reads the header of a PNG and the metadata before its pixels.
pub(super) fn read_png_info(path: &Path) -> Result<png::Info<'static>, PictureFault> {
    let (file, kind) = open_detected(path)?;
    if kind != Some(FileKind::Png) {
        return Err(PictureFault::Format("PNG"));
    }
    guard(|| Ok(create_png_decoder(file)?.read_info().map_err(png_fault)?.info().clone()))
}

/// Reads a whole JPEG or PNG, to look for parts besides its pixels; the kind only of other files.
pub(super) fn read_whole(path: &Path) -> Result<(Vec<u8>, Option<FileKind>), PictureFault> {
    let (file, kind) = open_detected(path)?;
    let mut bytes = Vec::new();
    if matches!(kind, Some(FileKind::Jpeg | FileKind::Png)) && file.metadata()?.len() <= MAX_JPEG_BYTES {
        read_from_start(file, MAX_JPEG_BYTES, &mut bytes)?;
    }
    Ok((bytes, kind))
}

/// Reads the orientation tag of a picture from its beginning only; none counts as upright.
pub(super) fn read_orientation(path: &Path) -> Result<Orientation, PictureFault> {
    let (file, kind) = open_detected(path)?;
    let of_exif = |exif: &[u8]| Orientation::from_exif_chunk(exif);
    let orientation = guard(|| match kind {
        Some(FileKind::Png) => Ok(read_png_exif(file)?.and_then(|(_, exif)| of_exif(&exif))),
        Some(FileKind::Jpeg) => {
            let mut start = Vec::new();
            file.take(MAX_EXIF_START_BYTES).read_to_end(&mut start)?;
            Ok(bokehcam_jpeg::find_exif(&start).and_then(of_exif))
        }
        Some(FileKind::Other(format)) => Ok(create_decoder(file, format)?.orientation().ok()),
        _ => Ok(None),
    });
    Ok(orientation?.unwrap_or(Orientation::NoTransforms))
}

/// Returns the EXIF of a PNG, which may stand behind the pixels, and its position in the file.
pub(super) fn read_png_exif(file: impl Read + Seek) -> std::io::Result<Option<(u64, Vec<u8>)>> {
    let mut file = BufReader::new(file);
    file.seek_relative(8)?;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head)?;
        let length = head[..4].iter().fold(0, |length, &byte| length << 8 | u64::from(byte));
        match &head[4..] {
            b"eXIf" => {
                let (position, mut exif) = (file.stream_position()?, Vec::new());
                file.take(length.min(MAX_JPEG_BYTES)).read_to_end(&mut exif)?;
                return Ok(Some((position, exif)));
            }
            b"IEND" => return Ok(None),
            _ => file.seek_relative(length as i64 + 4)?,
        }
    }
}

/// Returns the orientation tag of a picture that is stored as a JPEG or PNG; `None` if it cannot be read.
pub(super) fn read_stored_orientation(path: &Path) -> Option<Orientation> {
    let is_converted = read_kind(path)? == file_kind::HEIC;
    read_orientation(path).ok().filter(|_| !is_converted)
}

/// Returns whether a file has several pictures: of an animation, or pages.
pub(super) fn has_more_pictures(path: &Path) -> bool {
    let count = || -> Option<bool> {
        let (file, kind) = open_detected(path).ok()?;
        let reader = BufReader::new(file);
        Some(match kind? {
            FileKind::Png => {
                create_png_decoder(reader.into_inner()).ok()?.read_info().ok()?.info().animation_control?.num_frames > 1
            }
            FileKind::Other(ImageFormat::WebP) => WebPDecoder::new(reader).ok()?.has_animation(),
            FileKind::Other(ImageFormat::Gif) => {
                GifDecoder::new(reader).ok()?.into_frames().take(2).flatten().count() > 1
            }
            FileKind::Other(ImageFormat::Tiff) => {
                let mut tiff = tiff::decoder::Decoder::new(reader).ok()?;
                tiff.next_image().ok()?;
                // Neither a thumbnail nor a mask of the first.
                tiff.find_tag_unsigned(Tag::NewSubfileType).ok()?.unwrap_or(0_u32) & 0b101 == 0
            }
            _ => false,
        })
    };
    guard(|| Ok(count().unwrap_or(false))).unwrap_or(false)
}

/// Returns the kind of a file by its first bytes; `None` if it is unknown or cannot be read.
pub(super) fn read_kind(path: &Path) -> Option<FileKind> {
    open_detected(path).ok()?.1
}

/// Opens a regular file and detects its kind by the first bytes; `None` if unknown. The file is rewound.
fn open_detected(path: &Path) -> Result<(File, Option<FileKind>), PictureFault> {
    let mut file = input::open(path).map_err(open_fault)?;
    let mut start = Vec::new();
    (&mut file).take(file_kind::START_BYTES as u64).read_to_end(&mut start)?;
    file.rewind()?;
    match FileKind::detect(&start) {
        None if b"\x89PNG\r\n\x1a\n".starts_with(&start) => Err(PictureFault::Truncated),
        kind => Ok((file, kind)),
    }
}

/// Reads a whole file, which has at most `max_bytes`.
pub(super) fn read_from_start(mut file: File, max_bytes: u64, memory: &mut Vec<u8>) -> Result<&[u8], PictureFault> {
    let bytes = file.metadata()?.len();
    if bytes > max_bytes {
        return Err(PictureFault::FileSize { bytes, max_bytes });
    }
    memory.clear();
    memory.reserve(bytes as usize);
    file.rewind()?;
    file.take(max_bytes).read_to_end(memory)?;
    Ok(memory)
}
