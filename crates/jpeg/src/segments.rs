//! Parses the markers of a JPEG file.

use super::repair::{marker, next_segment};

/// Inserts an application segment (APPn) with up to 65533 bytes of `content` after those at the start of a complete
/// JPEG.
pub fn insert_application_segment(file: &mut Vec<u8>, number: u8, content: &[u8]) {
    let mut at = 2;
    // The file must begin with JFIF, and EXIF precedes all other segments.
    while let Some(&[0xFF, 0xE0 | 0xE1, high, low]) = file.get(at..).and_then(<[u8]>::first_chunk) {
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
    let length = (content.len() + 2) as u16;
    let [high, low] = length.to_be_bytes();
    file.splice(at..at, [0xFF, 0xE0 | number, high, low].into_iter().chain(content.iter().copied()));
}

/// Returns the place of the coded data after the header of its scan (SOS) in a JPEG as the encoder writes it.
pub(crate) fn find_coded_data(file: &[u8]) -> usize {
    let last = segments(file).last().map_or(2, |(_, start, content)| start + content.len());
    // The header of the scan follows the other segments; its length includes its own two bytes.
    let length = file.get(last + 2..).and_then(<[u8]>::first_chunk).map_or(0, |bytes| u16::from_be_bytes(*bytes));
    last + 2 + usize::from(length)
}

/// Changes the height in the frame header of a JPEG as the encoder writes it, and adds the number of blocks between two
/// restart markers.
pub(crate) fn set_height_and_restart_interval(file: &mut Vec<u8>, height: u16, blocks: u16) {
    let frame = segments(file).find_map(|(marker, start, _)| (marker == 0xC0).then_some(start));
    let scan = segments(file).last().map(|(_, start, content)| start + content.len());
    if let (Some(frame), Some(scan)) = (frame, scan) {
        // The precision comes before the height.
        file[frame + 1..frame + 3].copy_from_slice(&height.to_be_bytes());
        let [high, low] = blocks.to_be_bytes();
        file.splice(scan..scan, [0xFF, 0xDD, 0, 4, high, low]);
    }
}

/// Returns the segments of a JPEG before its coded data: marker, position of the content in the file, and content. Ends
/// where the file is damaged.
pub fn segments(file: &[u8]) -> impl Iterator<Item = (u8, usize, &[u8])> {
    // Any FF may pad a marker.
    let is_padding = |at: usize| file.get(at..at + 2) == Some(&[0xFF, 0xFF]);
    let mut at = 2;
    std::iter::from_fn(move || {
        at = (at..).find(|&at| !is_padding(at))?;
        let [0xFF, marker, high, low] = *file.get(at..)?.first_chunk()? else { return None };
        let (start, end) = (at + 4, at + 2 + usize::from(u16::from_be_bytes([high, low])));
        at = end;
        // EOI or SOS.
        let content = (!matches!(marker, 0xD9 | 0xDA)).then(|| file.get(start..end))??;
        Some((marker, start, content))
    })
}

/// Returns the EXIF data of a JPEG, beginning with the TIFF header.
pub fn find_exif(file: &[u8]) -> Option<&[u8]> {
    segments(file).find_map(|(marker, _, content)| content.strip_prefix(b"Exif\0\0").filter(|_| marker == 0xE1))
}

/// Returns whether the segments lead to the end marker (EOI), which a truncated file lacks.
pub fn is_complete(bytes: &[u8]) -> bool {
    find_end(bytes).is_some()
}

/// Returns the number of bytes up to the end marker (EOI), which a truncated file lacks; other data may follow it.
pub fn find_end(bytes: &[u8]) -> Option<usize> {
    let mut rest = bytes;
    loop {
        let (code, _, after) = next_segment(rest)?;
        if code == marker::EOI {
            return Some(bytes.len() - after.len());
        }
        rest = after;
    }
}
