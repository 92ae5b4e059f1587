//! Depth maps of single pictures, as files of any tool or inside photos: reads the numbers, decides what they mean, and
//! fits the map to its picture.

mod color_map;
mod exr;
mod fit;
mod inside;
mod layers;
mod meaning;
mod npy;
mod stated;
mod tiff;
mod unit;
mod values;

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

pub(super) use fit::fit_map;
pub use fit::{Fit, covers, describe_stretch, has_same_view, is_stretchable};
pub use inside::{DepthInside, has_other_view, read_inside};
pub use unit::DepthUnit;
#[doc(hidden)]
pub use values::has_colors;

use super::coded::{self, EncodedPicture};
use super::decoders::guard;
use super::fault::{PictureFault, open_fault};
use super::rgbd::StatedUnits;
use super::{MAX_PIXELS, RecordingError, pfm};
use bokehcam::frame::{DepthMap, DisparityMap};
use bokehcam_files::input;
use color_map::ColorMapped;
use meaning::Meaning;
use values::{Samples, Values};

/// File formats of depth maps, for messages.
const FORMATS: &str = "PNG, JPEG, TIFF, PFM, PGM, NPY, NPZ or EXR";

/// Extensions of the files of depth maps. The first is that of snapshots.
pub const EXTENSIONS: [&str; 11] = ["pfm", "npy", "npz", "exr", "tiff", "tif", "png", "pgm", "webp", "jpg", "jpeg"];

/// Largest file of floats: 8 bytes per pixel, and room for a header.
const MAX_FLOATS_BYTES: u64 = 8 * MAX_PIXELS + (1 << 20);

/// How to read a depth map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The meaning of its numbers; `None` leaves it to the file.
    pub unit: Option<DepthUnit>,
    /// Whether the largest number of relative inverse depth is the farthest instead of the nearest.
    pub invert: bool,
    /// Units per metre of whole numbers, > 0; `None` is that of the file.
    pub scale: Option<f32>,
    /// A number that means unknown, besides 0, negative ones and NaN.
    pub invalid: Option<f32>,
    /// How a map of another aspect ratio is fitted to its picture.
    pub fit: Option<Fit>,
    /// The numbers of relative depth that are the farthest and the nearest (or the other way round, with `invert`), for
    /// maps of one sequence; `None` is the range of the map itself.
    pub range: Option<(f32, f32)>,
}

/// What the distances of a map are worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distances {
    /// Metres, if the scale of its whole numbers is right.
    Scaled,
    /// Metres, as the file states.
    Metres,
    /// Only their order is known.
    Relative,
}

/// A depth map that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthFile {
    /// Depth in metres, 0 = unknown.
    pub map: DepthMap,
    /// What its distances are worth.
    pub distances: Distances,
    /// What was assumed or changed, a line each.
    pub notes: Vec<String>,
}

/// Reads the depth map of a picture of `color` (columns, rows) pixels, upright by its orientation tag and fitted to
/// that size.
///
/// The format follows from the content: grey PNG, JPEG or TIFF (or RGB with equal channels), float TIFF, PFM, NPY, NPZ
/// or EXR. The unit is that of `options`, else the one that the file states, as those of [`write_depth`] and
/// [`write_disparity`] do; else a 16-bit PNG has 5000 units per metre, and floats are metres.
///
/// [`write_depth`]: super::still::write_depth
/// [`write_disparity`]: super::still::write_disparity
///
/// # Errors
/// The file is missing, of another kind, too large, truncated or damaged; a picture in colours; its unit is unclear, or
/// nothing in it is usable; it has another aspect ratio, and `options` do not say how it fits.
pub fn read(path: &Path, options: &Options, color: (u32, u32)) -> Result<DepthFile, RecordingError> {
    let read = || -> Result<DepthFile, PictureFault> {
        let values = read_values(path, options)?;
        let is_stated = values.stated.is_some();
        let mut file = Meaning::decide(&values, options)?.into_depth(values, options);
        meaning::check_usable(&file.map, is_stated)?;
        fit::fit_to(&mut file, options.fit, color)?;
        Ok(file)
    };
    read().map_err(RecordingError::picture(path))
}

/// Does the same as [`read`] in the size of the file, which may be of one depth, or of none.
pub(super) fn read_unfitted(path: &Path, options: &Options) -> Result<DepthFile, PictureFault> {
    let values = read_values(path, options)?;
    Ok(Meaning::decide(&values, options)?.into_depth(values, options))
}

