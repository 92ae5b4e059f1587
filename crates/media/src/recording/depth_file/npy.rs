//! Arrays of NumPy: `.npy` ("NPY format", numpy.org/doc/stable/reference/generated/numpy.lib.format.html), and the first
//! map in a `.npz`, which is a zip of them. The crate `npyz` brings 14 packages, and multiplies the sides of a hostile header
//! without a check.

use std::fs::File;
use std::io::Read;

use exr::prelude::f16;
use zip::ZipArchive;
use zip::result::ZipError;

use super::values::{Samples, Values};
use crate::recording::decoders::check_size;
use crate::recording::fault::PictureFault;
use crate::recording::role::Role;

/// Longest header that is read; those of arrays without named fields have 128 bytes.
const MAX_HEADER_BYTES: usize = 1 << 16;
/// Largest number of arrays that are searched for a map.
const MAX_ARRAYS: usize = 64;
/// Largest side of an array that is a camera's matrix or pose rather than a map, if there is another.
const MAX_MATRIX_SIDE: usize = 4;
/// Names of the map among several arrays that do not say what it is.
const PREDICTIONS: [&str; 2] = ["prediction", "pred"];

/// Parses an array of two dimensions; further ones of length 1, and equal channels, are ignored.
pub(super) fn parse(file: &[u8]) -> Result<Values, PictureFault> {
    let (header, data) = Header::split(file)?;
    header.read(data)
}

/// What the header of an array says.
struct Header {
    /// Rows and columns.
    shape: [usize; 2],
    is_column_major: bool,
    is_big_endian: bool,
    /// Type: `f`, `i`, `u` or `b`.
    kind: u8,
    /// Bytes per number.
    bytes: usize,
}

impl Header {
    /// Splits a file, or the beginning of one, into its header and the numbers.
    fn split(file: &[u8]) -> Result<(Self, &[u8]), PictureFault> {
        let header_at = match file.get(6) {
            Some(1) => 10,
            Some(2 | 3) => 12,
            Some(version) => return Err(PictureFault::Damaged(format!("version {version} of NPY is unknown"))),
            None => return Err(PictureFault::Truncated),
        };
        let length = file.get(8..header_at).ok_or(PictureFault::Truncated)?;
        let length = length.iter().rev().fold(0, |length, byte| length << 8 | usize::from(*byte));
        if length > MAX_HEADER_BYTES {
            return Err(PictureFault::Damaged(format!("its header claims {length} bytes")));
        }
        let header = file.get(header_at..header_at + length).ok_or(PictureFault::Truncated)?;
        let header = std::str::from_utf8(header).map_err(|_| PictureFault::Damaged("its header is not text".into()))?;
        Ok((Self::parse(header)?, &file[header_at + length..]))
    }

    /// Parses the header, a Python dictionary with `descr`, `fortran_order` and `shape`.
    fn parse(text: &str) -> Result<Self, PictureFault> {
        let short = || text.trim().chars().take(120).collect::<String>();
        let broken = || PictureFault::Damaged(format!("{:?} is not the header of an array", short()));
        let value = |key: &str| {
            let after = text.split_once(&format!("'{key}'"))?.1.trim_start();
            Some(after.strip_prefix(':')?.trim_start())
        };
        let descr = value("descr").ok_or_else(broken)?;
        let descr = descr.strip_prefix('\'').and_then(|text| text.split('\'').next()).unwrap_or_default();
        let is_column_major = value("fortran_order").ok_or_else(broken)?.starts_with("True");
        let shape = value("shape").and_then(|text| text.strip_prefix('(')?.split(')').next()).ok_or_else(broken)?;
        let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
        let sides: Vec<usize> = sides.map(str::parse).collect::<Result<_, _>>().map_err(|_| broken())?;
        let of_map: Vec<usize> = sides.iter().copied().filter(|&side| side != 1).collect();
        let shape = match (sides.len(), of_map.as_slice()) {
            (2, _) => [sides[0], sides[1]],
            (3.., &[rows, columns]) => [rows, columns],
            (3, &[maps, rows, columns]) if columns > MAX_MATRIX_SIDE => {
                let of = format!("an array of {maps} maps of {columns}x{rows}, as of a video,");
                return Err(PictureFault::NotAMap(of));
            }
            _ => return Err(PictureFault::NotAMap(format!("an array of shape ({})", shape.trim()))),
        };
        let (kind, bytes) = match descr.trim_start_matches(['<', '>', '|', '=']) {
            "f2" => (b'f', 2),
            "f4" => (b'f', 4),
            "f8" => (b'f', 8),
            "u1" | "b1" => (b'u', 1),
            "u2" => (b'u', 2),
            "u4" => (b'u', 4),
            "i2" => (b'i', 2),
            "i4" => (b'i', 4),
            "i8" => (b'i', 8),
            "u8" => (b'u', 8),
            _ => return Err(PictureFault::NotAMap(format!("an array of type {descr:?}"))),
        };
        Ok(Self { shape, is_column_major, is_big_endian: descr.starts_with('>'), kind, bytes })
    }

