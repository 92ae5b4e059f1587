//! Elements of EBML (RFC 8794), in which Matroska is written: an ID, a length, and the content.

use std::iter;

/// Most bytes of an element before its content.
pub(super) const MAX_HEAD_BYTES: usize = 12;

/// What precedes the content of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    pub id: u32,
    /// Length of the content; `None` if it is unknown.
    pub length: Option<u64>,
    /// Bytes of the head itself.
    pub bytes: usize,
}

impl Head {
    /// Parses the head at the beginning of `bytes`; `None` if it is invalid or cut.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let id_bytes = coded_bytes(bytes).filter(|&count| count <= 4)?;
        let id = big_endian(bytes.get(..id_bytes)?) as u32;
        let (length, length_bytes) = parse_number(&bytes[id_bytes..])?;
        let unknown = (1 << (7 * length_bytes)) - 1;
        Some(Self { id, length: Some(length).filter(|&length| length != unknown), bytes: id_bytes + length_bytes })
    }
}

/// Parses the number at the beginning of `bytes`; returns its value and the count of its bytes.
pub(super) fn parse_number(bytes: &[u8]) -> Option<(u64, usize)> {
    let count = coded_bytes(bytes)?;
    Some((big_endian(bytes.get(..count)?) & ((1 << (7 * count)) - 1), count))
}

/// Returns the count of bytes that the first one states by its leading zeros.
fn coded_bytes(bytes: &[u8]) -> Option<usize> {
    let count = bytes.first()?.leading_zeros() as usize + 1;
    (count <= 8).then_some(count)
}

/// Returns the number that the content of an element is, of at most 8 bytes.
pub(super) fn big_endian(content: &[u8]) -> u64 {
    content.iter().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// Returns the text that the content of an element is, without the zeros that may end it.
pub(super) fn text(content: &[u8]) -> String {
    String::from_utf8_lossy(content).trim_end_matches('\0').to_owned()
}

/// Returns ID and content of the whole elements at the beginning of `bytes`.
pub(super) fn children(mut bytes: &[u8]) -> impl Iterator<Item = (u32, &[u8])> {
    iter::from_fn(move || {
        let head = Head::parse(bytes)?;
        let (content, rest) = bytes[head.bytes..].split_at_checked(usize::try_from(head.length?).ok()?)?;
        bytes = rest;
        Some((head.id, content))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_of_every_length_are_read() {
        let head = |bytes: &[u8]| Head::parse(bytes).map(|head| (head.id, head.length, head.bytes));
        assert_eq!(head(&[0xA3, 0x85]), Some((0xA3, Some(5), 2)));
        assert_eq!(head(&[0x1A, 0x45, 0xDF, 0xA3, 0x40, 0x02]), Some((0x1A45_DFA3, Some(2), 6)));
        assert_eq!(head(&[0xA3, 1, 0, 0, 0, 0, 0, 1, 0]), Some((0xA3, Some(256), 9)));
        for unknown in [&[0xE7, 0xFF][..], &[0xE7, 1, 255, 255, 255, 255, 255, 255, 255]] {
            assert_eq!(head(unknown), Some((0xE7, None, unknown.len())));
        }
        for wrong in [&[][..], &[0xA3], &[0, 0x81], &[0x08, 1, 1, 1, 1, 0x81], &[0xA3, 0], &[0xA3, 0x40], &[0x42]] {
            assert_eq!(head(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn children_end_where_one_is_cut() {
        let bytes = [0xA3, 0x81, 7, 0xE7, 0x80, 0xA3, 0x83, 1];
        assert_eq!(children(&bytes).collect::<Vec<_>>(), [(0xA3, &[7][..]), (0xE7, &[])]);
        assert_eq!(big_endian(&[1, 2]), 258);
        assert_eq!(text(b"DEPTH\0\0"), "DEPTH");
    }
}
