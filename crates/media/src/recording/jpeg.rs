//! Size and samples of JPEG files.

use std::io::{BufReader, ErrorKind, Read, Seek};

use super::fault::PictureFault;
use super::samples::SampleFormat;

/// Maximum number of segments before the frame header; cameras write some tens.
const MAX_SEGMENTS: usize = 1000;

/// Maximum number of bytes outside segments that are skipped before the frame header.
const MAX_STRAY_BYTES: usize = 1 << 16;

/// Reads size (columns, rows) and samples from the frame header (SOF segment) of a JPEG without decoding pixels. `file`
/// must be at its start.
pub(super) fn read_header(file: &mut BufReader<impl Read + Seek>) -> Result<((u32, u32), SampleFormat), PictureFault> {
    fn read<const N: usize>(file: &mut impl Read) -> Result<[u8; N], PictureFault> {
        let mut bytes = [0; N];
        file.read_exact(&mut bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => PictureFault::Truncated,
            _ => PictureFault::Io(error),
        })?;
        Ok(bytes)
    }
    // A marker is FF and a code.
    let [mut prefix, mut code] = read(file)?;
    let mut stray_bytes = 0;
    for _ in 0..MAX_SEGMENTS {
        // Any FF may pad a marker; skip other bytes between segments.
        while prefix != 0xFF || matches!(code, 0 | 0xFF) {
            (prefix, [code]) = (code, read(file)?);
            stray_bytes += 1;
            if stray_bytes > MAX_STRAY_BYTES {
                return Err(PictureFault::Damaged("no frame where one should be".into()));
            }
        }
        match code {
            // TEM, RSTn and SOI have no segment.
            0x01 | 0xD0..=0xD8 => {}
            // SOFn; DHT, JPG and DAC lie in the same range. Length and precision come before the size.
            0xC0..=0xCF if !matches!(code, 0xC4 | 0xC8 | 0xCC) => {
                let [_, _, _, y, y_low, x, x_low, components] = read(file)?;
                let size = [[x, x_low], [y, y_low]].map(|bytes| u32::from(u16::from_be_bytes(bytes)));
                // CMYK is decoded to RGB.
                let channels = if components == 1 { 1 } else { 3 };
                return Ok((size.into(), SampleFormat { channels, is_16bit: false }));
            }
            // EOI or SOS.
            0xD9 | 0xDA => return Err(PictureFault::Damaged("no frame before its data".into())),
            _ => {
                // The length includes its own two bytes.
                let length = i64::from(u16::from_be_bytes(read(file)?));
                file.seek_relative((length - 2).max(0))?;
            }
        }
        [prefix, code] = read(file)?;
    }
    Err(PictureFault::Damaged(format!("more than {MAX_SEGMENTS} segments before its frame")))
}
