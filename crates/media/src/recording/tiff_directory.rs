//! Directories of TIFF files, which EXIF and Multi-Picture files have as well (TIFF 6.0, section 2). The crates `nom-exif`,
//! which only reads, and `little_exif`, which writes EXIF anew, cannot change a picture's own in place.

use std::fs::File;
use std::io::{Read, Seek};

use super::fault::PictureFault;

/// Bytes of a TIFF in which its first directory is looked for; cameras write it at the start.
const MAX_TIFF_START_BYTES: u64 = 1 << 20;

/// The structure of a TIFF file; no position leads outside of it.
pub(super) struct TiffDirectories<'a> {
    file: &'a [u8],
    is_big_endian: bool,
}

impl<'a> TiffDirectories<'a> {
    /// Reads the header; `None` if it is another file.
    pub(super) fn parse(file: &'a [u8]) -> Option<Self> {
        let is_big_endian = match file.first_chunk()? {
            b"MM\0*" => true,
            b"II*\0" => false,
            _ => return None,
        };
        Some(Self { file, is_big_endian })
    }

    pub(super) fn u16_at(&self, at: usize) -> Option<u16> {
        let bytes = *self.file.get(at..)?.first_chunk()?;
        Some(if self.is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    pub(super) fn u32_at(&self, at: usize) -> Option<usize> {
        let bytes = *self.file.get(at..)?.first_chunk()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) } as usize)
    }

    /// Returns the position of a tag's entry in the directory at a position. An entry has the tag (2 bytes), the type (2), the
    /// number of values (4), and the values or their position (4).
    pub(super) fn find_tag(&self, directory: usize, tag: u16) -> Option<usize> {
        let entries = (0..usize::from(self.u16_at(directory)?)).map(|entry| directory + 2 + 12 * entry);
        entries.into_iter().find(|&at| self.u16_at(at) == Some(tag))
    }

    /// Returns the entries of the directory at a position: tag, type, and values as stored. Those that lead outside of
    /// the file are left out.
    pub(super) fn entries(&self, directory: usize) -> impl Iterator<Item = (u16, u16, &'a [u8])> {
        /// Bytes of a value, by its type.
        const BYTES: [usize; 14] = [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4];
        let count = self.u16_at(directory).unwrap_or(0);
        (0..usize::from(count)).filter_map(move |k| {
            let at = directory + 2 + 12 * k;
            let (tag, kind, count) = (self.u16_at(at)?, self.u16_at(at + 2)?, self.u32_at(at + 4)?);
            let bytes = count.checked_mul(*BYTES.get(usize::from(kind))?)?;
            let from = if bytes <= 4 { at + 8 } else { self.u32_at(at + 8)? };
            Some((tag, kind, self.file.get(from..from.checked_add(bytes)?)?))
        })
    }
}

/// Returns whether a TIFF is the raw picture of a camera, whose first picture is only a small copy or is not developed.
pub(super) fn is_raw_tiff(file: &mut File) -> Result<bool, PictureFault> {
    const SUBFILE_TYPE: u16 = 254;
    const REDUCED: usize = 1;
    const PHOTOMETRIC: u16 = 262;
    const COLOR_FILTER_ARRAY: u16 = 32803;
    const DNG_VERSION: u16 = 50706;
    let mut start = Vec::new();
    file.take(MAX_TIFF_START_BYTES).read_to_end(&mut start)?;
    file.rewind()?;
    let Some(directory) = TiffDirectories::parse(&start) else { return Ok(false) };
    let value_at = |tag| directory.find_tag(directory.u32_at(4)?, tag).map(|at| at + 8);
    let is_reduced = value_at(SUBFILE_TYPE).and_then(|at| directory.u32_at(at)).is_some_and(|kind| kind & REDUCED != 0);
    let is_undeveloped = value_at(PHOTOMETRIC).and_then(|at| directory.u16_at(at)) == Some(COLOR_FILTER_ARRAY);
    Ok(is_reduced || is_undeveloped || value_at(DNG_VERSION).is_some())
}
