//! Copies a JPEG into one in which the decoder detects any missing part.
//!
//! Even in strict mode, the library decodes truncated data and fills in the rest: it reads zeros after the end marker.
//! In the copy, a truncated picture runs into bits that are no valid code, and the decoder reports the error.
//!
//! - Data before the start marker and after the end are dropped, and so are comments and thumbnails.
//! - Missing Huffman tables are inserted.
//! - Restart markers must count up, and match the number that the picture needs.
//! - Each run of entropy-coded data is followed by bits that are no valid code (all ones, which no table may assign),
//!   where the decoder of a complete picture never reads. A missing end marker is added.

mod tables;

pub(super) mod marker {
    pub const SOF: std::ops::RangeInclusive<u8> = 0xC0..=0xCF;
    pub const BASELINE: u8 = 0xC0;
    pub const EXTENDED: u8 = 0xC1;
    pub const PROGRESSIVE: u8 = 0xC2;
    pub const DHT: u8 = 0xC4;
    /// Temporary private use in arithmetic coding; without content.
    pub const TEM: u8 = 0x01;
    pub const JPG: u8 = 0xC8;
    pub const DAC: u8 = 0xCC;
    pub const RST: std::ops::RangeInclusive<u8> = 0xD0..=0xD7;
    pub const SOI: u8 = 0xD8;
    pub const EOI: u8 = 0xD9;
    pub const SOS: u8 = 0xDA;
    pub const DQT: u8 = 0xDB;
    pub const DRI: u8 = 0xDD;
    /// Adobe's marker, which defines the colour coding.
    pub const APP14: u8 = 0xEE;
}

/// One bits, as stuffed bytes FF 00, which no Huffman table may use as a code: more than the decoder prefetches.
const INVALID_CODE: [u8; 32] = {
    let mut ones = [0; 32];
    let mut at = 0;
    while at < ones.len() {
        ones[at] = 0xFF;
        at += 2;
    }
    ones
};

/// Why a file cannot be a complete picture.
#[allow(missing_docs)] // The messages say what the variants are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    #[error("there is no start marker")]
    NoStart,
    #[error("it ends within its header")]
    Header,
    #[error("there is no picture size before the picture")]
    NoSize,
    #[error("coding 0x{0:02X} is not supported")]
    Coding(u8),
    #[error("a part of the picture is missing: its restart markers are not consecutive")]
    Restart,
    #[error("a part of the picture is missing: it has only the first scan of a progressive one")]
    Scans,
}

/// Writes the JPEG in `bytes` to `file`, repaired as above; returns its width and height.
///
/// # Errors
/// It cannot be a complete picture.
pub fn repair_jpeg(bytes: &[u8], file: &mut Vec<u8>) -> Result<(usize, usize), Fault> {
    let start = bytes.windows(3).position(|three| three == [0xFF, marker::SOI, 0xFF]).ok_or(Fault::NoStart)?;
    let mut rest = strip_padding(&bytes[start + 2..]);
    file.clear();
    file.extend([0xFF, marker::SOI]);
    let (mut frame, mut has_huffman_tables) = (None::<Frame>, false);
    // Number of scans so far, and of coding units between two restarts (0: none).
    let (mut scans, mut interval) = (0, 0);
    while let Some((code, segment, after)) = next_segment(rest) {
        match code {
            marker::EOI | marker::SOI => break,
            marker::DHT => has_huffman_tables = true,
            marker::BASELINE | marker::EXTENDED | marker::PROGRESSIVE => {
                frame = Some(Frame::parse(segment).ok_or(Fault::Header)?);
            }
            marker::DRI => {
                let &[_, _, _, _, high, low, ..] = segment else { return Err(Fault::Header) };
                interval = usize::from(u16::from_be_bytes([high, low]));
            }
            marker::JPG | marker::DAC => return Err(Fault::Coding(code)),
            code if marker::SOF.contains(&code) => return Err(Fault::Coding(code)),
            _ => {}
        }
        if code == marker::SOS {
            let frame = frame.as_ref().ok_or(Fault::NoSize)?;
            if !has_huffman_tables {
                tables::append_huffman_tables(file);
                has_huffman_tables = true;
            }
            file.extend(segment);
            // Scans of some components have units of their own, and the decoder must find what follows directly behind
            // them, as behind the first scan of a progressive picture.
            let is_whole = !frame.progressive && segment.get(4) == Some(&frame.components);
            let is_marked = is_whole || frame.progressive && scans > 0;
            scans += 1;
            let restarts;
            (rest, restarts) = copy_scan(after, is_marked, file)?;
            if is_whole {
                let expected = if interval == 0 { 0 } else { frame.units.div_ceil(interval) - 1 };
                // Some cameras end the last interval with a restart, too.
                if restarts < expected || restarts > expected + usize::from(interval != 0) {
                    return Err(Fault::Restart);
                }
            }
            continue;
        }
        if matches!(code, marker::DHT | marker::DQT | marker::DRI | marker::APP14) || marker::SOF.contains(&code) {
            file.extend(segment);
        }
        rest = after;
    }
    match (scans, &frame) {
        (0, _) => return Err(Fault::Header),
        (1, Some(frame)) if frame.progressive => return Err(Fault::Scans),
        _ => {}
    }
    file.extend([0xFF, marker::EOI]);
    frame.map(|frame| frame.size).ok_or(Fault::NoSize)
}

