//! The XMP packets of a file (XMP specification part 3): in a JPEG the main ones and Extended XMP, which is split over
//! segments; in a PNG a text chunk.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::io::Cursor;

use super::super::{decoders, xmp};
use bokehcam::compute::catch_panic;

/// Identifier at the start of a JPEG segment with a piece of Extended XMP. After it: GUID (32 bytes), length of the whole
/// and position of the piece (4 bytes each, big-endian), and the piece.
const EXTENSION_NAME: &[u8] = b"http://ns.adobe.com/xmp/extension/\0";
const GUID_BYTES: usize = 32;
/// The marker APP1.
const APP1: u8 = 0xE1;
/// Maximum number of main packets that are read, and of Extended XMP that is looked at; files have one of each.
const MAX_PACKETS: usize = 4;
/// Memory limit for a PNG's texts.
const MAX_PNG_TEXT_BYTES: usize = 64 << 20;

/// The XMP packets of a file.
pub(super) struct Packets<'a> {
    /// All packets, Extended XMP last.
    pub packets: Vec<Cow<'a, [u8]>>,
    /// Whether pieces of Extended XMP are missing.
    pub is_incomplete: bool,
}

/// A piece of Extended XMP.
struct Piece<'a> {
    guid: &'a [u8],
    /// Length of the whole.
    length: usize,
    offset: usize,
    content: &'a [u8],
}

impl<'a> Packets<'a> {
    /// Reads the packets of a JPEG or PNG; none of other files.
    pub(super) fn read(file: &'a [u8]) -> Self {
        match file.starts_with(b"\xFF\xD8\xFF") {
            true => Self::read_jpeg(file),
            false => {
                let packet = catch_panic(|| read_png(file)).flatten();
                Self { packets: packet.map(Cow::Owned).into_iter().collect(), is_incomplete: false }
            }
        }
    }

    fn read_jpeg(file: &'a [u8]) -> Self {
        let (mut packets, mut pieces) = (Vec::new(), Vec::new());
        for (_, _, content) in bokehcam_jpeg::segments(file).filter(|(marker, ..)| *marker == APP1) {
            if let Some(packet) = content.strip_prefix(xmp::JPEG_NAME).filter(|_| packets.len() < MAX_PACKETS) {
                packets.push(Cow::Borrowed(packet));
            } else if let Some(piece) = content.strip_prefix(EXTENSION_NAME).and_then(Piece::parse) {
                pieces.push(piece);
            }
        }
        // The main packet names the GUID that belongs to it; pieces of others were left behind by an editor.
        let is_named = |guid: &[u8]| packets.iter().any(|packet| packet.windows(GUID_BYTES).any(|name| name == guid));
        let mut guids: Vec<&[u8]> = pieces.iter().map(|piece| piece.guid).collect();
        guids.dedup();
        guids.truncate(MAX_PACKETS);
        let guid = guids.iter().find(|guid| is_named(guid)).or(guids.first()).copied();
        let extended = guid.map(|guid| {
            pieces.retain(|piece| piece.guid == guid);
            assemble(pieces)
        });
        let is_incomplete = matches!(extended, Some(None));
        packets.extend(extended.flatten().map(Cow::Owned));
        Self { packets, is_incomplete }
    }
}

impl<'a> Piece<'a> {
    fn parse(content: &'a [u8]) -> Option<Self> {
        let (guid, rest) = content.split_at_checked(GUID_BYTES)?;
        let (length, rest) = rest.split_first_chunk()?;
        let (offset, content) = rest.split_first_chunk()?;
        let [length, offset] = [length, offset].map(|bytes| u32::from_be_bytes(*bytes) as usize);
        Some(Self { guid, length, offset, content })
    }
}

/// Puts pieces together, in any order and some of them repeated; `None` if some are missing.
fn assemble(mut pieces: Vec<Piece>) -> Option<Vec<u8>> {
    pieces.sort_by_key(|piece| piece.offset);
    let mut packet = Vec::new();
    for piece in &pieces {
        match piece.offset.cmp(&packet.len()) {
            Ordering::Less => {}
            Ordering::Equal => packet.extend_from_slice(piece.content),
            Ordering::Greater => return None,
        }
    }
    (packet.len() == pieces.first()?.length).then_some(packet)
}

/// Reads the packet of a PNG, if it comes before the pixels.
fn read_png(file: &[u8]) -> Option<Vec<u8>> {
    let limits = png::Limits { bytes: MAX_PNG_TEXT_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(file), limits);
    decoder.set_ignore_iccp_chunk(true);
    let (width, height) = decoder.read_header_info().ok()?.size();
    decoders::check_size(width, height).ok()?;
    let reader = decoder.read_info().ok()?;
    let mut chunk = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == xmp::PNG_KEYWORD)?.clone();
    chunk.decompress_text_with_limit(xmp::MAX_BYTES).ok()?;
    chunk.get_text().ok().map(String::into_bytes)
}
