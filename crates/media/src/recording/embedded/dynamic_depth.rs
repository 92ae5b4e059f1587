//! Dynamic Depth 1.0: pictures after the end of the first one, in the order and with the lengths of the list in its XMP.
//!
//! Format: Dynamic Depth 1.0 (Google, 2019), sections "Container", "Item" and "Depth Map".

use roxmltree::Node;

use super::xmp::{self, DYNAMIC_DEPTH, Xmp};
use super::{EmbeddedDepth, Found, Meaning, is_complete, is_picture};

pub(super) const KIND: &str = "Dynamic Depth";

/// Namespaces of the list's items: that of the standard, and a later one for photos of any kind.
const ITEMS: [&str; 2] =
    ["http://ns.google.com/photos/dd/1.0/item/", "http://ns.google.com/photos/1.0/container/item/"];
/// Names of the item with the sharp original.
const ORIGINALS: [&str; 3] = ["android/original_image", "android/original", "Original"];

/// A file after the first picture.
struct Item<'a> {
    name: &'a str,
    length: usize,
    padding: usize,
}

/// Finds Dynamic Depth in the XMP and the pictures of the file.
pub(super) fn find(file: &[u8], xmp: &Xmp) -> Found {
    let Some(node) = xmp.nodes().find(is_depth_map) else { return Ok(None) };
    let property = |name| property(node, name);
    let number = |name| property(name).and_then(xmp::parse_number);
    let range = number("Near").zip(number("Far"));
    let (near, far) = range.ok_or("its Near and Far are not stated, or no numbers")?;
    let units = property("Units").unwrap_or_default().to_ascii_lowercase();
    if units == "diopters" {
        return Err("its unit is dioptres, which is not supported".into());
    }
    let items: Vec<Item> = xmp.nodes().filter_map(Item::read).collect();
    let names = [property("DepthURI").unwrap_or("android/depthmap"), "Depth"];
    let map = find_picture(file, &items, &names).ok_or("the list of the file's pictures has no depth map")?;
    let map = map.ok_or("its picture is not where the list of the file's pictures says, or not whole")?;
    let original = find_picture(file, &items, &ORIGINALS);
    if original == Some(None) {
        tracing::warn!("the sharp original inside the photo ({KIND}) is damaged; the photo itself is used");
    }
    Ok(Some(EmbeddedDepth {
        kind: KIND,
        map: map.to_vec(),
        meaning: Meaning::of_range(property("Format").unwrap_or_default(), near, far)?,
        is_metric: units == "meters",
        focus: None,
        original: original.flatten().map(<[u8]>::to_vec),
    }))
}

fn property<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    xmp::value(node, DYNAMIC_DEPTH, name)
}

/// Returns whether an element describes a depth map, and not the segmentation that may stand beside it.
fn is_depth_map(node: &Node) -> bool {
    property(*node, "Format").is_some() && property(*node, "ItemSemantic") != Some("Segmentation")
}

impl<'a> Item<'a> {
    /// Reads an item of the list; `None` for any other element.
    fn read(node: Node<'a, '_>) -> Option<Self> {
        let property = |name| ITEMS.iter().find_map(|namespace| xmp::value(node, namespace, name));
        let bytes = |name| property(name).and_then(|text| text.trim().parse().ok()).unwrap_or(0);
        property("Mime")?;
        let name = property("DataURI").or_else(|| property("Semantic")).unwrap_or_default();
        Some(Self { name, length: bytes("Length"), padding: bytes("Padding") })
    }
}

/// Finds the picture of the first item with one of these names; `Some(None)` if it is outside the file or not whole.
fn find_picture<'a>(file: &'a [u8], items: &[Item], names: &[&str]) -> Option<Option<&'a [u8]>> {
    let index = items.iter().position(|item| names.contains(&item.name))?;
    let bytes = |items: &[Item], start: usize| {
        let sizes = items.iter().flat_map(|item| [item.length, item.padding]);
        sizes.fold(start, usize::saturating_add)
    };
    let length = items[index].length;
    // The first item is the photo, which ends where it says itself.
    let first = items.first().filter(|_| index > 0)?;
    let from_front =
        bokehcam_jpeg::find_end(file).map(|end| bytes(&items[1..index], end.saturating_add(first.padding)));
    // Other data may stand between the photo and the items.
    let from_back = file.len().checked_sub(bytes(&items[index..], 0));
    let candidates = [from_front, from_back].into_iter().flatten();
    let pictures = candidates.filter_map(|start| file.get(start..start.checked_add(length)?));
    Some(pictures.filter(|picture| is_picture(picture)).find(|picture| is_complete(picture)))
}
