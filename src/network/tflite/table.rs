//! FlatBuffers, as far as a TFLite file needs them: tables whose fields may be missing, and vectors. Every offset comes from the
//! file and is checked before it is followed; no table is visited from itself.

/// A place in a file that cannot be read: it is cut, or something else.
pub const CUT: &str = "it is cut, or no TFLite file";

/// A table.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// `N` bytes at a place.
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], String> {
    let end = at.checked_add(N).ok_or(CUT)?;
    Ok(bytes.get(at..end).ok_or(CUT)?.try_into().expect("N bytes"))
}

/// Where an offset at a place leads to.
fn followed(bytes: &[u8], at: usize) -> Result<usize, String> {
    let offset = u32::from_le_bytes(bytes_at(bytes, at)?) as usize;
    at.checked_add(offset).filter(|&to| to < bytes.len()).ok_or_else(|| CUT.to_owned())
}

impl<'a> Table<'a> {
    /// The one that a file begins with.
    pub fn root(bytes: &'a [u8]) -> Result<Self, String> {
        Ok(Self { bytes, at: followed(bytes, 0)? })
    }

    /// Where a field is, unless it is left out.
    fn field(&self, number: usize) -> Result<Option<usize>, String> {
        let back = i32::from_le_bytes(bytes_at(self.bytes, self.at)?);
        let fields = self.at.checked_add_signed(-(back as isize)).ok_or(CUT)?;
        let size = u16::from_le_bytes(bytes_at(self.bytes, fields)?) as usize;
        let entry = 4 + 2 * number;
        if entry + 2 > size {
            return Ok(None);
        }
        let offset = u16::from_le_bytes(bytes_at(self.bytes, fields + entry)?) as usize;
        Ok((offset != 0).then_some(self.at + offset))
    }

    /// A number of one byte; 0 where it is left out.
    pub fn byte(&self, number: usize) -> Result<i8, String> {
        let at = self.field(number)?;
        at.map_or(Ok(0), |at| Ok(i8::from_le_bytes(bytes_at(self.bytes, at)?)))
    }

    /// A number of four bytes; 0 where it is left out.
    pub fn int(&self, number: usize) -> Result<i32, String> {
        let at = self.field(number)?;
        at.map_or(Ok(0), |at| Ok(i32::from_le_bytes(bytes_at(self.bytes, at)?)))
    }

    /// Where a vector's elements of `size` bytes begin, and how many there are.
    fn vector(&self, number: usize, size: usize) -> Result<(usize, usize), String> {
        let Some(at) = self.field(number)? else { return Ok((0, 0)) };
        let at = followed(self.bytes, at)?;
        let count = u32::from_le_bytes(bytes_at(self.bytes, at)?) as usize;
        let first = at + 4;
        let end = count.checked_mul(size).and_then(|bytes| first.checked_add(bytes)).ok_or(CUT)?;
        if end > self.bytes.len() { Err(CUT.to_owned()) } else { Ok((first, count)) }
    }

    /// A vector of bytes; empty where it is left out.
    pub fn bytes(&self, number: usize) -> Result<&'a [u8], String> {
        let (first, count) = self.vector(number, 1)?;
        Ok(&self.bytes[first..first + count])
    }

    /// A vector of numbers.
    pub fn ints(&self, number: usize) -> Result<Vec<i32>, String> {
        let (first, count) = self.vector(number, 4)?;
        Ok(self.bytes[first..first + 4 * count].as_chunks().0.iter().map(|four| i32::from_le_bytes(*four)).collect())
    }

    /// A table in a field.
    pub fn table(&self, number: usize) -> Result<Option<Self>, String> {
        let at = self.field(number)?;
        at.map(|at| Ok(Self { bytes: self.bytes, at: followed(self.bytes, at)? })).transpose()
    }

    /// A vector of tables.
    pub fn tables(&self, number: usize) -> Result<Vec<Self>, String> {
        let (first, count) = self.vector(number, 4)?;
        let table = |k: usize| Ok(Self { bytes: self.bytes, at: followed(self.bytes, first + 4 * k)? });
        (0..count).map(table).collect()
    }
}
