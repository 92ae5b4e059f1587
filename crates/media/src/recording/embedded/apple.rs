//! Apple's depth in a JPEG: a picture of a Multi-Picture file whose own XMP says that it is auxiliary, of disparity or
//! depth. `heif-convert` writes the depth of a HEIC file with the same XMP.
//!
//! Format: the keys of Image I/O's auxiliary data (`kCGImageAuxiliaryDataTypeDisparity`), as iPhones write them.

use roxmltree::Node;

use super::packets::Packets;
use super::xmp::{APPLE, Xmp};
use super::{EmbeddedDepth, Found, Meaning, is_complete, multi_picture};
use bokehcam::frame::DepthMap;

pub(super) const KIND: &str = "Apple";

/// The namespace of gain maps, which brighten a photo on screens of high dynamic range.
const GAIN_MAP: &str = "http://ns.adobe.com/hdr-gain-map/1.0/";
const DEPTH_DATA: &str = "http://ns.apple.com/depthData/1.0/";

/// Finds the first auxiliary picture of depth or disparity: the file itself, or one that its index lists.
pub(super) fn find(file: &[u8], xmp: &Xmp) -> Found {
    if let Some(found) = read_picture(file, xmp)? {
        return Ok(Some(found));
    }
    let mut has_lost_map = false;
    for listed in multi_picture::pictures(file) {
        has_lost_map |= listed.is_lost_map();
        let Some(picture) = listed.picture else { continue };
        if let Some(found) = read_picture(picture, &Xmp::parse(&Packets::read(picture)))? {
            return Ok(Some(found));
        }
    }
    // The lost picture of an HDR photo is its gain map.
    match has_lost_map && !xmp.nodes().any(has_gain_map) {
        true => Err("a picture that the file lists after the photo is cut off or missing".into()),
        false => Ok(None),
    }
}

/// Returns whether an element says that the photo has a gain map.
fn has_gain_map(node: Node) -> bool {
    node.attributes().any(|attribute| attribute.namespace() == Some(GAIN_MAP))
        || node.tag_name().namespace() == Some(GAIN_MAP)
}

/// Reads a picture as depth; `None` if it is another one.
fn read_picture(picture: &[u8], xmp: &Xmp) -> Found {
    let has_word = |name, word: &str| xmp.value(APPLE, name).is_some_and(|value| value.to_lowercase().contains(word));
    // Mattes of persons, hair and sky are `depth` with a subtype.
    let is_other = xmp.value(APPLE, "AuxiliaryImageSubType").is_some();
    let [is_disparity, is_depth] = ["disparity", "depth"].map(|word| has_word("AuxiliaryImageType", word) && !is_other);
    if !is_disparity && !is_depth {
        return Ok(None);
    }
    let range = xmp.number(APPLE, "FloatMinValue").zip(xmp.number(APPLE, "FloatMaxValue"));
    let (min, max) = range.ok_or("its range (FloatMinValue, FloatMaxValue) is not stated, or no numbers")?;
    let meaning = match is_disparity {
        true => Meaning::Disparity { min, max },
        false => Meaning::Depth { min, max },
    };
    let is_range = (if is_disparity { f32::MIN } else { 0.0 }..=max).contains(&min);
    if !is_range || !(DepthMap::MIN_M..=DepthMap::MAX_M).contains(&max) {
        return Err(format!("its range is {min} to {max}"));
    }
    if !is_complete(picture) {
        return Err("its picture is truncated or damaged".into());
    }
    let is_metric = xmp.value(DEPTH_DATA, "Accuracy").is_some_and(|accuracy| accuracy.trim() == "absolute");
    Ok(Some(EmbeddedDepth { kind: KIND, map: picture.to_vec(), meaning, is_metric, focus: None, original: None }))
}
