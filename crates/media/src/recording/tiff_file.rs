//! Writes photos as TIFF, and copies EXIF from and to TIFF files, in which it is spread over their directories.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, Write};

use image::error::ImageResult;
use image::{ColorType, ImageDecoder};
use tiff::decoder::Decoder;
use tiff::encoder::colortype::{self, ColorType as TiffColor};
use tiff::encoder::{Compression, DeflateLevel, DirectoryEncoder, TiffEncoder, TiffKindStandard, TiffValue};
use tiff::tags::{ByteOrder, ExtraSamples, IfdPointer, Predictor, Tag, Type, ValueBuffer};
use tiff::{Directory, TiffResult};

use super::encode::{Raster, Samples};
use super::tiff_directory::TiffDirectories;
use super::{PhotoMetadata, image_resources};

/// XMP packet (XMP specification, part 3).
const XMP: Tag = Tag::Unknown(700);
/// Captions and rights as IPTC, alone and among Photoshop's image resources.
const IPTC: Tag = Tag::Unknown(33723);
const IMAGE_RESOURCES: Tag = Tag::Unknown(34377);
/// What a TIFF's own directory says about the photo: orientation, titles, names of camera and programs, time, author,
/// rights, and Windows' texts. Its other entries describe the pixels.
const DESCRIPTIVE: [u16; 15] = [269, 270, 271, 272, 274, 305, 306, 315, 316, 33432, 40091, 40092, 40093, 40094, 40095];
/// Entries of EXIF that are positions in the file: of interoperability data.
const POSITIONS: [u16; 1] = [40965];

/// Bytes of entries that are copied; the rest is left out. Files may claim more than they have.
const MAX_BYTES: usize = 8 << 20;

/// An entry: tag, type, and values in this machine's byte order.
type Entry = (Tag, Type, Vec<u8>);
type Encoder<W> = TiffEncoder<W, TiffKindStandard>;

/// EXIF as it is spread over the directories of a TIFF.
struct Exif {
    /// Entries of the picture's own directory.
    descriptive: Vec<Entry>,
    /// The directories of exposure and of position, with the tag that leads to each.
    directories: [(Tag, Vec<Entry>); 2],
}

impl Exif {
    fn new() -> Self {
        Self {
            descriptive: Vec::new(),
            directories: [Tag::ExifDirectory, Tag::GpsDirectory].map(|tag| (tag, Vec::new())),
        }
    }

    /// Reads EXIF data; what leads outside of it is left out.
    fn parse(exif: &[u8]) -> Option<Self> {
        let file = TiffDirectories::parse(exif)?;
        let order = if exif.starts_with(b"MM") { ByteOrder::BigEndian } else { ByteOrder::LittleEndian };
        let entries = |directory: usize| {
            file.entries(directory).filter_map(move |(tag, kind, values)| {
                let (kind, mut values) = (Type::from_u16(kind)?, values.to_vec());
                order.convert(kind, &mut values, ByteOrder::native());
                Some((Tag::from_u16_exhaustive(tag), kind, values))
            })
        };
        let mut room = MAX_BYTES;
        let own: Vec<Entry> = entries(file.u32_at(4)?).map_while(|entry| take_room(&mut room, entry)).collect();
        let mut read = Self::new();
        for (pointer, directory) in &mut read.directories {
            let position = own.iter().find(|entry| entry.0 == *pointer).and_then(|entry| entry.2.first_chunk());
            let found = position.into_iter().flat_map(|at| entries(u32::from_ne_bytes(*at) as usize));
            directory.extend(found.map_while(|entry| take_room(&mut room, entry)));
        }
        read.descriptive = own;
        Some(read.without_positions())
    }

    /// Reads the EXIF of a TIFF file: of its first picture's directory, and of the directories that this points to.
    fn read(decoder: &mut Decoder<impl Read + Seek>) -> TiffResult<Self> {
        let (mut exif, mut room) = (Self::new(), MAX_BYTES);
        for tag in DESCRIPTIVE.map(Tag::from_u16_exhaustive) {
            let mut value = ValueBuffer::empty(Type::BYTE);
            if decoder.image_ifd().find_tag_buf(tag, &mut value).is_ok_and(|found| found.is_some()) {
                exif.descriptive.extend(take_room(&mut room, to_entry(tag, value)));
            }
        }
        for (pointer, entries) in &mut exif.directories {
            let Some(at) = decoder.find_tag_unsigned::<u64>(*pointer)? else { continue };
            let directory = decoder.read_directory(IfdPointer(at))?;
            for (tag, _) in directory.iter() {
                let mut value = ValueBuffer::empty(Type::BYTE);
                decoder.read_directory_tags(&directory).find_tag_buf(tag, &mut value)?;
                let Some(entry) = take_room(&mut room, to_entry(tag, value)) else { break };
                entries.push(entry);
            }
        }
        Ok(exif.without_positions())
    }

