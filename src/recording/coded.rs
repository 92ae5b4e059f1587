//! Encoded picture files: detected by their first bytes, limited by their header, and decoded row by row.
//!
//! The memory for a file is bounded before it is decoded: at most [`MAX_SIDE_PX`] columns and rows. Besides the pixels,
//! a PNG needs one row; a JPEG needs twice the file (up to [`MAX_JPEG_BYTES`]) and 6 bytes per pixel.

use std::fs::File;
use std::io::{BufReader, Cursor, ErrorKind, Read, Seek};
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::{ColorType, ImageDecoder, ImageError};

use super::MAX_SIDE_PX;
use super::fault::PictureFault;
use super::jpeg;
use super::photo_metadata::PhotoMetadata;
use super::samples::SampleFormat;
use crate::files::input;

/// Far more than a photograph of 8192 x 8192 pixels needs.
const MAX_JPEG_BYTES: u64 = 96 << 20;

/// Largest float map accepted: 4 bytes per pixel, and room for a header.
const MAX_PFM_BYTES: u64 = 4 * (MAX_SIDE_PX as u64 * MAX_SIDE_PX as u64) + 4096;

/// Memory limit for a PNG's texts and profiles, which are not shown.
const MAX_METADATA_BYTES: usize = 64 << 20;

/// The supported formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Pfm,
}

/// A picture whose header was read.
pub(super) enum EncodedPicture<'a> {
    /// Decoded straight from disk.
    Png(Box<png::Reader<BufReader<File>>>),
    Jpeg(Box<JpegDecoder<Cursor<&'a [u8]>>>),
}

/// The position of a run of pixels: index of the first one in row-major order, and distance to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelRun {
    pub(super) first: usize,
    pub(super) step: usize,
}

impl<'a> EncodedPicture<'a> {
    /// Opens a PNG or JPEG; `memory` receives a file that must be read completely.
    pub(super) fn open(path: &Path, memory: &'a mut Vec<u8>) -> Result<Self, PictureFault> {
        let (mut file, format) = open_detected(path)?;
        let coded = match format {
            Some(Format::Png) => Self::Png(Box::new(create_png_decoder(file)?.read_info().map_err(png_fault)?)),
            Some(Format::Jpeg) => {
                let ((width, height), _) = jpeg::read_header(&mut BufReader::new(&mut file))?;
                check_size(width, height)?;
                read_from_start(file, MAX_JPEG_BYTES, memory)?;
                // The decoder would fill missing data with grey.
                if !jpeg::is_complete(memory) {
                    return Err(PictureFault::Truncated);
                }
                Self::Jpeg(Box::new(JpegDecoder::new(Cursor::new(memory.as_slice())).map_err(jpeg_fault)?))
            }
            _ => return Err(PictureFault::Format("PNG or JPEG")),
        };
        let (width, height) = coded.size();
        check_size(width, height)?;
        Ok(coded)
    }

    pub(super) fn size(&self) -> (u32, u32) {
        match self {
            Self::Png(reader) => reader.info().size(),
            Self::Jpeg(decoder) => decoder.dimensions(),
        }
    }

    pub(super) fn samples(&self) -> SampleFormat {
        match self {
            Self::Png(reader) => {
                let (color, depth) = reader.output_color_type();
                SampleFormat { channels: color.samples(), is_16bit: depth == png::BitDepth::Sixteen }
            }
            Self::Jpeg(decoder) => {
                SampleFormat { channels: usize::from(decoder.color_type().channel_count()), is_16bit: false }
            }
        }
    }

    /// Decodes a picture of 8-bit RGB into `into`; a JPEG avoids the copy that [`EncodedPicture::decode_runs`] makes. The
    /// caller checks that the samples are 8-bit RGB.
    pub(super) fn decode_rgb(self, memory: &mut Vec<u8>, into: &mut [u8]) -> Result<PhotoMetadata, PictureFault> {
        match self {
            Self::Jpeg(mut decoder) if decoder.color_type() == ColorType::Rgb8 => {
                let metadata = PhotoMetadata::from_jpeg(&mut decoder);
                decoder.read_image(into).map_err(jpeg_fault)?;
                Ok(metadata)
            }
            other => other.decode_runs(memory, |run, row| {
                if run.step == 1 {
                    into[3 * run.first..][..row.len()].copy_from_slice(row);
                } else {
                    let pixels = into.as_chunks_mut::<3>().0[run.first..].iter_mut().step_by(run.step);
                    pixels.zip(row.as_chunks::<3>().0).for_each(|(pixel, read)| *pixel = *read);
                }
            }),
        }
    }

    /// Decodes the picture and calls `on_run` for every run of pixels with its bytes, in the format of
    /// [`EncodedPicture::samples`]: a row of a PNG, or a whole JPEG. `memory` is working memory.
    pub(super) fn decode_runs(
        mut self,
        memory: &mut Vec<u8>,
        mut on_run: impl FnMut(PixelRun, &[u8]),
    ) -> Result<PhotoMetadata, PictureFault> {
        let bytes_per_pixel = self.samples().bytes_per_pixel();
        let (width, height) = self.size();
        let (width, height) = (width as usize, height as usize);
        match self {
            Self::Png(ref mut reader) => {
                memory.resize(width * bytes_per_pixel, 0);
                for (run, pixels) in png_pixel_runs(width, height, reader.info().interlaced) {
                    reader.read_row(memory).map_err(png_fault)?.ok_or(PictureFault::Truncated)?;
                    on_run(run, &memory[..pixels * bytes_per_pixel]);
                }
                // Reading beyond the last row makes the decoder check the end of the coded data.
                reader.read_row(memory).map_err(png_fault)?;
                // Metadata may follow the pixels; a fault in it must not reject the picture.
                let _ = reader.finish();
                Ok(PhotoMetadata::from_png(reader.info()))
            }
            Self::Jpeg(mut decoder) => {
                let metadata = PhotoMetadata::from_jpeg(&mut decoder);
                memory.resize(width * height * bytes_per_pixel, 0);
                decoder.read_image(memory).map_err(jpeg_fault)?;
                on_run(PixelRun { first: 0, step: 1 }, memory);
                Ok(metadata)
            }
        }
    }
}

