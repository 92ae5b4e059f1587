//! `GDepth`: a depth map in base64 in the XMP, beside the sharp original (`GImage`) and the focus (`GFocus`).
//!
//! Format: <https://developers.google.com/depthmap-metadata/reference>.

use super::xmp::{GDEPTH, Xmp};
use super::{EmbeddedDepth, Focus, Found, Meaning, base64, is_complete};

pub(super) const KIND: &str = "GDepth";

const GFOCUS: &str = "http://ns.google.com/photos/1.0/focus/";
const GIMAGE: &str = "http://ns.google.com/photos/1.0/image/";

/// Finds `GDepth` in the XMP.
pub(super) fn find(xmp: &Xmp) -> Found {
    let (format, data) = (xmp.value(GDEPTH, "Format"), xmp.value(GDEPTH, "Data"));
    if format.is_none() && data.is_none() {
        return Ok(None);
    }
    let data = data.ok_or("its data is not in the file, as if an editor or upload had removed it")?;
    let range = xmp.number(GDEPTH, "Near").zip(xmp.number(GDEPTH, "Far"));
    let (near, far) = range.ok_or("its Near and Far are not stated, or no numbers")?;
    // Lens Blur states no units, and its distances are relative, though the reference has metres as default.
    let m_per_unit = match xmp.value(GDEPTH, "Units").unwrap_or_default().trim() {
        "m" | "M" | "Meters" | "meters" => Some(1.0),
        "mm" => Some(0.001),
        _ => None,
    };
    let scale = m_per_unit.unwrap_or(1.0);
    let map = base64::decode(data).filter(|map| is_complete(map)).ok_or("its data is not a whole PNG or JPEG")?;
    Ok(Some(EmbeddedDepth {
        kind: KIND,
        map,
        meaning: Meaning::of_range(format.unwrap_or("RangeInverse"), near * scale, far * scale)?,
        is_metric: m_per_unit.is_some(),
        focus: read_focus(xmp, scale),
        original: read_original(xmp),
    }))
}

/// Reads the focus: its point, or else its distance times `scale`.
fn read_focus(xmp: &Xmp, scale: f32) -> Option<Focus> {
    let fraction = |name| xmp.number(GFOCUS, name).filter(|number| (0.0..=1.0).contains(number));
    let point = fraction("FocalPointX").zip(fraction("FocalPointY")).map(|(x, y)| Focus::Point { x, y });
    let distance = || xmp.number(GFOCUS, "FocalDistance").filter(|distance| *distance > 0.0);
    point.or_else(|| distance().map(|distance| Focus::Distance(distance * scale)))
}

fn read_original(xmp: &Xmp) -> Option<Vec<u8>> {
    let original = base64::decode(xmp.value(GIMAGE, "Data")?).filter(|original| is_complete(original));
    if original.is_none() {
        tracing::warn!("the sharp original inside the photo (GImage) is damaged; the photo itself is used");
    }
    original
}
