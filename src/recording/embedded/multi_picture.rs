//! The index of a Multi-Picture file: JPEGs one after the other (CIPA DC-007, section 5).

use super::super::jpeg;

/// The marker APP2.
const APP2: u8 = 0xE2;
/// Identifier at the start of the segment with the index.
const NAME: &[u8] = b"MPF\0";
/// The tag of the list of pictures: 16 bytes each, with size and position at bytes 4 and 8.
const ENTRIES_TAG: u16 = 0xB002;
const ENTRY_BYTES: usize = 16;
/// Maximum number of pictures that are looked at; phones write about ten.
const MAX_PICTURES: usize = 16;

/// Returns the pictures of a JPEG after the first one. Those outside the file are left out: programs that keep only the
/// first picture often leave the index.
pub(super) fn pictures(file: &[u8]) -> impl Iterator<Item = &[u8]> {
    let index = jpeg::segments(file).find_map(|(marker, start, content)| {
        let index = content.strip_prefix(NAME).filter(|_| marker == APP2)?;
        read_entries(index).map(|entries| (entries, start + NAME.len()))
    });
    let (entries, origin) = index.unwrap_or_default();
    entries.into_iter().filter_map(move |(offset, size)| {
        // Positions count from the byte after the identifier; 0 is the first picture.
        let start = origin.checked_add(offset).filter(|_| offset > 0)?;
        file.get(start..start.checked_add(size)?)
    })
}

/// Reads position and size of each picture from an index, which has the form of a TIFF directory.
fn read_entries(index: &[u8]) -> Option<Vec<(usize, usize)>> {
    let is_big_endian = match index.first_chunk()? {
        b"MM\0*" => true,
        b"II*\0" => false,
        _ => return None,
    };
    let u16_at = |at: usize| {
        let bytes = *index.get(at..)?.first_chunk()?;
        Some(if is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let u32_at = |at: usize| {
        let bytes = *index.get(at..)?.first_chunk()?;
        Some(if is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) } as usize)
    };
    // An entry of the directory: tag (2 bytes), type (2), number of bytes (4), position (4).
    let directory = u32_at(4)?;
    let tags = (0..usize::from(u16_at(directory)?)).map(|tag| directory + 2 + 12 * tag);
    let list = tags.into_iter().find(|&at| u16_at(at) == Some(ENTRIES_TAG))?;
    let (bytes, start) = (u32_at(list + 4)?, u32_at(list + 8)?);
    let entries = (0..(bytes / ENTRY_BYTES).min(MAX_PICTURES)).map(|entry| start + ENTRY_BYTES * entry);
    Some(entries.map_while(|at| Some((u32_at(at + 8)?, u32_at(at + 4)?))).collect())
}
