//! Metadata of picture files that is copied to derived pictures.

use image::ImageDecoder;
use image::metadata::Orientation;

use super::tiff_directory::TiffDirectories;
use super::{color_space, image_resources, xmp};
use bokehcam::compute::catch_panic;
use bokehcam::names;

names::named! {
    /// A file format for pictures, by the extension of its files.
    pub enum PhotoFormat default Png {
        /// Lossless
        Png = "png",
        /// Lossy, and smaller; 8 bits without alpha
        Jpeg = "jpg",
        /// Lossless
        Tiff = "tif",
        /// Lossless, and small; 8 bits
        WebP = "webp",
    }
}

/// Metadata of a picture, and what was lost on reading.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PhotoMetadata {
    /// ICC profile of its RGB values; `None` is sRGB.
    pub icc_profile: Option<Vec<u8>>,
    /// EXIF data, beginning with the TIFF header.
    pub exif: Option<Vec<u8>>,
    /// XMP packet, with rights and authors.
    pub xmp: Option<String>,
    /// Chunks of a PNG (name, data) with its print size, and its colours if they are not stated by a profile; `icc_profile`
    /// then states the same.
    pub png_chunks: Vec<([u8; 4], Vec<u8>)>,
    /// Photoshop's image resources without thumbnails, with captions and rights as IPTC.
    pub image_resources: Option<Vec<u8>>,
    /// What is lost on reading or writing, in words for a message.
    pub lost_properties: Vec<&'static str>,
}

/// What 8-bit pictures without alpha lose, in words for a message.
pub(super) const TRANSPARENCY: &str = "transparency";
pub(super) const SIXTEEN_BITS: &str = "16 bits a channel";

/// Maximum EXIF bytes in a JPEG: a segment has 65533, six of which are its identifier.
const MAX_JPEG_EXIF_BYTES: usize = 65_533 - 6;
/// Maximum profile bytes in a JPEG: 255 segments, less 14 bytes of numbering each.
const MAX_JPEG_ICC_BYTES: usize = 255 * (65_533 - 14);

impl PhotoMetadata {
    /// Reads the metadata of a PNG as stored, before its palette is expanded.
    pub(super) fn from_png(info: &png::Info) -> Self {
        let exif = info.exif_metadata.as_deref().map(<[u8]>::to_vec);
        let mut metadata = Self { exif, ..Self::default() };
        metadata.set_profile(color_space::of_png(info));
        metadata.png_chunks = color_space::chunks_of_png(info);
        if let Some(chunk) = info.utf8_text.iter().find(|chunk| chunk.keyword == xmp::PNG_KEYWORD) {
            let mut chunk = chunk.clone();
            // Limit decompression to a sensible size.
            let packet = chunk.decompress_text_with_limit(xmp::MAX_BYTES).and_then(|()| chunk.get_text());
            metadata.set_xmp(packet.map(String::into_bytes).map_err(|_| "XMP that is damaged"));
        }
        metadata
    }

    /// Reads the metadata of a picture before it is decoded.
    pub(super) fn from_decoder(decoder: &mut dyn ImageDecoder) -> Self {
        // Unreadable metadata must not reject the picture.
        let exif = decoder.exif_metadata().ok().flatten();
        // A TIFF states its orientation by itself.
        let orientation = decoder.orientation().ok().filter(|turned| *turned != Orientation::NoTransforms);
        let exif = exif.or_else(|| orientation.map(exif_of_orientation));
        let mut metadata = Self { exif, ..Self::default() };
        metadata.set_profile(profile_of(decoder));
        if let Some(packet) = decoder.xmp_metadata().ok().flatten() {
            metadata.set_xmp(Ok(packet));
        }
        if let Some(resources) = decoder.iptc_metadata().ok().flatten() {
            match image_resources::keep_valid_parts(&resources) {
                Some(kept) => metadata.image_resources = Some(kept).filter(|kept| !kept.is_empty()),
                None => metadata.lost_properties.push("captions (IPTC) that are damaged"),
            }
        }
        metadata
    }

    /// Keeps a profile only if it is for RGB: the pixels become RGB, so a grey or CMYK profile no longer applies.
    fn set_profile(&mut self, profile: Option<Vec<u8>>) {
        match profile {
            Some(profile) if !color_space::is_rgb(&profile) => {
                self.lost_properties.push("a colour profile that is not of RGB (the blur uses sRGB's tone curve)");
            }
            profile => self.icc_profile = profile,
        }
    }

    /// Keeps the parts of a packet that are still valid.
    fn set_xmp(&mut self, packet: Result<Vec<u8>, &'static str>) {
        match packet.and_then(xmp::keep_valid_parts) {
            Ok(xmp::ValidParts { packet, lost }) => {
                self.xmp = Some(packet);
                self.lost_properties.extend(lost);
            }
            Err(lost) => self.lost_properties.push(lost),
        }
    }

