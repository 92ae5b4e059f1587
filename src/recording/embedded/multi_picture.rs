//! The index of a Multi-Picture file: JPEGs one after the other (CIPA DC-007, section 5).

use super::super::jpeg;
use super::super::tiff_directory::TiffDirectories;

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
    let index = TiffDirectories::parse(index)?;
    let list = index.find_tag(ENTRIES_TAG)?;
    let (bytes, start) = (index.u32_at(list + 4)?, index.u32_at(list + 8)?);
    let entries = (0..(bytes / ENTRY_BYTES).min(MAX_PICTURES)).map(|entry| start + ENTRY_BYTES * entry);
    Some(entries.map_while(|at| Some((index.u32_at(at + 8)?, index.u32_at(at + 4)?))).collect())
}