    fn read(&self, data: &[u8]) -> Result<Values, PictureFault> {
        let [rows, columns] = self.shape;
        let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        check_size(side(columns), side(rows))?;
        let data = data.get(..rows * columns * self.bytes).ok_or(PictureFault::Truncated)?;
        let stored = data.chunks_exact(self.bytes).map(|bytes| self.number(bytes));
        let numbers: Vec<f32> = match self.is_column_major {
            false => stored.collect(),
            true => {
                let stored: Vec<f32> = stored.collect();
                (0..rows * columns).map(|k| stored[k % columns * rows + k / columns]).collect()
            }
        };
        let samples = match (self.kind, self.bytes) {
            (b'f', _) => Samples::Float,
            (_, 1) => Samples::Eight,
            _ => Samples::Whole,
        };
        Ok(Values { size: (side(columns), side(rows)), numbers, samples, ..Values::default() })
    }

    fn number(&self, bytes: &[u8]) -> f32 {
        let mut ordered = [0; 8];
        ordered[..bytes.len()].copy_from_slice(bytes);
        if self.is_big_endian {
            ordered[..bytes.len()].reverse();
        }
        let whole = u64::from_le_bytes(ordered);
        match (self.kind, self.bytes) {
            (b'f', 2) => f16::from_bits(whole as u16).to_f32(),
            (b'f', 4) => f32::from_bits(whole as u32),
            (b'f', _) => f64::from_bits(whole) as f32,
            (b'i', 2) => f32::from(whole as i16),
            (b'i', 4) => whole as i32 as f32,
            (b'i', _) => whole as i64 as f32,
            _ => whole as f32,
        }
    }
}

/// Reads the map in an archive of arrays, each of at most `max_bytes`. Without a usual name it is the first, and a note
/// names it if there are others.
pub(super) fn read_archive(file: File, max_bytes: u64) -> Result<Values, PictureFault> {
    let mut archive = ZipArchive::new(file).map_err(zip_fault)?;
    let (mut maps, mut first_fault) = (Vec::new(), None);
    for index in 0..archive.len().min(MAX_ARRAYS) {
        let member = archive.by_index(index).map_err(zip_fault)?;
        let name = String::from_utf8_lossy(member.name_raw()).into_owned();
        let Some(stem) = name.to_lowercase().strip_suffix(".npy").map(|stem| name[..stem.len()].to_owned()) else {
            continue;
        };
        let mut start = Vec::new();
        read_member(member, MAX_HEADER_BYTES as u64, &mut start)?;
        match Header::split(&start) {
            // Cameras and poses are stored beside the map.
            Err(fault @ PictureFault::NotAMap(_)) => first_fault = first_fault.or(Some(fault)),
            header => {
                let is_matrix =
                    header.is_ok_and(|(header, _)| header.shape.iter().all(|&side| side <= MAX_MATRIX_SIDE));
                let is_prediction = PREDICTIONS.iter().any(|known| stem.eq_ignore_ascii_case(known));
                let rank = (Role::of_name(&stem), !is_prediction, Role::count_other_words(&stem));
                maps.push((is_matrix, rank, index, stem));
            }
        }
    }
    maps.sort_unstable();
    let Some((_, (role, is_unnamed, _), index, stem)) = maps.first() else {
        return Err(first_fault.unwrap_or_else(|| PictureFault::NotAMap("an archive without arrays".to_owned())));
    };
    if matches!(role, Role::Infrared | Role::Other) {
        return Err(PictureFault::NotAMap(format!("an archive of {stem:?}, without an array of depth,")));
    }
    let member = archive.by_index(*index).map_err(zip_fault)?;
    if member.size() > max_bytes {
        return Err(PictureFault::FileSize { bytes: member.size(), max_bytes });
    }
    let mut array = Vec::new();
    read_member(member, max_bytes, &mut array)?;
    let others = maps.iter().filter(|(is_matrix, ..)| !is_matrix).count();
    let note = (*role == Role::Unstated && *is_unnamed && others > 1).then(|| {
        format!(
            "has {others} arrays that may be the map, of which {stem:?} is taken, the first; one of the name \"depth\" \
             has priority"
        )
    });
    Ok(Values { notes: note.into_iter().collect(), role: *role, ..parse(&array)? })
}

/// Reads the beginning of a file in an archive.
fn read_member(member: impl Read, max_bytes: u64, into: &mut Vec<u8>) -> Result<usize, PictureFault> {
    member.take(max_bytes).read_to_end(into).map_err(|error| zip_fault(ZipError::Io(error)))
}

fn zip_fault(error: ZipError) -> PictureFault {
    PictureFault::Damaged(error.to_string().replace('\n', " "))
}