    /// Returns the orientation and removes it from the EXIF: the caller rotates the pixels.
    pub(super) fn take_orientation(&mut self) -> Orientation {
        let remove = |exif| catch_panic(|| Orientation::remove_from_exif_chunk(exif)).flatten();
        self.exif.as_deref_mut().and_then(remove).unwrap_or(Orientation::NoTransforms)
    }

    /// Removes the EXIF thumbnail, which would still show the original picture.
    #[must_use]
    pub fn without_thumbnail(mut self) -> Self {
        if let Some(exif) = &mut self.exif {
            // Damaged EXIF may hide a thumbnail: drop all of it.
            if remove_thumbnail(exif).is_none() {
                self.exif = None;
                self.lost_properties.push("EXIF that is damaged");
            }
        }
        self
    }

    /// Drops metadata that a format does not hold.
    #[must_use]
    pub fn for_format(mut self, format: PhotoFormat) -> Self {
        if format == PhotoFormat::Png {
            let has_chunks = self.png_chunks.iter().any(|(name, _)| color_space::is_color_chunk(*name));
            self.icc_profile.take_if(|_| has_chunks);
        } else {
            let had_size = self.png_chunks.iter().any(|(name, _)| !color_space::is_color_chunk(*name));
            self.lost_properties.extend(had_size.then_some("the print size (pHYs)"));
            self.png_chunks.clear();
        }
        match format {
            PhotoFormat::Jpeg => return self.for_jpeg(),
            PhotoFormat::Tiff => {}
            PhotoFormat::Png | PhotoFormat::WebP => {
                let resources = self.image_resources.take();
                let has_iptc = resources.as_deref().is_some_and(image_resources::have_iptc);
                self.lost_properties.extend(has_iptc.then_some("captions and rights as IPTC"));
            }
        }
        self
    }

    /// Drops metadata that is too large for a JPEG.
    #[must_use]
    pub fn for_jpeg(mut self) -> Self {
        fn limit(part: &mut Option<impl AsRef<[u8]>>, max_bytes: usize, lost: &'static str) -> Option<&'static str> {
            part.take_if(|part| part.as_ref().len() > max_bytes).map(|_| lost)
        }
        let lost = [
            limit(&mut self.exif, MAX_JPEG_EXIF_BYTES, "EXIF larger than a JPEG holds"),
            limit(&mut self.icc_profile, MAX_JPEG_ICC_BYTES, "a colour profile larger than a JPEG holds"),
            limit(&mut self.xmp, xmp::MAX_JPEG_BYTES, "XMP larger than a JPEG holds"),
        ];
        self.lost_properties.extend(lost.into_iter().flatten());
        self
    }
}

/// Returns the colour profile of a picture: its own, or Adobe RGB if its EXIF says so, as cameras write it (DCF 2.0, "R03").
pub(super) fn profile_of(decoder: &mut dyn ImageDecoder) -> Option<Vec<u8>> {
    decoder.icc_profile().ok().flatten().or_else(|| {
        let exif = decoder.exif_metadata().ok().flatten()?;
        let file = TiffDirectories::parse(&exif)?;
        let follow = |directory, tag| file.u32_at(file.find_tag(directory, tag)? + 8);
        let interoperability = follow(follow(file.u32_at(4)?, 0x8769)?, 0xA005)?;
        let is_adobe = file.entries(interoperability).any(|(tag, _, value)| tag == 1 && value.starts_with(b"R03"));
        is_adobe.then(color_space::adobe_rgb)?
    })
}

/// Returns EXIF with the orientation only.
fn exif_of_orientation(orientation: Orientation) -> Vec<u8> {
    // One entry: the tag 0x112 with one 16-bit number.
    let entry = [0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, orientation.to_exif(), 0, 0];
    [&b"MM\0*\0\0\0\x08\0\x01"[..], &entry, &[0; 4]].concat()
}

/// Unlinks the thumbnail's directory (IFD1) from the chain of EXIF directories, and overwrites the thumbnail with
/// zeros. Returns `None` if an offset points outside, or the directory is cut.
///
/// A directory is a count (2 bytes), entries of 12 bytes (tag first, value at byte 8), and the offset of the next one.
fn remove_thumbnail(exif: &mut [u8]) -> Option<()> {
    const THUMBNAIL_OFFSET: u16 = 0x0201;
    const THUMBNAIL_LENGTH: u16 = 0x0202;
    let file = TiffDirectories::parse(exif)?;
    let first = file.u32_at(4)?;
    let next_link = first + 2 + 12 * usize::from(file.u16_at(first)?);
    // A single directory may lack the offset of the next one.
    let Some(second) = file.u32_at(next_link).filter(|&second| second != 0) else { return Some(()) };
    exif.get(second + 2..second + 2 + 12 * usize::from(file.u16_at(second)?))?;
    let value = |tag| file.u32_at(file.find_tag(second, tag)? + 8);
    if let Some((offset, length)) = value(THUMBNAIL_OFFSET).zip(value(THUMBNAIL_LENGTH)) {
        exif.get_mut(offset..offset.checked_add(length)?)?.fill(0);
    }
    exif[next_link..next_link + 4].fill(0);
    Some(())
}