/// Reads the numbers of a map, also from the colours of a known colour map if they are said to be inverse depth, with
/// what its name and its neighbours say of them.
fn read_values(path: &Path, options: &Options) -> Result<Values, PictureFault> {
    let colored = match read_numbers(path) {
        Err(PictureFault::ColoredDepth) if matches!(options.unit, None | Some(DepthUnit::Inverse)) => {
            color_map::read(path)?
        }
        read => return stated::complete(read?, path, options),
    };
    let ColorMapped { mut values, name, ends: [near, far] } = colored;
    if options.unit.is_none() && !options.invert {
        return Err(PictureFault::ColorMapped { name, ends: Box::new([near, far]) });
    }
    let near = if options.invert { far } else { near };
    values.notes.push(format!("has the colours of {name}, of which {near} is taken as near"));
    Ok(values)
}

/// Reads a map; the first bytes decide its format.
fn read_numbers(path: &Path) -> Result<Values, PictureFault> {
    let mut file = input::open(path).map_err(open_fault)?;
    let mut start = Vec::new();
    (&mut file).take(8).read_to_end(&mut start)?;
    file.rewind()?;
    match &start[..] {
        [b'P', b'f' | b'F', space, ..] if space.is_ascii_whitespace() => {
            let mut values = Values::default();
            (values.size, values.stated) = pfm::parse(&read_whole(file)?, &mut values.numbers)?;
            Ok(values)
        }
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => npy::parse(&read_whole(file)?),
        [b'P', b'K', 3, 4, ..] => guard(|| npy::read_archive(file, MAX_FLOATS_BYTES)),
        // 43 is BigTIFF.
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => guard(|| tiff::read(file)),
        [0x76, 0x2f, 0x31, 0x01, ..] => guard(|| exr::read(file)),
        [] => Err(PictureFault::Truncated),
        _ => read_codes(path),
    }
}

fn read_whole(file: File) -> Result<Vec<u8>, PictureFault> {
    let mut content = Vec::new();
    coded::read_from_start(file, MAX_FLOATS_BYTES, &mut content)?;
    Ok(content)
}

/// Reads the codes of a picture, upright by its orientation tag.
fn read_codes(path: &Path) -> Result<Values, PictureFault> {
    let mut memory = Vec::new();
    let coded = EncodedPicture::open(path, &mut memory).map_err(|fault| match fault {
        PictureFault::Format(_) => PictureFault::Format(FORMATS),
        fault => fault,
    })?;
    let (mut values, mut metadata) = values::decode_codes(coded)?;
    if let Some(white) = coded::read_pnm_white(path) {
        let factor = white / values.samples.white();
        values.numbers.iter_mut().for_each(|number| *number = (*number * factor).round());
    }
    Ok(Values { stated: stated::read_text(path), ..values }.turned(metadata.take_orientation()))
}

/// Returns the units that are stated beside the map `path` for all maps there; `None` if there are none, or the map has no
/// need of them.
///
/// # Errors
/// What states them is faulty.
pub(super) fn find_scale(path: &Path) -> Result<Option<StatedUnits>, PictureFault> {
    match read_numbers(path).ok().filter(|values| values.stated.is_none()).map(|values| values.samples) {
        Some(samples @ (Samples::Sixteen | Samples::Whole)) => stated::scale_beside(path, samples, None),
        _ => Ok(None),
    }
}

/// Reads the range of the numbers of relative depth, for [`Options::range`]; `None` if the map has metres.
pub(super) fn read_range(path: &Path, options: &Options) -> Result<Option<(f32, f32)>, PictureFault> {
    let values = read_values(path, options)?;
    Ok(Meaning::decide(&values, options)?.range_of(&values, options))
}

/// Reads a map of disparities in pixels, 0 = unknown: whole numbers of 16 bits are 1/256 px.
pub(super) fn read_disparity(path: &Path) -> Result<DisparityMap, PictureFault> {
    let values = read_numbers(path)?;
    let per_px = values.disparities_per_px();
    let px = |value: f32| if DepthMap::is_known(value) { value / per_px } else { 0.0 };
    let (width, height) = values.size;
    Ok(DisparityMap { width, height, px: values.numbers.into_iter().map(px).collect() })
}
