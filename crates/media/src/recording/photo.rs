//! Photos with all that their files hold: 16 bits, tone curves, transparency and metadata, from the file to the result.

use std::io::Read;
use std::path::Path;

use super::coded::{self, EncodedPicture};
use super::decode;
use super::decoders::check_size;
use super::encode::Raster;
use super::fault::PictureFault;
use super::file_kind;
use super::photo_metadata::{SIXTEEN_BITS, TRANSPARENCY};
use super::still::{PhotoFormat, photo_format, write_raster};
use super::transparency::{fill_hidden, over_white};
use super::upright::upright;
use super::{PhotoMetadata, RecordingError, color_space};
use bokehcam::color::{Picture16, ToneCurves, round_to_8bit};
use bokehcam::frame::ColorImage;
use bokehcam::frame::transform::Transform;
use bokehcam_files::input;

/// Part of a HEIC file that has its properties, before the coded pictures.
const MAX_HEIC_START_BYTES: u64 = 1 << 20;

/// A photo, upright.
#[derive(Clone, Debug, Default)]
pub struct Photo {
    /// Its 8-bit codes. If there are `codes`, the same light as 8-bit sRGB.
    pub color: ColorImage,
    /// Its codes, if 8-bit sRGB cannot hold them: they have 16 bits, or their profile has other tone curves.
    pub codes: Option<Picture16>,
    /// Whether its file has 16 bits a channel.
    pub is_16bit: bool,
    /// Alpha of every pixel, 65535 = opaque; `None` if all are opaque. Colours are not multiplied by it; where it is 0, they
    /// are those of the nearest visible pixel.
    pub alpha: Option<Vec<u16>>,
    /// Profile, EXIF and XMP; the orientation is upright.
    pub metadata: PhotoMetadata,
    /// What was assumed or left out, a line each.
    pub notes: Vec<&'static str>,
}

