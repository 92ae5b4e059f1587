//! What a picture file has besides its pixels, and what of it goes into a picture that is made of it.

use std::io::{BufRead, Seek};

use image::ImageDecoder;
use image::codecs::jpeg::JpegDecoder;
use image::metadata::Orientation;

/// What goes with a picture, and what was left behind when it was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Extras {
    /// The ICC profile of RGB that its numbers are meant in; sRGB where there is none.
    pub icc_profile: Option<Vec<u8>>,
    /// EXIF, from its TIFF header on.
    pub exif: Option<Vec<u8>>,
    /// What the file had and 8-bit RGB cannot hold, in words.
    pub left_behind: Vec<&'static str>,
}

/// Most bytes of EXIF that a JPEG holds: a segment has 65533, six of which say what it is.
const MOST_JPEG_EXIF_BYTES: usize = 65_533 - 6;
/// Most bytes of a profile that a JPEG holds: 255 segments, each less 14 bytes that number it.
const MOST_JPEG_ICC_BYTES: usize = 255 * (65_533 - 14);

impl Extras {
    pub(super) fn of_png(info: &png::Info) -> Self {
        let exif = info.exif_metadata.as_deref().map(<[u8]>::to_vec);
        let mut extras = Self { exif, ..Self::default() };
        extras.take_profile(info.icc_profile.as_deref().map(<[u8]>::to_vec));
        let by_palette = info.color_type == png::ColorType::Indexed || info.trns.is_some();
        if info.trns.is_some() || (!by_palette && info.color_type.samples().is_multiple_of(2)) {
            extras.left_behind.push("transparency");
        }
        if info.bit_depth == png::BitDepth::Sixteen {
            extras.left_behind.push("16 bits a channel");
        }
        extras
    }

    pub(super) fn of_jpeg<R: BufRead + Seek>(decoder: &mut JpegDecoder<R>) -> Self {
        // Without what cannot be read the pixels are none the worse.
        let exif = decoder.exif_metadata().ok().flatten();
        let mut extras = Self { exif, ..Self::default() };
        extras.take_profile(decoder.icc_profile().ok().flatten());
        extras
    }

    /// A profile describes numbers of one kind, and what is read becomes RGB.
    fn take_profile(&mut self, profile: Option<Vec<u8>>) {
        /// Where a profile says what its colours are made of.
        const SPACE: std::ops::Range<usize> = 16..20;
        match profile {
            Some(profile) if profile.get(SPACE) != Some(b"RGB ") => {
                self.left_behind.push("a colour profile that is not of RGB");
            }
            profile => self.icc_profile = profile,
        }
    }

    /// How the picture is to be turned to stand upright; from here on its EXIF says that it does.
    pub(super) fn take_orientation(&mut self) -> Orientation {
        let turned = self.exif.as_deref_mut().and_then(Orientation::remove_from_exif_chunk);
        turned.unwrap_or(Orientation::NoTransforms)
    }

    /// The same without the small picture in the EXIF, which shows what there was before the pixels were changed.
    #[must_use]
    pub fn without_thumbnail(mut self) -> Self {
        if let Some(exif) = &mut self.exif {
            // EXIF that cannot be followed is left behind as a whole.
            if remove_thumbnail(exif).is_none() {
                self.exif = None;
                self.left_behind.push("EXIF that is damaged");
            }
        }
        self
    }

    /// The same without what is too large for a JPEG.
    #[must_use]
    pub fn for_jpeg(mut self) -> Self {
        if self.exif.as_ref().is_some_and(|exif| exif.len() > MOST_JPEG_EXIF_BYTES) {
            self.exif = None;
            self.left_behind.push("EXIF larger than a JPEG holds");
        }
        if self.icc_profile.as_ref().is_some_and(|profile| profile.len() > MOST_JPEG_ICC_BYTES) {
            self.icc_profile = None;
            self.left_behind.push("a colour profile larger than a JPEG holds");
        }
        self
    }
}

/// Ends the chain of directories after the first, and blanks the picture that the second one names. Nothing where the
/// directories lead nowhere.
fn remove_thumbnail(exif: &mut [u8]) -> Option<()> {
    const OFFSET: u16 = 0x0201;
    const LENGTH: u16 = 0x0202;
    let is_big = match exif.first_chunk()? {
        b"MM\0*" => true,
        b"II*\0" => false,
        _ => return None,
    };
    let u16_at = |exif: &[u8], at: usize| {
        let bytes = *exif.get(at..)?.first_chunk()?;
        Some(if is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let u32_at = |exif: &[u8], at: usize| {
        let bytes = *exif.get(at..)?.first_chunk()?;
        Some(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) } as usize)
    };
    let first = u32_at(exif, 4)?;
    let link = first + 2 + 12 * usize::from(u16_at(exif, first)?);
    // A single directory may lack its end.
    let Some(second) = u32_at(exif, link).filter(|&second| second != 0) else { return Some(()) };
    let entries = usize::from(u16_at(exif, second)?);
    let value = |exif: &[u8], tag: u16| {
        let entry = (0..entries).map(|entry| second + 2 + 12 * entry).find(|&at| u16_at(exif, at) == Some(tag))?;
        u32_at(exif, entry + 8)
    };
    if let Some((offset, length)) = value(exif, OFFSET).zip(value(exif, LENGTH)) {
        exif.get_mut(offset..offset.checked_add(length)?)?.fill(0);
    }
    exif[link..link + 4].fill(0);
    Some(())
}
