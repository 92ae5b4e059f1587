//! Reads FlatBuffers as far as TFLite needs them: tables with optional fields, and vectors. Every offset comes from the
//! file and is checked before it is followed; no table is visited from itself.

/// The error for an unreadable place: the file is truncated or of another format.
pub const TRUNCATED: &str = "it is incomplete, or not a TFLite file";

/// A table.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Reads `N` bytes at a position.
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], String> {
    let end = at.checked_add(N).ok_or(TRUNCATED)?;
    Ok(bytes.get(at..end).ok_or(TRUNCATED)?.try_into().expect("N bytes"))
}

/// Follows the offset at a position.
fn follow_offset(bytes: &[u8], at: usize) -> Result<usize, String> {
    let offset = u32::from_le_bytes(bytes_at(bytes, at)?) as usize;
    at.checked_add(offset).filter(|&to| to < bytes.len()).ok_or_else(|| TRUNCATED.to_owned())
}

impl<'a> Table<'a> {
    /// Returns the root table of a file.
    pub fn root(bytes: &'a [u8]) -> Result<Self, String> {
        Ok(Self { bytes, at: follow_offset(bytes, 0)? })
    }

    /// Returns the position of a field; `None` if it is absent.
    fn field_position(&self, number: usize) -> Result<Option<usize>, String> {
        let back = i32::from_le_bytes(bytes_at(self.bytes, self.at)?);
        let fields = self.at.checked_add_signed(-(back as isize)).ok_or(TRUNCATED)?;
        let size = u16::from_le_bytes(bytes_at(self.bytes, fields)?) as usize;
        let entry = 4 + 2 * number;
        if entry + 2 > size {
            return Ok(None);
        }
        let offset = u16::from_le_bytes(bytes_at(self.bytes, fields + entry)?) as usize;
        Ok((offset != 0).then_some(self.at + offset))
    }

    /// Reads a field of one byte; 0 if absent.
    pub fn byte(&self, number: usize) -> Result<i8, String> {
        let at = self.field_position(number)?;
        at.map_or(Ok(0), |at| Ok(i8::from_le_bytes(bytes_at(self.bytes, at)?)))
    }

    /// Reads a field of four bytes; 0 if absent.
    pub fn int(&self, number: usize) -> Result<i32, String> {
        let at = self.field_position(number)?;
        at.map_or(Ok(0), |at| Ok(i32::from_le_bytes(bytes_at(self.bytes, at)?)))
    }

    /// Returns position and number of a vector's elements, which have `size` bytes.
    fn vector_position(&self, number: usize, size: usize) -> Result<(usize, usize), String> {
        let Some(at) = self.field_position(number)? else { return Ok((0, 0)) };
        let at = follow_offset(self.bytes, at)?;
        let count = u32::from_le_bytes(bytes_at(self.bytes, at)?) as usize;
        let first = at + 4;
        let end = count.checked_mul(size).and_then(|bytes| first.checked_add(bytes)).ok_or(TRUNCATED)?;
        if end > self.bytes.len() { Err(TRUNCATED.to_owned()) } else { Ok((first, count)) }
    }

    /// Reads a vector of bytes; empty if absent.
    pub fn bytes(&self, number: usize) -> Result<&'a [u8], String> {
        let (first, count) = self.vector_position(number, 1)?;
        Ok(&self.bytes[first..first + count])
    }

    /// Reads a vector of integers.
    pub fn ints(&self, number: usize) -> Result<Vec<i32>, String> {
        let (first, count) = self.vector_position(number, 4)?;
        Ok(self.bytes[first..first + 4 * count].as_chunks().0.iter().map(|four| i32::from_le_bytes(*four)).collect())
    }

    /// Reads a table; `None` if absent.
    pub fn table(&self, number: usize) -> Result<Option<Self>, String> {
        let at = self.field_position(number)?;
        at.map(|at| Ok(Self { bytes: self.bytes, at: follow_offset(self.bytes, at)? })).transpose()
    }

    /// Reads a vector of tables.
    pub fn tables(&self, number: usize) -> Result<Vec<Self>, String> {
        let (first, count) = self.vector_position(number, 4)?;
        let table = |k: usize| Ok(Self { bytes: self.bytes, at: follow_offset(self.bytes, first + 4 * k)? });
        (0..count).map(table).collect()
    }
}
