//! The portable float map: one float a pixel, bottom row first. The usual way to keep disparity and depth.

use std::io::Write;
use std::path::Path;

use super::coded::check_size;
use super::decode::Scratch;
use super::depth_covers;
use super::fault::PictureFault;
use super::unit::Meaning;
use crate::frame::DepthMap;
use crate::optics::StereoRig;

/// Whether the name says that the file is a PFM.
pub(super) fn is_named(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pfm"))
}

/// Reads metres, or what else the file says that it holds; what is unknown becomes 0.
pub(super) fn read(path: &Path) -> Result<(DepthMap, Option<Meaning>), PictureFault> {
    let mut map = DepthMap::default();
    let ((width, height), says) = parse(Scratch::default().read_pfm(path)?, &mut map.metres)?;
    (map.width, map.height) = (width, height);
    Ok((map, says))
}

/// Reads disparities that `rig` turns into metres. They cover a colour picture of `color` pixels, for which `rig` is.
pub(super) fn read_disparity_as_depth(
    path: &Path,
    rig: &StereoRig,
    color: (u32, u32),
    scratch: &mut Scratch,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let (found, _) = parse(scratch.read_pfm(path)?, &mut into.metres)?;
    if !depth_covers(found, color) {
        return Err(PictureFault::DepthSize { found, color });
    }
    (into.width, into.height) = found;
    let zoom = color.0 as f32 / found.0 as f32;
    for value in &mut into.metres {
        *value = if DepthMap::is_known(*value) { rig.depth_m(*value * zoom) } else { 0.0 };
    }
    Ok(())
}

/// Columns and rows, what the file says that it holds, and the values, top row first; what is unknown becomes 0.
fn parse(bytes: &[u8], values: &mut Vec<f32>) -> Result<((u32, u32), Option<Meaning>), PictureFault> {
    let mut rest = bytes;
    let magic = word(&mut rest)?;
    if magic != "Pf" {
        return Err(if magic == "PF" {
            PictureFault::NotDepth("a colour PFM")
        } else {
            PictureFault::Format("grey PFM")
        });
    }
    let width = number(word(&mut rest)?)?;
    let height = number(word(&mut rest)?)?;
    check_size(width, height)?;
    // Only the sign is used: negative means that the low byte comes first.
    let written = word(&mut rest)?;
    let scale: f32 = number(written)?;
    let row_bytes = width as usize * 4;
    let data = rest.get(..row_bytes * height as usize).ok_or(PictureFault::Truncated)?;

    let from_bytes = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let rows = data.chunks_exact(row_bytes).rev();
    let read = rows.flat_map(|row| row.as_chunks().0).map(|&bytes| from_bytes(bytes));
    values.clear();
    values.extend(read.map(|value| if DepthMap::is_known(value) { value } else { 0.0 }));
    Ok(((width, height), Meaning::of_pfm_scale(written)))
}

/// The next word of the header. Exactly one white space ends it, since pixels may follow.
fn word<'a>(rest: &mut &'a [u8]) -> Result<&'a str, PictureFault> {
    let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).ok_or(PictureFault::Truncated)?;
    let length = rest[start..].iter().position(u8::is_ascii_whitespace).ok_or(PictureFault::Truncated)?;
    let word = &rest[start..start + length];
    *rest = &rest[start + length + 1..];
    std::str::from_utf8(word).map_err(|_| PictureFault::Damaged("its header is not text".into()))
}

fn number<T: std::str::FromStr>(word: &str) -> Result<T, PictureFault> {
    let short: String = word.chars().take(20).collect();
    word.parse().map_err(|_| PictureFault::Damaged(format!("{short:?} in its header is not a number")))
}

/// Appends `values` (`height` x `width`, row-major), which mean what it says, to `file`.
pub(super) fn write(width: u32, height: u32, values: &[f32], says: Meaning, file: &mut Vec<u8>) {
    // Writing to memory does not fail.
    let _ = write!(file, "Pf\n{width} {height}\n{}\n", says.pfm_scale());
    for row in values.chunks_exact(width.max(1) as usize).rev() {
        file.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
}
