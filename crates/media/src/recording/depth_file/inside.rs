//! The depth inside a photo, as phones save it.

use std::path::Path;

use image::metadata::Orientation;

use super::values::{Values, decode_codes};
use super::{DepthFile, Distances, fit, meaning};
use crate::recording::coded::{self, EncodedPicture};
use crate::recording::embedded::{self, EmbeddedDepth, Focus};
use crate::recording::fault::PictureFault;
use crate::recording::upright::upright;
use crate::recording::{PhotoMetadata, RecordingError, color_space, decode};
use bokehcam::frame::{ColorImage, DepthMap};

/// A photo with its own depth.
#[derive(Debug)]
pub struct DepthInside {
    /// Its depth; distances without a unit are [`Distances::Relative`], but their ratios are those of the scene, and the
    /// nearest (but for 1 %) is [`DepthMap::SUBJECT_M`].
    pub depth: DepthFile,
    /// The picture before the phone's own blur, upright, if it is there, in its own colour space: that of the photo.
    pub original: Option<ColorImage>,
    /// The same as it is shown, in sRGB, if its own colour space is another one.
    pub original_in_srgb: Option<ColorImage>,
    /// The focus that the photo was taken with: a point as fractions of width and height, or a distance in the units of
    /// the depth.
    pub focus: Option<Focus>,
    /// The kind of container, such as `GDepth`.
    pub kind: &'static str,
}

/// Reads the depth inside the photo `path`, whose upright picture has `color` (columns, rows) pixels; `None` if there is
/// none. Its larger values are far or near as the file says.
///
/// # Errors
/// The file claims to have depth that cannot be read, or of which nothing is usable.
pub fn read_inside(path: &Path, color: (u32, u32)) -> Result<Option<DepthInside>, RecordingError> {
    read(path, color).map_err(RecordingError::picture(path))
}

/// Returns whether a photo holds the picture of another camera beside its own (a Multi-Picture file).
pub fn has_other_view(path: &Path) -> bool {
    embedded::has_other_view(path).unwrap_or(false)
}

fn read(path: &Path, color: (u32, u32)) -> Result<Option<DepthInside>, PictureFault> {
    let Some(found) = embedded::read(path)? else { return Ok(None) };
    // Map, original and focus belong to the picture as stored; HEIC is upright once it is converted.
    let orientation = coded::read_stored_orientation(path).unwrap_or(Orientation::NoTransforms);
    let EmbeddedDepth { kind, map, meaning, is_metric, focus, original } = found;
    let broken =
        |what: &str, fault: &PictureFault| PictureFault::EmbeddedDepth { kind, what: format!("{what}: {fault}") };

    let coded = EncodedPicture::open_bytes(&map).map_err(|fault| broken("the map", &fault))?;
    let (values, _) = decode_codes(coded).map_err(|fault| broken("the map", &fault))?;
    let Values { size: (width, height), numbers, samples, .. } = values.turned(orientation);
    let white = samples.white();
    let depth = |number: f32| {
        let depth = meaning.to_depth(number / white);
        if DepthMap::is_known(depth) { depth } else { 0.0 }
    };
    let map = DepthMap { width, height, metres: numbers.into_iter().map(depth).collect(), ..DepthMap::default() };
    let distances = if is_metric { Distances::Metres } else { Distances::Relative };
    let mut file = DepthFile { map, distances, notes: Vec::new() };
    meaning::check_usable(&file.map, false).map_err(|fault| broken("the map", &fault))?;
    let inverse =
        file.map.metres.iter().map(|&metres| DepthMap::inverse_depth(metres)).filter(|&inverse| inverse > 0.0);
    // Relative depth begins with its nearest point.
    let scale =
        meaning::nearest(inverse.collect()).filter(|_| !is_metric).map_or(1.0, |near| near * DepthMap::SUBJECT_M);
    file.map.metres.iter_mut().for_each(|metres| *metres *= scale);

    let views = [color, file.map.size()];
    let decoded = original.as_deref().and_then(|bytes| match decode_original(bytes, orientation, views) {
        Ok(original) => Some(original),
        Err(what) => {
            file.notes.push(format!("the original picture inside ({kind}) is left out: {what}"));
            None
        }
    });
    let (original, profile) = decoded.unzip();
    let original_in_srgb = original.as_ref().zip(profile.flatten()).and_then(|(original, profile)| {
        let mut shown = original.clone();
        color_space::convert_to_srgb(&profile, &mut shown.rgb).then_some(shown)
    });
    let color = original.as_ref().map_or(color, ColorImage::size);
    fit::fit_to(&mut file, None, color).map_err(|fault| broken("the map", &fault))?;
    let focus = focus.map(|focus| match focus {
        Focus::Point { x, y } => turn_point(x, y, orientation),
        Focus::Distance(distance) => Focus::Distance(distance * scale),
    });
    Ok(Some(DepthInside { depth: file, original, original_in_srgb, focus, kind }))
}

/// An original in its own colour space, and the profile of that.
type Original = (ColorImage, Option<Vec<u8>>);

/// Decodes the original, and turns it as its own tag says, or else as the photo's does.
///
/// # Errors
/// Returns, in words, that it is damaged, or has the view of neither the photo nor the map (columns, rows).
fn decode_original(bytes: &[u8], orientation: Orientation, views: [(u32, u32); 2]) -> Result<Original, String> {
    let mut original = ColorImage::default();
    let decode = |into| decode::decode_stored_color(EncodedPicture::open_bytes(bytes)?, &mut Vec::new(), into);
    let mut metadata: PhotoMetadata = decode(&mut original).map_err(|fault: PictureFault| fault.to_string())?;
    let own = metadata.take_orientation();
    let original = upright(if own == Orientation::NoTransforms { orientation } else { own }).transform_color(original);
    // Of a photo that an editor has cropped, original and map still belong together.
    let [size, photo, map] = [original.size(), views[0], views[1]];
    match views.iter().any(|view| fit::has_same_view(*view, size)) {
        true => Ok((original, metadata.icc_profile)),
        false => Err(format!(
            "its {}x{} pixels have another aspect ratio than the photo ({}x{}) and its depth ({}x{})",
            size.0, size.1, photo.0, photo.1, map.0, map.1
        )),
    }
}

/// Returns the point of the upright picture that (`x`, `y`) of the stored one becomes.
fn turn_point(x: f32, y: f32, orientation: Orientation) -> Focus {
    // As fractions, whatever the size.
    let [x, y] = upright(orientation).apply_to_point([x, y], (1, 1)).unwrap_or([x, y]);
    Focus::Point { x, y }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, Luma};

    use super::*;

    #[test]
    fn the_focus_turns_with_the_picture() {
        let (width, height) = (8, 4);
        for code in 1..=8 {
            let orientation = Orientation::from_exif(code).unwrap();
            let mut picture = GrayImage::new(width, height);
            picture.put_pixel(6, 1, Luma([255]));
            let mut picture = DynamicImage::ImageLuma8(picture);
            picture.apply_orientation(orientation);
            let picture = picture.into_luma8();
            let (column, row, _) = picture.enumerate_pixels().find(|(.., pixel)| pixel[0] == 255).unwrap();
            let Focus::Point { x, y } = turn_point(6.5 / 8.0, 1.5 / 4.0, orientation) else { panic!("a point") };
            let found = (x * picture.width() as f32, y * picture.height() as f32);
            assert_eq!(found, (column as f32 + 0.5, row as f32 + 0.5), "{orientation:?}");
        }
    }
}