/// Reads width, height and samples of a PNG or JPEG from its header only.
pub(super) fn read_header(path: &Path) -> Result<((u32, u32), SampleFormat), PictureFault> {
    let (file, format) = open_detected(path)?;
    let (size, samples) = match format {
        Some(Format::Png) => {
            let mut decoder = create_png_decoder(file)?;
            let info = decoder.read_header_info().map_err(png_fault)?;
            // A palette is expanded to RGB.
            let channels = if info.color_type == png::ColorType::Indexed { 3 } else { info.color_type.samples() };
            (info.size(), SampleFormat { channels, is_16bit: info.bit_depth == png::BitDepth::Sixteen })
        }
        Some(Format::Jpeg) => jpeg::read_header(&mut BufReader::new(file))?,
        _ => return Err(PictureFault::Format("PNG or JPEG")),
    };
    check_size(size.0, size.1)?;
    Ok((size, samples))
}

/// Reads the content of a PFM file.
pub(super) fn read_pfm<'a>(path: &Path, memory: &'a mut Vec<u8>) -> Result<&'a [u8], PictureFault> {
    match open_detected(path)? {
        (file, Some(Format::Pfm)) => read_from_start(file, MAX_PFM_BYTES, memory),
        _ => Err(PictureFault::Format("grey PFM")),
    }
}

/// Reads the header of a PNG and the metadata before its pixels.
pub(super) fn read_png_info(path: &Path) -> Result<png::Info<'static>, PictureFault> {
    let (file, format) = open_detected(path)?;
    if format != Some(Format::Png) {
        return Err(PictureFault::Format("PNG"));
    }
    Ok(create_png_decoder(file)?.read_info().map_err(png_fault)?.info().clone())
}

/// Opens a regular file and detects its format by the first bytes; `None` if unsupported. The file is rewound.
fn open_detected(path: &Path) -> Result<(File, Option<Format>), PictureFault> {
    let mut file = input::open(path).map_err(open_fault)?;
    let mut start = [0; 8];
    let mut length = 0;
    while let read @ 1.. = file.read(&mut start[length..])? {
        length += read;
    }
    file.rewind()?;
    let format = match &start {
        b"\x89PNG\r\n\x1a\n" => Format::Png,
        [0xFF, 0xD8, 0xFF, ..] => Format::Jpeg,
        [b'P', b'f' | b'F', space, ..] if space.is_ascii_whitespace() => Format::Pfm,
        _ if b"\x89PNG\r\n\x1a\n".starts_with(&start[..length]) => return Err(PictureFault::Truncated),
        _ => return Ok((file, None)),
    };
    Ok((file, Some(format)))
}

/// Returns the fault of a file that cannot be opened.
pub(super) fn open_fault(error: std::io::Error) -> PictureFault {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => PictureFault::Missing,
        ErrorKind::InvalidInput => PictureFault::NotAFile,
        _ => PictureFault::Io(error),
    }
}

fn read_from_start(mut file: File, max_bytes: u64, memory: &mut Vec<u8>) -> Result<&[u8], PictureFault> {
    let bytes = file.metadata()?.len();
    if bytes > max_bytes {
        return Err(PictureFault::FileSize { bytes, max_bytes });
    }
    memory.clear();
    file.rewind()?;
    file.take(max_bytes).read_to_end(memory)?;
    Ok(memory)
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

fn create_png_decoder(file: File) -> Result<png::Decoder<BufReader<File>>, PictureFault> {
    let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), png::Limits { bytes: MAX_METADATA_BYTES });
    // Expands palettes and samples of fewer than 8 bits.
    decoder.set_transformations(png::Transformations::EXPAND);
    // Check the size before memory is allocated for a row.
    let (width, height) = decoder.read_header_info().map_err(png_fault)?.size();
    check_size(width, height)?;
    Ok(decoder)
}

/// Returns the runs of a PNG's rows, in stored order, and the pixels of each.
fn png_pixel_runs(width: usize, height: usize, is_interlaced: bool) -> impl Iterator<Item = (PixelRun, usize)> {
    /// First column, column step, first row, row step.
    const WHOLE: [[usize; 4]; 1] = [[0, 1, 0, 1]];
    const ADAM7: [[usize; 4]; 7] =
        [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2]];
    let passes: &[[usize; 4]] = if is_interlaced { &ADAM7 } else { &WHOLE };
    // A pass without columns has no rows.
    passes.iter().filter(move |pass| pass[0] < width).flat_map(move |&[column, step, row, row_step]| {
        let pixels = (width - column).div_ceil(step);
        (row..height).step_by(row_step).map(move |row| (PixelRun { first: row * width + column, step }, pixels))
    })
}

pub(super) fn png_fault(error: png::DecodingError) -> PictureFault {
    match error {
        png::DecodingError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => damaged_fault(&other),
    }
}

fn jpeg_fault(error: ImageError) -> PictureFault {
    match error {
        ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => damaged_fault(&other),
    }
}

fn damaged_fault(error: &dyn std::error::Error) -> PictureFault {
    PictureFault::Damaged(error.to_string().replace('\n', " "))
}