    /// Leaves out the entries that describe the file instead of the photo: above all positions, which a copy would not
    /// preserve.
    fn without_positions(mut self) -> Self {
        self.descriptive.retain(|entry| DESCRIPTIVE.contains(&entry.0.to_u16()));
        self.directories
            .iter_mut()
            .for_each(|(_, entries)| entries.retain(|entry| !POSITIONS.contains(&entry.0.to_u16())));
        self
    }

    /// Writes the directories beside the picture's own; returns their tags and positions.
    fn write_directories<W: Write + Seek>(&self, encoder: &mut Encoder<W>) -> TiffResult<Vec<(Tag, u32)>> {
        let mut positions = Vec::new();
        for (pointer, entries) in self.directories.iter().filter(|(_, entries)| !entries.is_empty()) {
            let mut directory = encoder.extra_directory()?;
            write_entries(&mut directory, entries)?;
            positions.push((*pointer, directory.finish_with_offsets()?.offset));
        }
        Ok(positions)
    }

    /// Writes the entries of the picture's own directory.
    fn write_own<W: Write + Seek>(
        &self,
        directory: &mut DirectoryEncoder<W, TiffKindStandard>,
        positions: &[(Tag, u32)],
    ) -> TiffResult<()> {
        write_entries(directory, &self.descriptive)?;
        positions.iter().try_for_each(|&(pointer, position)| directory.write_tag(pointer, position))
    }

    /// Returns it as EXIF data; `None` if it is empty.
    fn encode(&self) -> TiffResult<Option<Vec<u8>>> {
        if self.descriptive.is_empty() && self.directories.iter().all(|(_, entries)| entries.is_empty()) {
            return Ok(None);
        }
        let mut data = Vec::new();
        let mut encoder = TiffEncoder::new(Cursor::new(&mut data))?;
        let positions = self.write_directories(&mut encoder)?;
        let mut own = encoder.image_directory()?;
        self.write_own(&mut own, &positions)?;
        own.finish()?;
        Ok(Some(data))
    }
}

fn to_entry(tag: Tag, mut value: ValueBuffer) -> Entry {
    value.set_byte_order(ByteOrder::native());
    (tag, value.data_type(), value.as_bytes().to_vec())
}

/// Returns an entry if there is room for it, and takes that.
fn take_room(room: &mut usize, entry: Entry) -> Option<Entry> {
    *room = room.checked_sub(entry.2.len())?;
    Some(entry)
}

fn write_entries<W: Write + Seek>(
    directory: &mut DirectoryEncoder<W, TiffKindStandard>,
    entries: &[Entry],
) -> TiffResult<()> {
    for (tag, kind, values) in entries {
        let entry = directory.write_entry_bytes(*kind, values)?;
        directory.extend_from(&Directory::from_iter([(*tag, entry)]));
    }
    Ok(())
}

/// What the decoder of TIFF files leaves out.
#[derive(Default)]
pub(super) struct Undecoded {
    exif: Option<Vec<u8>>,
    /// The colour profile, whatever the type of its entry.
    profile: Option<Vec<u8>>,
    image_resources: Option<Vec<u8>>,
    /// Whether colours are multiplied by alpha ("associated").
    is_premultiplied: bool,
}

impl Undecoded {
    /// Reads a TIFF file; nothing if it is damaged.
    pub(super) fn read(file: &mut File) -> Self {
        let Ok(mut decoder) = Decoder::new(BufReader::new(file)) else { return Self::default() };
        let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).ok().flatten();
        let mut bytes_of = |tag| {
            let mut bytes = ValueBuffer::empty(Type::UNDEFINED);
            let is_there = matches!(decoder.image_ifd().find_tag_buf(tag, &mut bytes), Ok(Some(_)));
            is_there.then(|| bytes.as_bytes().to_vec())
        };
        let profile = bytes_of(Tag::IccProfile);
        let iptc = |bytes: Vec<u8>| image_resources::from_iptc(&bytes);
        let image_resources = bytes_of(IMAGE_RESOURCES).or_else(|| bytes_of(IPTC).map(iptc));
        Self {
            profile,
            image_resources,
            exif: Exif::read(&mut decoder).and_then(|exif| exif.encode()).ok().flatten(),
            is_premultiplied: extra.is_some_and(|extra| extra.first() == Some(&ExtraSamples::AssociatedAlpha.to_u16())),
        }
    }
}