/// Strips the zeros that a driver appends to a picture, which would count as coded data if its end is missing.
fn strip_padding(bytes: &[u8]) -> &[u8] {
    /// Coded data end with fewer zeros.
    const PADDING_BYTES: usize = 8;
    let used = bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    if bytes.len() - used < PADDING_BYTES { bytes } else { &bytes[..used] }
}

/// Contents of the frame header.
struct Frame {
    size: (usize, usize),
    components: u8,
    /// Minimum coded units (MCUs) in a scan of all components.
    units: usize,
    progressive: bool,
}

impl Frame {
    /// Parses a frame header segment with its marker; `None` if it is too short, or a size or sampling factor is 0.
    fn parse(segment: &[u8]) -> Option<Self> {
        let (&[_, code, _, _, _, height_high, height_low, width_high, width_low, components], sampling) =
            segment.split_first_chunk()?;
        let number = |high, low| usize::from(u16::from_be_bytes([high, low]));
        let (width, height) = (number(width_high, width_low), number(height_high, height_low));
        let sampling = sampling.as_chunks::<3>().0.get(..usize::from(components))?;
        // Sampling factors are two 4-bit numbers, horizontal and vertical; the largest ones define the coded unit.
        let largest = |shift: u8| sampling.iter().map(|&[_, factors, _]| usize::from(factors >> shift & 15)).max();
        // A single component has units of one block.
        let (across, down) = if components == 1 { (1, 1) } else { (largest(4)?, largest(0)?) };
        if width == 0 || height == 0 || across == 0 || down == 0 {
            return None;
        }
        let units = width.div_ceil(8 * across) * height.div_ceil(8 * down);
        Some(Self { size: (width, height), components, units, progressive: code == marker::PROGRESSIVE })
    }
}

/// Finds the next marker in `rest`, skipping other data; returns its code, the segment with the marker, and the
/// remaining data. `None` if there is no marker or its segment is truncated.
pub(super) fn next_segment(rest: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let at = rest.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF))?;
    let (code, after) = (rest[at + 1], &rest[at + 2..]);
    if matches!(code, marker::SOI | marker::EOI | marker::TEM) || marker::RST.contains(&code) {
        return Some((code, &rest[at..at + 2], after));
    }
    let &[high, low] = after.first_chunk()?;
    // The length counts its own two bytes; less is damage.
    let length = usize::from(u16::from_be_bytes([high, low])).max(2);
    let following = after.get(length..)?;
    Some((code, &rest[at..at + 2 + length], following))
}

/// Copies coded data up to the next marker that ends them, with [`INVALID_CODE`] after each run if `is_marked`.
/// Returns the remaining data, from that marker on, and the number of restarts.
fn copy_scan<'a>(bytes: &'a [u8], is_marked: bool, file: &mut Vec<u8>) -> Result<(&'a [u8], usize), Fault> {
    let (mut from, mut at, mut restarts) = (0, 0, 0);
    loop {
        let next = bytes[at..].iter().position(|&byte| byte == 0xFF).map(|found| at + found);
        let code = next.and_then(|next| bytes.get(next + 1).copied());
        let end = next.unwrap_or(bytes.len());
        match code {
            // A stuffed byte FF 00 is data.
            Some(0) => {
                at = end + 2;
                continue;
            }
            // Fill bytes before a marker.
            Some(0xFF) => {
                file.extend(&bytes[from..end]);
                (from, at) = (end + 1, end + 1);
                continue;
            }
            _ => file.extend(&bytes[from..end]),
        }
        if is_marked {
            file.extend(INVALID_CODE);
        }
        match code {
            Some(code) if marker::RST.contains(&code) => {
                if usize::from(code & 7) != restarts & 7 {
                    return Err(Fault::Restart);
                }
                restarts += 1;
                file.extend([0xFF, code]);
                (from, at) = (end + 2, end + 2);
            }
            // The end of the file, possibly in the middle of a marker.
            _ => return Ok((&bytes[end..], restarts)),
        }
    }
}