impl Photo {
    /// Reads a picture in any format of [`read_color`](super::still::read_color).
    ///
    /// # Errors
    /// The same as for [`read_color`](super::still::read_color).
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut file = Vec::new();
        let decoded = EncodedPicture::open(path, &mut file).and_then(Self::decode);
        let mut photo = decoded.map_err(RecordingError::picture(path))?;
        drop(file);
        let first = "has several pictures, of which the first is used; `stream` plays a GIF";
        photo.notes.extend(coded::has_more_pictures(path).then_some(first));
        let orientation = photo.metadata.take_orientation();
        photo.transform(&upright(orientation));
        Ok(photo)
    }

    /// Returns whether a file is a HEIC picture, by its first bytes.
    pub fn is_heic(path: &Path) -> bool {
        coded::read_kind(path) == Some(file_kind::HEIC)
    }

    /// Returns columns and rows of the largest picture in a HEIC file as it is coded, before it is cut and turned; `None`
    /// if the beginning of the file states none within the limits.
    pub fn read_heic_size(path: &Path) -> Option<(u32, u32)> {
        let mut start = Vec::new();
        input::open(path).ok()?.take(MAX_HEIC_START_BYTES).read_to_end(&mut start).ok()?;
        // The property `ispe` (ISO/IEC 23008-12, 6.5.3), of tiles, thumbnails and the whole.
        let sizes = start.windows(16).filter_map(|bytes| {
            let sides = bytes.strip_prefix(b"ispe\0\0\0\0")?.as_chunks::<4>().0;
            let (width, height) = (u32::from_be_bytes(sides[0]), u32::from_be_bytes(sides[1]));
            check_size(width, height).ok().map(|()| (width, height))
        });
        sizes.max_by_key(|&(width, height)| width * height)
    }

    /// Decodes a photo as it is stored; `codes` only with 16 bits, or other tone curves than sRGB's.
    fn decode(mut coded: EncodedPicture) -> Result<Self, PictureFault> {
        let (size, samples) = (coded.size(), coded.samples());
        let profile = coded.icc_profile().filter(|profile| color_space::is_rgb(profile));
        let curves = profile.as_deref().map(color_space::read_tone_curves);
        let notes = matches!(curves, Some(None)).then_some(color_space::NO_CURVES).into_iter().collect();
        let curves = curves.flatten().unwrap_or_else(|| ToneCurves::srgb().clone());
        let is_16bit = samples.is_16bit;
        let mut photo = Self { is_16bit, notes, ..Self::default() };
        let has_codes = is_16bit || !curves.are_srgb();
        if !has_codes && !samples.has_alpha() {
            photo.metadata = decode::decode_stored_color(coded, &mut Vec::new(), &mut photo.color)?;
            return Ok(photo);
        }
        photo.color.resize(size.0, size.1);
        let mut codes = has_codes.then(|| Picture16::new(size, curves));
        let mut alpha = samples.has_alpha().then(|| vec![0; photo.color.rgb.len() / 3]);
        let channels = if samples.has_color() { [0, 1, 2] } else { [0; 3] };
        photo.metadata = coded.decode_runs(&mut Vec::new(), |first, row| {
            for (at, pixel) in (first..).zip(row.chunks_exact(samples.bytes_per_pixel())) {
                match &mut codes {
                    Some(codes) => {
                        codes.rgb.as_chunks_mut::<3>().0[at] =
                            channels.map(|channel| samples.code_16bit(pixel, channel))
                    }
                    None => photo.color.rgb.as_chunks_mut::<3>().0[at] = channels.map(|channel| pixel[channel]),
                }
                if let Some(alpha) = &mut alpha {
                    alpha[at] = samples.code_16bit(pixel, samples.channels - 1);
                }
            }
        })?;
        if let Some(alpha) = &alpha {
            let width = size.0 as usize;
            match &mut codes {
                Some(codes) => fill_hidden(codes.rgb.as_chunks_mut::<3>().0, alpha, width),
                None => fill_hidden(photo.color.rgb.as_chunks_mut::<3>().0, alpha, width),
            }
        }
        if let Some(codes) = &codes {
            photo.color.rgb = codes.to_srgb();
        }
        photo.alpha = alpha.filter(|alpha| alpha.iter().any(|&alpha| alpha < u16::MAX));
        photo.codes = codes;
        Ok(photo)
    }

    /// Turns, flips and cuts the photo. The area to keep must be within it.
    pub fn transform(&mut self, transform: &Transform) {
        if transform.is_identity() {
            return;
        }
        let size = self.color.size();
        self.color = transform.transform_color(std::mem::take(&mut self.color));
        if let Some(codes) = &mut self.codes {
            codes.rgb = transform.apply_to_pixels(codes.rgb.as_chunks::<3>().0, size).into_flattened();
            (codes.width, codes.height) = self.color.size();
        }
        if let Some(alpha) = &mut self.alpha {
            *alpha = transform.apply_to_pixels(alpha, size);
        }
    }

    /// Multiplies alpha by that of a result, 255 = opaque.
    pub fn multiply_alpha(&mut self, by: &[u8]) {
        let alpha = self.alpha.get_or_insert_with(|| vec![u16::MAX; by.len()]);
        let multiply = |alpha: u16, by: u8| (u32::from(alpha) * u32::from(by) / 255) as u16;
        alpha.iter_mut().zip(by).for_each(|(alpha, &by)| *alpha = multiply(*alpha, by));
    }

    /// Replaces the picture by the 8-bit `original` inside the file, whose colour space is the same.
    pub fn replace_by_original(&mut self, original: ColorImage) {
        let curves = self.codes.take().map(|codes| codes.curves).filter(|curves| !curves.are_srgb());
        self.codes = curves.map(|curves| Picture16::from_8bit(original.size(), &original.rgb, curves));
        (self.is_16bit, self.alpha) = (false, None);
        self.color = original;
        if let Some(codes) = &self.codes {
            self.color.rgb = codes.to_srgb();
        }
    }

    /// Converts 8-bit sRGB codes, such as those of a background, to the primaries of this photo, with sRGB's tone curve as
    /// `color` has them.
    pub fn convert_from_srgb(&self, rgb: &mut [u8]) {
        self.metadata.icc_profile.iter().for_each(|profile| color_space::convert_to_primaries(profile, rgb));
    }

    /// Writes it in the format of the file name, with all that the format holds; returns the rest, in words for a
    /// message. The thumbnail in EXIF, which shows the picture before the blur, is left out.
    ///
    /// # Errors
    /// The same as for [`write_color`](super::still::write_color).
    pub fn write(self, path: &Path, force: bool) -> Result<Vec<&'static str>, RecordingError> {
        let format = photo_format(path)?;
        let mut metadata = self.metadata.without_thumbnail().for_format(format);
        let (holds_alpha, holds_16bit) =
            (format != PhotoFormat::Jpeg, matches!(format, PhotoFormat::Png | PhotoFormat::Tiff));
        let lost =
            [(self.alpha.is_some() && !holds_alpha, TRANSPARENCY), (self.is_16bit && !holds_16bit, SIXTEEN_BITS)];
        metadata.lost_properties.extend(lost.iter().filter(|(is_lost, _)| *is_lost).map(|(_, words)| words));
        let kept = self.alpha.as_deref().filter(|_| holds_alpha);
        let size = self.color.size();
        let raster = match self.codes {
            Some(codes) if self.is_16bit && holds_16bit => Raster::from_16bit(codes.size(), codes.rgb, kept),
            codes => {
                let (size, mut rgb) = match codes {
                    Some(codes) => (codes.size(), codes.to_8bit()),
                    None => (size, self.color.rgb),
                };
                for (rgb, &alpha) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(self.alpha.iter().flatten()) {
                    if !holds_alpha {
                        *rgb = rgb.map(|code| over_white(code, round_to_8bit(alpha)));
                    }
                }
                Raster::from_8bit(size, rgb, kept)
            }
        };
        write_raster(path, &raster, &metadata, force)?;
        Ok(metadata.lost_properties)
    }
}
