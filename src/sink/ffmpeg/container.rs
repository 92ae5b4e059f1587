//! Checks whether a video file is complete, by its container: a truncated file lacks the parts written last.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Container {
    /// `.mp4` and `.mov`, with its index at the front or in fragments.
    Mp4,
    /// `.mkv` and `.webm`.
    Matroska,
}

impl Container {
    /// Checks whether the file is complete, and returns what is missing otherwise.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn check(self, path: &Path) -> io::Result<Result<(), &'static str>> {
        let mut file = File::open(path)?;
        let len_bytes = file.metadata()?.len();
        match self {
            Self::Mp4 => check_mp4(&mut file, len_bytes),
            Self::Matroska => check_matroska(&mut file, len_bytes),
        }
    }
}

const NO_END: &str = "its end is missing";
const NO_INDEX: &str = "its index is missing";

/// Checks an mp4: its boxes (ISO 14496-12) must be contiguous up to the end of the file, one of them an index (`moov`),
/// and the last one of a fragmented file (`moof`) the one with which ffmpeg closes it (`mfra`).
fn check_mp4(file: &mut File, len_bytes: u64) -> io::Result<Result<(), &'static str>> {
    let (mut at, mut has_index, mut has_fragments, mut last) = (0, false, false, [0; 4]);
    while at < len_bytes {
        let mut head = [0; 16];
        file.seek(SeekFrom::Start(at))?;
        if read_up_to(file, &mut head)?.len() < 8 {
            return Ok(Err(NO_END));
        }
        let number = |bytes: &[u8]| bytes.iter().fold(0, |number, &byte| number << 8 | u64::from(byte));
        // 0 means up to the end of the file, 1 that a 64-bit size follows the type.
        let size_bytes = match number(&head[..4]) {
            0 => len_bytes - at,
            1 => number(&head[8..]),
            size_bytes => size_bytes,
        };
        last.copy_from_slice(&head[4..8]);
        has_index |= last == *b"moov";
        has_fragments |= last == *b"moof";
        at = match at.checked_add(size_bytes) {
            Some(next) if size_bytes >= 8 && next <= len_bytes => next,
            _ => return Ok(Err(NO_END)),
        };
    }
    let has_end = !has_fragments || last == *b"mfra";
    Ok(if !has_index {
        Err(NO_INDEX)
    } else if has_end {
        Ok(())
    } else {
        Err(NO_END)
    })
}

/// Checks a Matroska file (RFC 9559): the size of its segment must be known, and the segment must end with the file,
/// because ffmpeg writes the size last.
fn check_matroska(file: &mut File, len_bytes: u64) -> io::Result<Result<(), &'static str>> {
    const SEGMENT: [u8; 4] = [0x18, 0x53, 0x80, 0x67];
    // The segment begins after a header of some 40 bytes.
    let mut head = [0; 128];
    let head = read_up_to(file, &mut head)?;
    let Some(at) = head.windows(SEGMENT.len()).position(|bytes| bytes == SEGMENT) else { return Ok(Err(NO_INDEX)) };
    // The leading zeros of the first byte encode the length of the size; all ones mean unknown.
    let size = &head[at + SEGMENT.len()..];
    let Some(size_len) = size.first().map(|first| first.leading_zeros() as usize + 1).filter(|&len| len <= size.len())
    else {
        return Ok(Err(NO_INDEX));
    };
    let marker = 1u64 << (7 * size_len);
    let number = size[..size_len].iter().fold(0, |number, &byte| number << 8 | u64::from(byte)) & (marker - 1);
    let is_known = number != marker - 1;
    let end = (at + SEGMENT.len() + size_len) as u64 + number;
    Ok(if is_known && end == len_bytes { Ok(()) } else { Err(NO_END) })
}

fn read_up_to<'a>(file: &mut File, bytes: &'a mut [u8]) -> io::Result<&'a [u8]> {
    let mut read = 0;
    while read < bytes.len() {
        match file.read(&mut bytes[read..])? {
            0 => break,
            more => read += more,
        }
    }
    Ok(&bytes[..read])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(container: Container, bytes: &[u8]) -> Result<(), &'static str> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        container.check(file.path()).unwrap()
    }

    fn boxes(kinds: &[&[u8; 4]]) -> Vec<u8> {
        kinds.iter().flat_map(|kind| [&[0, 0, 0, 12], kind.as_slice(), b"data"].concat()).collect()
    }

    #[test]
    fn an_mp4_has_an_index_and_an_end() {
        let good = [&[b"ftyp", b"moov", b"mdat"][..], &[b"ftyp", b"moov", b"moof", b"mdat", b"mfra"]];
        for kinds in good {
            let whole = boxes(kinds);
            assert_eq!(verdict(Container::Mp4, &whole), Ok(()));
            for cut in 0..whole.len() {
                assert!(verdict(Container::Mp4, &whole[..cut]).is_err() || cut == 24, "{cut}");
            }
        }
        assert_eq!(verdict(Container::Mp4, &boxes(&[b"ftyp", b"mdat"])), Err(NO_INDEX));
        assert_eq!(verdict(Container::Mp4, &boxes(&[b"moov", b"moof", b"mdat"])), Err(NO_END));
        assert_eq!(verdict(Container::Mp4, &[0; 7]), Err(NO_END));
        let large = [&[0, 0, 0, 1][..], b"moov", &20u64.to_be_bytes(), b"data"].concat();
        assert_eq!(verdict(Container::Mp4, &large), Ok(()));
    }

    #[test]
    fn a_matroska_file_knows_its_size() {
        let head =
            |size: u64| [&[0x1a, 0x45, 0xdf, 0xa3, 0x80, 0x18, 0x53, 0x80, 0x67][..], &size.to_be_bytes()].concat();
        let whole = [head(1 << 56 | 4), b"data".to_vec()].concat();
        assert_eq!(verdict(Container::Matroska, &whole), Ok(()));
        for cut in 0..whole.len() {
            assert!(verdict(Container::Matroska, &whole[..cut]).is_err(), "{cut}");
        }
        let unknown = [head((1 << 57) - 1), b"data".to_vec()].concat();
        assert_eq!(verdict(Container::Matroska, &unknown), Err(NO_END));
    }
}
