//! Whether an mp4 is encrypted: ffmpeg would decode noise.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// The sample entry of encrypted video (ISO 23001-7).
const ENCRYPTED: &[u8] = b"encv";

/// Maximum number of boxes before the index; a fragmented file has its index in front.
const MAX_BOXES: usize = 64;

/// Maximum number of bytes of the index to search: the sample entries are at its beginning, or after another track.
const MAX_INDEX_BYTES: u64 = 16 << 20;

/// Returns whether the index (`moov`, ISO 14496-12) of a file has encrypted video. False for other containers.
///
/// # Errors
/// Reading failed.
pub(super) fn is_encrypted(file: &mut File) -> io::Result<bool> {
    let mut at = 0;
    for _ in 0..MAX_BOXES {
        let mut head = Vec::with_capacity(16);
        file.seek(SeekFrom::Start(at))?;
        file.take(16).read_to_end(&mut head)?;
        let Some((size, kind)) = head.get(..8).map(|head| head.split_at(4)) else { return Ok(false) };
        let number = |bytes: &[u8]| bytes.iter().fold(0, |number, &byte| number << 8 | u64::from(byte));
        // 1 means that a 64-bit size follows the type; 0 that the box is the last.
        let size_bytes = match number(size) {
            0 => u64::MAX - at,
            1 => number(&head[8..]),
            size_bytes => size_bytes,
        };
        if kind == b"moov" {
            let mut index = Vec::new();
            file.seek(SeekFrom::Start(at))?;
            file.take(size_bytes.min(MAX_INDEX_BYTES)).read_to_end(&mut index)?;
            return Ok(index.windows(ENCRYPTED.len()).any(|bytes| bytes == ENCRYPTED));
        }
        match at.checked_add(size_bytes).filter(|_| size_bytes >= 8 && (at > 0 || kind == b"ftyp")) {
            Some(next) => at = next,
            None => return Ok(false),
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn verdict(parts: &[&[u8]]) -> bool {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&parts.concat()).unwrap();
        is_encrypted(&mut file).unwrap()
    }

    #[test]
    fn only_an_index_with_encrypted_video_counts() {
        let (start, data) = (b"\0\0\0\x0cftypisom", b"\0\0\0\x0cmdatencv");
        assert!(verdict(&[start, b"\0\0\0\x10moov....encv"]));
        assert!(verdict(&[start, data, b"\0\0\0\0moov....encv...."]));
        assert!(verdict(&[start, b"\0\0\0\x01mdat\0\0\0\0\0\0\0\x10", b"\0\0\0\x10moov....encv"]));
        for parts in
            [&[&start[..], data][..], &[start, b"\0\0\0\x10moov....avc1encv"], &[b"\0\0\0\x10moof....encv"], &[b""]]
        {
            assert!(!verdict(parts), "{parts:?}");
        }
        for size in [b"\0\0\0\x07", b"\xff\xff\xff\xff", b"\0\0\0\x01"] {
            assert!(!verdict(&[start, size, b"mdat", b"\0\0\0\x10moov....encv"]), "{size:?}");
        }
    }
}
