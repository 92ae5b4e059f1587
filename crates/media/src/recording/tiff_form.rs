//! The form of the first picture in a TIFF file, to say in plain words which part of it is not supported.

use std::fs::File;
use std::io::{BufReader, Seek};

use tiff::decoder::Decoder;
use tiff::tags::{CompressionMethod, PhotometricInterpretation, Tag};

use super::fault::PictureFault;

/// What to do with a photo.
pub(super) const SAVE_PHOTO: &str = "save it as RGB of 8 or 16 bits, with LZW compression or none";
/// What to do with a depth map.
pub(super) const SAVE_MAP: &str = "save it as grey of 16 bits or floats, with LZW compression or none";

/// The form of a picture.
#[derive(Debug, Default)]
pub(super) struct TiffForm {
    compression: Option<u16>,
    photometric: Option<u16>,
    channels: u16,
    bits: u16,
    has_floats: bool,
}

impl TiffForm {
    /// Reads it from a file, which is rewound; nothing if that is damaged.
    pub(super) fn read(file: &mut File) -> std::io::Result<Self> {
        let form = Decoder::new(BufReader::new(&mut *file)).map(|mut decoder| {
            let mut first = |tag| decoder.find_tag_unsigned_vec::<u16>(tag).ok().flatten()?.first().copied();
            Self {
                compression: first(Tag::Compression),
                photometric: first(Tag::PhotometricInterpretation),
                channels: first(Tag::SamplesPerPixel).unwrap_or(1),
                bits: first(Tag::BitsPerSample).unwrap_or(1),
                has_floats: first(Tag::SampleFormat) == Some(3),
            }
        });
        file.rewind()?;
        Ok(form.unwrap_or_default())
    }

    /// Checks that its compression is one that the decoder has.
    pub(super) fn check_compression(&self, remedy: &'static str) -> Result<(), PictureFault> {
        let Some(code) = self.compression else { return Ok(()) };
        let name = match CompressionMethod::from_u16_exhaustive(code) {
            CompressionMethod::None
            | CompressionMethod::LZW
            | CompressionMethod::ModernJPEG
            | CompressionMethod::Deflate
            | CompressionMethod::OldDeflate
            | CompressionMethod::PackBits
            | CompressionMethod::Fax3
            | CompressionMethod::Fax4 => return Ok(()),
            CompressionMethod::JPEG => "old JPEG",
            CompressionMethod::ZSTD => "ZSTD",
            CompressionMethod::WebP => "WebP",
            _ => match code {
                34712 => "JPEG 2000",
                34887 => "LERC",
                34925 => "LZMA",
                50002 | 52546 => "JPEG XL",
                _ => "unknown",
            },
        };
        Err(PictureFault::TiffForm { form: format!("{name} compression (code {code})"), remedy })
    }

    /// Returns the fault of samples that are not read.
    pub(super) fn samples_fault(&self, remedy: &'static str) -> PictureFault {
        let form = match self.photometric.and_then(PhotometricInterpretation::from_u16) {
            Some(PhotometricInterpretation::RGBPalette) => "a palette".to_owned(),
            Some(PhotometricInterpretation::YCbCr) => "colours as YCbCr".to_owned(),
            Some(PhotometricInterpretation::CIELab) => "colours as L*a*b*".to_owned(),
            _ => {
                let plural = if self.channels == 1 { "" } else { "s" };
                let kind = if self.has_floats { "floats" } else { "numbers" };
                format!("{} channel{plural} of {}-bit {kind}", self.channels, self.bits)
            }
        };
        PictureFault::TiffForm { form, remedy }
    }

    /// Returns whether samples are parts of bytes.
    pub(super) fn is_packed(&self) -> bool {
        !self.bits.is_multiple_of(8)
    }
}
