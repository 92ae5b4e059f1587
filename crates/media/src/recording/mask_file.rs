//! Masks of single pictures, as files of any tool: white or opaque is the subject.

use std::path::Path;

use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma};

use super::coded::{self, EncodedPicture};
use super::decode::Scratch;
use super::depth_file::{describe_stretch, is_stretchable};
use super::error::RecordingError;
use super::fault::PictureFault;
use super::file_kind::FileKind;
use super::folder::strip_suffix;
use super::luma::{self, LumaPixel};
use super::samples::{GREY_TOLERANCE, MAX_COLORED};
use super::upright::upright;
use bokehcam::color::luminance;
use bokehcam::frame::Mask;

/// Suffixes of the masks of pictures, after the picture's stem.
pub const SUFFIXES: [&str; 3] = ["-mask", ".mask", "_mask"];

/// Largest code of a mask that numbers objects: far darker than any coverage that is meant.
const MAX_LABEL: f32 = 31.0;

/// A mask that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskFile {
    /// At most as large as the picture.
    pub mask: Mask,
    /// What was assumed or changed, a line each.
    pub notes: Vec<String>,
}

/// Returns the stem of the picture whose mask has this stem by its name; `None` if it is no mask.
pub fn picture_stem(stem: &str) -> Option<&str> {
    SUFFIXES.iter().find_map(|suffix| strip_suffix(stem, suffix)).filter(|stem| !stem.is_empty())
}

/// Reads the mask of a picture of `color` (columns, rows) pixels, upright by its orientation tag, and scaled down to that
/// size if it is larger. Its alphas are those of the file, if they differ, as in a picture that was cut out; 0 and 1 if it
/// numbers objects, by a palette with colours or by small codes; else its luma as stored (not linearised), multiplied by
/// alpha.
///
/// # Errors
/// The file is missing, no picture, too large, truncated or damaged; or it has another aspect ratio and is no square, as
/// networks make it of every picture.
pub fn read(path: &Path, color: (u32, u32)) -> Result<MaskFile, RecordingError> {
    let read = || {
        let (mask, note) = read_unfitted(path)?;
        let (width, height) = (mask.width, mask.height);
        if !is_stretchable((width, height), color) {
            return Err(PictureFault::MaskSize { found: (width, height), color });
        }
        let notes = note.into_iter().map(str::to_owned).chain(describe_stretch((width, height), color)).collect();
        Ok(MaskFile { mask: reduce(mask, (width.min(color.0), height.min(color.1))), notes })
    };
    read().map_err(RecordingError::picture(path))
}

/// How the numbers of a mask are read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reading {
    /// Its alpha, as in a picture that was cut out.
    Alpha,
    /// Its luma, multiplied by alpha.
    Luma,
    /// Numbers of objects: 0 is the background.
    Labels,
    /// The same, and white is what belongs to no object.
    LabelsAndVoid,
}

/// Reads a mask in the size of its file, and what was assumed.
fn read_unfitted(path: &Path) -> Result<(Mask, Option<&'static str>), PictureFault> {
    let mut scratch = Scratch::default();
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let (size, samples) = (coded.size(), coded.samples());
    let background = coded.palette_background().map(|rgb| {
        let [red, green, blue] = rgb.map(|code| f32::from(code) / 255.0);
        luminance(red, green, blue)
    });
    let pixels = size.0 as usize * size.1 as usize;
    let mut grey = vec![0.0; pixels];
    let mut alphas = if samples.has_alpha() { vec![1.0; pixels] } else { Vec::new() };
    let (mut lowest, mut highest, mut brightest) = (1.0_f32, 0.0_f32, 0.0_f32);
    let (mut unequal, mut colored) = (0, 0);
    // The brightest but for white, which may be what is no object, and how many pixels have each.
    let (mut object, mut objects, mut whites, mut blacks) = (0.0_f32, 0, 0, 0);
    // The decoder of PNM scales numbers: those of objects are the ones before.
    let white = coded::read_pnm_white(path).filter(|&white| white > 1.0).unwrap_or(samples.white());
    let is_white = |luma: f32| luma * white > white - 0.5;
    let is_jpeg = coded::read_kind(path) == Some(FileKind::Jpeg);
    let mut metadata = luma::decode_luma(coded, &mut scratch.pixels, |at, pixel| {
        let LumaPixel { luma, alpha, is_colored } = pixel;
        grey[at] = luma * alpha;
        if let Some(place) = alphas.get_mut(at) {
            *place = alpha;
        }
        (lowest, highest, brightest) = (lowest.min(alpha), highest.max(alpha), brightest.max(luma));
        if is_white(luma) {
            whites += 1;
        } else if luma > 0.0 {
            (object, objects) = (object.max(luma), objects + 1);
        } else {
            blacks += 1;
        }
        unequal += usize::from(alpha - luma * alpha > GREY_TOLERANCE);
        colored += usize::from(is_colored && alpha > 0.0);
    })?;
    let is_many = |count: usize| count as f32 > MAX_COLORED * pixels as f32;
    let reading = match () {
        () if highest - lowest > GREY_TOLERANCE => Reading::Alpha,
        () if background.is_some() && colored > 0 => Reading::Labels,
        // Compression makes such codes of black.
        () if !is_jpeg && (0.5..=MAX_LABEL).contains(&(brightest * white)) => Reading::Labels,
        () if !is_jpeg && blacks > 0 && objects > whites && (0.5..=MAX_LABEL).contains(&(object * white)) => {
            Reading::LabelsAndVoid
        }
        () => Reading::Luma,
    };
    let (stored, note) = match reading {
        Reading::Alpha => (alphas, is_many(unequal).then_some("its alpha is taken as the mask, not its colours")),
        Reading::Luma => (grey, is_many(colored).then_some("it has colours, whose luma is taken as the mask")),
        Reading::Labels => {
            let background = background.filter(|_| colored > 0).unwrap_or(0.0);
            grey.iter_mut().for_each(|grey| *grey = f32::from((*grey - background).abs() * white > 0.5));
            (grey, Some("it numbers objects: 0 is taken as the background, and all others are the subject"))
        }
        Reading::LabelsAndVoid => {
            grey.iter_mut().for_each(|grey| *grey = f32::from(*grey > 0.0 && !is_white(*grey)));
            (grey, Some("it numbers objects: 0 and white are taken as the background, and all others are the subject"))
        }
    };
    let transform = upright(metadata.take_orientation());
    let alpha = if transform.is_identity() { stored } else { transform.apply_to_pixels(&stored, size) };
    let (width, height) = transform.rotated_size(size);
    Ok((Mask { width, height, alpha }, note))
}

/// Scales a mask down to (columns, rows).
fn reduce(mask: Mask, (width, height): (u32, u32)) -> Mask {
    if (mask.width, mask.height) == (width, height) {
        return mask;
    }
    let Some(from) = ImageBuffer::<Luma<f32>, _>::from_raw(mask.width, mask.height, mask.alpha) else {
        return Mask::default();
    };
    Mask { width, height, alpha: imageops::resize(&from, width, height, FilterType::Triangle).into_raw() }
}