/// A decoder of a TIFF file that also gives what it leaves out itself. Colours are not multiplied by alpha.
pub(super) struct TiffPhotoDecoder<D> {
    pub(super) decoder: D,
    pub(super) undecoded: Undecoded,
}

impl<D: ImageDecoder> ImageDecoder for TiffPhotoDecoder<D> {
    fn dimensions(&self) -> (u32, u32) {
        self.decoder.dimensions()
    }
    fn color_type(&self) -> ColorType {
        self.decoder.color_type()
    }
    fn icc_profile(&mut self) -> ImageResult<Option<Vec<u8>>> {
        Ok(self.undecoded.profile.clone())
    }
    fn exif_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        Ok(self.undecoded.exif.clone())
    }
    fn xmp_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        self.decoder.xmp_metadata()
    }
    fn iptc_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        Ok(self.undecoded.image_resources.clone())
    }
    fn read_image(self, into: &mut [u8]) -> ImageResult<()> {
        let color = self.decoder.color_type();
        self.decoder.read_image(into)?;
        match color {
            ColorType::Rgba8 if self.undecoded.is_premultiplied => {
                for [colors @ .., alpha] in into.as_chunks_mut::<4>().0 {
                    *colors = colors.map(|color| divide_by_alpha(color.into(), (*alpha).into(), 255) as u8);
                }
            }
            ColorType::Rgba16 if self.undecoded.is_premultiplied => {
                for [colors @ .., alpha] in into.as_chunks_mut::<2>().0.as_chunks_mut::<4>().0 {
                    let alpha = u16::from_ne_bytes(*alpha);
                    *colors = colors.map(|color| {
                        let color = u16::from_ne_bytes(color);
                        (divide_by_alpha(color.into(), alpha.into(), 65535) as u16).to_ne_bytes()
                    });
                }
            }
            _ => {}
        }
        Ok(())
    }
    fn read_image_boxed(self: Box<Self>, into: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(into)
    }
}

/// Divides a colour by its alpha; `white` is the largest value of both. Where alpha is 0, it stays as it is.
fn divide_by_alpha(color: u64, alpha: u64, white: u64) -> u64 {
    (color * white + alpha / 2).checked_div(alpha).map_or(color, |divided| divided.min(white))
}

/// Appends a picture to `file`, which must be empty, as compressed TIFF, with its colour profile, EXIF, XMP and IPTC.
pub(super) fn encode_photo(raster: &Raster, metadata: &PhotoMetadata, file: &mut Vec<u8>) -> TiffResult<()> {
    let compression = Compression::Deflate(DeflateLevel::Fast);
    let encoder = TiffEncoder::new(Cursor::new(file))?.with_compression(compression);
    let encoder = encoder.with_predictor(Predictor::Horizontal);
    match (&raster.samples, raster.has_alpha) {
        (Samples::Bits8(samples), false) => write_image::<colortype::RGB8, _>(encoder, raster, samples, metadata),
        (Samples::Bits8(samples), true) => write_image::<colortype::RGBA8, _>(encoder, raster, samples, metadata),
        (Samples::Bits16(samples), false) => write_image::<colortype::RGB16, _>(encoder, raster, samples, metadata),
        (Samples::Bits16(samples), true) => write_image::<colortype::RGBA16, _>(encoder, raster, samples, metadata),
    }
}

fn write_image<C: TiffColor, W: Write + Seek>(
    mut encoder: Encoder<W>,
    raster: &Raster,
    samples: &[C::Inner],
    metadata: &PhotoMetadata,
) -> TiffResult<()>
where
    [C::Inner]: TiffValue,
{
    let exif = metadata.exif.as_deref().and_then(Exif::parse).unwrap_or_else(Exif::new);
    let positions = exif.write_directories(&mut encoder)?;
    let mut image = encoder.new_image::<C>(raster.size.0, raster.size.1)?;
    let own = image.encoder();
    exif.write_own(own, &positions)?;
    if raster.has_alpha {
        own.write_tag(Tag::ExtraSamples, &[ExtraSamples::UnassociatedAlpha][..])?;
    }
    if let Some(profile) = &metadata.icc_profile {
        write_entries(own, &[(Tag::IccProfile, Type::UNDEFINED, profile.clone())])?;
    }
    if let Some(packet) = &metadata.xmp {
        own.write_tag(XMP, packet.as_bytes())?;
    }
    if let Some(resources) = &metadata.image_resources {
        write_entries(own, &[(IMAGE_RESOURCES, Type::BYTE, resources.clone())])?;
    }
    image.write_data(samples)
}

#[cfg(test)]
mod tests;
