//! Masks of single pictures, as files of any tool: white or opaque is the subject.

use std::path::Path;

use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma};

use super::coded::EncodedPicture;
use super::decode::{self, Scratch};
use super::depth_file::{describe_stretch, is_stretchable};
use super::error::RecordingError;
use super::fault::PictureFault;
use super::upright::upright;
use bokehcam::frame::Mask;

/// Suffixes of the masks of pictures, after the picture's stem.
const SUFFIXES: [&str; 2] = ["-mask", ".mask"];

/// Change of a value that lossy compression makes.
const TOLERANCE: f32 = 8.0 / 255.0;
/// Share of the pixels whose colours may differ from a mask.
const MAX_SHARE: f32 = 0.005;

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
    SUFFIXES.iter().find_map(|suffix| stem.strip_suffix(suffix)).filter(|stem| !stem.is_empty())
}

/// Reads the mask of a picture of `color` (columns, rows) pixels, upright by its orientation tag, and scaled down to that
/// size if it is larger. Its alphas are those of the file, if they differ, as in a picture that was cut out; else its luma
/// as stored (not linearised), multiplied by alpha.
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
        let notes = note.into_iter().chain(describe_stretch((width, height), color)).collect();
        Ok(MaskFile { mask: reduce(mask, (width.min(color.0), height.min(color.1))), notes })
    };
    read().map_err(RecordingError::picture(path))
}

/// Reads a mask in the size of its file, and what was assumed.
fn read_unfitted(path: &Path) -> Result<(Mask, Option<String>), PictureFault> {
    let mut scratch = Scratch::default();
    let coded = EncodedPicture::open(path, &mut scratch.file)?;
    let size = coded.size();
    let pixels = size.0 as usize * size.1 as usize;
    let mut grey = vec![0.0; pixels];
    let mut alphas = if coded.samples().has_alpha() { vec![1.0; pixels] } else { Vec::new() };
    let (mut lowest, mut highest, mut unequal) = (1.0_f32, 0.0_f32, 0);
    let mut metadata = decode::decode_luma(coded, &mut scratch.pixels, |at, luma, alpha| {
        grey[at] = luma * alpha;
        if let Some(place) = alphas.get_mut(at) {
            *place = alpha;
        }
        (lowest, highest) = (lowest.min(alpha), highest.max(alpha));
        unequal += usize::from(alpha - luma * alpha > TOLERANCE);
    })?;
    let is_cut_out = highest - lowest > TOLERANCE;
    let is_said = is_cut_out && unequal as f32 > MAX_SHARE * pixels as f32;
    let stored = if is_cut_out { alphas } else { grey };
    let transform = upright(metadata.take_orientation());
    let alpha = if transform.is_identity() { stored } else { transform.apply_to_pixels(&stored, size) };
    let (width, height) = transform.rotated_size(size);
    let note = is_said.then(|| "its alpha is taken as the mask, not its colours".to_owned());
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
