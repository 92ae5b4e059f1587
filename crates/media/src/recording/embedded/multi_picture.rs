//! The index of a Multi-Picture file: JPEGs one after the other (CIPA DC-007, section 5).

use super::super::tiff_directory::TiffDirectories;
use super::is_picture;

/// The marker APP2.
const APP2: u8 = 0xE2;
/// Identifier at the start of the segment with the index.
const NAME: &[u8] = b"MPF\0";
/// The tag of the list of pictures: 16 bytes each, with size and position at bytes 4 and 8.
const ENTRIES_TAG: u16 = 0xB002;
const ENTRY_BYTES: usize = 16;
/// The bits of an entry's first word that say what its picture is; 0 is undefined, as phones write for depth and others.
const KIND_BITS: usize = 0xFF_FFFF;
/// The kind of pictures from several viewpoints.
const DISPARITY_KIND: usize = 0x02_0002;
/// Maximum number of pictures that are looked at; phones write about ten.
const MAX_PICTURES: usize = 16;

/// A picture that an index lists.
pub(super) struct Listed<'a> {
    /// Its bytes; `None` if no picture is there: programs that keep only the first one often leave the index.
    pub picture: Option<&'a [u8]>,
    /// 0 if it is undefined. Others are whole pictures, and no maps: a thumbnail, or another view.
    kind: usize,
}

impl Listed<'_> {
    /// Returns whether it may be depth, and is missing.
    pub(super) fn is_lost_map(&self) -> bool {
        self.picture.is_none() && self.kind == 0
    }

    /// Returns whether it is the picture of another camera.
    pub(super) fn is_other_view(&self) -> bool {
        self.kind == DISPARITY_KIND
    }
}

/// Returns the pictures of a JPEG after the first one.
pub(super) fn pictures(file: &[u8]) -> impl Iterator<Item = Listed<'_>> {
    let index = bokehcam_jpeg::segments(file).find_map(|(marker, start, content)| {
        let index = content.strip_prefix(NAME).filter(|_| marker == APP2)?;
        read_entries(index).map(|entries| (entries, start + NAME.len()))
    });
    let (entries, origin) = index.unwrap_or_default();
    // Position 0 is the first picture.
    entries.into_iter().filter(|entry| entry.offset > 0 && entry.size > 0).map(move |Entry { kind, offset, size }| {
        // Positions count from the byte after the identifier.
        let start = origin.saturating_add(offset);
        let picture = file.get(start..start.saturating_add(size)).filter(|picture| is_picture(picture));
        Listed { picture, kind }
    })
}

/// An entry of an index.
struct Entry {
    kind: usize,
    offset: usize,
    size: usize,
}

/// Reads the entries of an index, which has the form of a TIFF directory.
fn read_entries(index: &[u8]) -> Option<Vec<Entry>> {
    let index = TiffDirectories::parse(index)?;
    let list = index.find_tag(index.u32_at(4)?, ENTRIES_TAG)?;
    let (bytes, start) = (index.u32_at(list + 4)?, index.u32_at(list + 8)?);
    let entries = (0..(bytes / ENTRY_BYTES).min(MAX_PICTURES)).map(|entry| start + ENTRY_BYTES * entry);
    let read = |at| {
        let [attributes, size, offset] = [at, at + 4, at + 8].map(|at| index.u32_at(at));
        Some(Entry { kind: attributes? & KIND_BITS, offset: offset?, size: size? })
    };
    Some(entries.map_while(read).collect())
}
