//! Reads the fields of records and messages, one after another.
//!
//! Three encodings have the same fields: records of MCAP and messages of ROS 1 are little-endian and packed; messages of
//! ROS 2 are CDR (OMG DDS-XTypes 1.3, 7.4.3): numbers are aligned to their size, and four bytes in front state the byte
//! order. A text is its length and its bytes, in CDR with a zero at the end.

/// A method for each kind of number, with its name.
macro_rules! numbers {
    ($($number:ident),*) => { $(pub fn $number(&mut self) -> Option<$number> {
        self.number().map($number::from_le_bytes)
    })* };
}

/// A cursor over fields. Every method returns `None` beyond the end.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Largest alignment of a number, in bytes.
    max_alignment: usize,
    is_big_endian: bool,
}

impl<'a> Fields<'a> {
    /// Reads packed little-endian fields.
    pub fn packed(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, max_alignment: 1, is_big_endian: false }
    }

    /// Reads CDR after its four bytes in front; `None` if they are of another representation.
    pub fn cdr(bytes: &'a [u8]) -> Option<Self> {
        let (&[zero, kind, ..], bytes) = bytes.split_first_chunk::<4>()?;
        let (is_big_endian, max_alignment) = match (zero, kind) {
            (0, 0) => (true, 8),
            (0, 1) => (false, 8),
            (0, 6) => (true, 4),
            (0, 7) => (false, 4),
            _ => return None,
        };
        Some(Self { bytes, at: 0, max_alignment, is_big_endian })
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..)?.get(..count)?;
        self.at += count;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N.min(self.max_alignment));
        let mut number: [u8; N] = self.take(N)?.try_into().ok()?;
        if self.is_big_endian {
            number.reverse();
        }
        Some(number)
    }

    numbers!(u8, u16, u32, i32, u64, f64);

    pub fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        numbers.iter_mut().try_for_each(|number| self.f64().map(|read| *number = read))?;
        Some(numbers)
    }

    /// Reads a number of bytes, and that many bytes.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    /// Reads a text; `None` if it is not UTF-8.
    pub fn text(&mut self) -> Option<&'a str> {
        let bytes = self.bytes()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_encodings_give_the_same_fields() {
        let packed = [&[7][..], &2_u16.to_le_bytes(), &3_u32.to_le_bytes()].concat();
        let mut fields = Fields::packed(&packed);
        assert_eq!((fields.u8(), fields.u16(), fields.u32()), (Some(7), Some(2), Some(3)));
        // Eight bytes begin at a multiple of 8 after the first four bytes; in the newer version, of 4.
        for (head, padding, is_big) in [([0, 1, 0, 0], 7, false), ([0, 0, 0, 0], 7, true), ([0, 7, 0, 0], 3, false)] {
            let number = if is_big { 9_u64.to_be_bytes() } else { 9_u64.to_le_bytes() };
            let length = if is_big { 3_u32.to_be_bytes() } else { 3_u32.to_le_bytes() };
            let message = [&head[..], &length, b"hi\0", &[5, 6], &vec![0; padding], &number].concat();
            let mut fields = Fields::cdr(&message).unwrap();
            assert_eq!((fields.text(), fields.u8(), fields.u8()), (Some("hi"), Some(5), Some(6)));
            assert_eq!((fields.u64(), fields.u64()), (Some(9), None), "{head:?}");
        }
        assert!(Fields::cdr(&[0, 3, 0, 0, 1]).is_none() && Fields::cdr(&[0, 1, 0]).is_none());
    }

    #[test]
    fn lengths_beyond_the_end_are_refused() {
        let mut fields = Fields::packed(&[0xFF; 6]);
        assert_eq!(fields.bytes(), None);
        assert_eq!(Fields::packed(&[2, 0, 0, 0, 0xC3, 0x28]).text(), None);
    }
}
