//! XMP packets, which hold rights, authors and titles: keeps the parts that stay valid after the pixels have changed.
//!
//! Only the main packet is kept. Entries about other parts of the file are removed from its text: Extended XMP, depth maps
//! (`GDepth` and its companions, Dynamic Depth), gain maps, and thumbnails.

use std::ops::Range;

use roxmltree::{Document, Node, ParsingOptions};

use bokehcam::compute::catch_panic;

/// The keyword of a packet in a PNG.
pub(super) const PNG_KEYWORD: &str = "XML:com.adobe.xmp";
/// Identifier at the start of a JPEG segment with a packet.
pub(super) const JPEG_NAME: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
/// Maximum bytes of a packet in a JPEG: a segment has 65533.
pub(super) const MAX_JPEG_BYTES: usize = 65_533 - JPEG_NAME.len();
/// Maximum bytes of a packet that is read; most have a few thousand.
pub(super) const MAX_BYTES: usize = 4 << 20;

/// Maximum number of tags and quotes in a packet: memory for parsing grows with them, and time even with their square.
const MAX_MARKS: usize = 10_000;

/// Entries about other parts of the file: how their namespaces begin, and words for the loss if it is reported.
const EXTERNAL: [(&str, Option<&str>); 10] = [
    ("http://ns.adobe.com/xmp/note/", Some("Extended XMP")),
    ("http://ns.google.com/photos/1.0/depthmap/", Some("the depth map in its XMP")),
    ("http://ns.google.com/photos/dd/1.0/", Some("the list of depth maps in its XMP (Dynamic Depth)")),
    ("http://ns.adobe.com/hdr-gain-map/", Some("the HDR gain map")),
    ("http://ns.apple.com/HDRGainMap/", Some("the HDR gain map")),
    ("http://ns.google.com/photos/1.0/image/", None),
    ("http://ns.google.com/photos/1.0/focus/", None),
    ("http://ns.google.com/photos/1.0/audio/", None),
    ("http://ns.google.com/photos/1.0/camera/", None),
    ("http://ns.google.com/photos/1.0/container/", None),
];
/// Prefixes that tell entries about other pictures in a packet that cannot be parsed.
const EXTERNAL_PREFIXES: [&str; 10] = [
    "xmpNote:",
    "GDepth:",
    "GImage:",
    "GAudio:",
    "GCamera:",
    "hdrgm:",
    "Container:",
    "HDRGainMap:",
    "xmp:Thumbnails",
    "xmpGImg:image",
];
/// Thumbnails of the original picture: namespace and name.
const THUMBNAILS: [(&str, &str); 2] =
    [("http://ns.adobe.com/xap/1.0/", "Thumbnails"), ("http://ns.adobe.com/xap/1.0/g/img/", "image")];
const ORIENTATION: &str = "tiff:Orientation";

/// The valid parts of a packet.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct ValidParts {
    pub(super) packet: String,
    /// What is not kept, in words.
    pub(super) lost: Vec<&'static str>,
}

/// Parses a packet; `None` if it is damaged, not UTF-8, or has too many parts.
pub(super) fn parse(packet: &[u8]) -> Option<Document<'_>> {
    let is_mark = |byte: &&u8| matches!(byte, b'<' | b'"' | b'\'');
    if packet.iter().filter(is_mark).take(MAX_MARKS + 1).count() > MAX_MARKS {
        return None;
    }
    let text = std::str::from_utf8(packet).ok()?.trim_matches(['\0', '\u{feff}', ' ', '\t', '\r', '\n']);
    // Without DTD, there are no entities to expand.
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    catch_panic(|| Document::parse_with_options(text, options).ok()).flatten()
}

/// Returns the packet for a picture that is upright and alone in its file.
///
/// # Errors
/// Returns, in words, what cannot be kept.
pub(super) fn keep_valid_parts(packet: Vec<u8>) -> Result<ValidParts, &'static str> {
    let Some(document) = parse(&packet) else {
        let packet = String::from_utf8(packet).map_err(|_| "XMP that is not in UTF-8")?;
        return match EXTERNAL_PREFIXES.iter().any(|name| packet.contains(name)) {
            true => Err("XMP that has other pictures, and is damaged or too long"),
            false => Ok(ValidParts { packet: reset_orientation(packet), lost: Vec::new() }),
        };
    };
    let (mut kept, mut end, mut lost) = (String::new(), 0, Vec::new());
    let text = document.input_text();
    for (entry, loss) in document.descendants().flat_map(external_entries) {
        lost.extend(loss.filter(|loss| !lost.contains(loss)));
        // Entries inside of a removed one are gone already.
        if entry.start >= end {
            kept.push_str(&text[end..entry.start]);
            end = entry.end;
        }
    }
    kept.push_str(&text[end..]);
    Ok(ValidParts { packet: reset_orientation(kept), lost })
}

/// Returns the places of an element, or else of its attributes, that are about other parts of the file, with the words for
/// the loss. The declarations of their prefixes stay, which is harmless.
fn external_entries(node: Node) -> Vec<(Range<usize>, Option<&'static str>)> {
    let loss = |namespace: Option<&str>, name: &str| {
        let namespace = namespace?;
        let external = EXTERNAL.iter().find(|(start, _)| namespace.starts_with(start)).map(|(_, loss)| *loss);
        external.or_else(|| THUMBNAILS.contains(&(namespace, name)).then_some(None))
    };
    let tag = node.tag_name();
    if let Some(loss) = loss(tag.namespace(), tag.name()) {
        return vec![(node.range(), loss)];
    }
    // White space before an attribute goes with it.
    let with_space = |range: Range<usize>| {
        let before = &node.document().input_text()[..range.start];
        before.trim_ascii_end().len()..range.end
    };
    let attributes = node.attributes().map(|a| (with_space(a.range()), loss(a.namespace(), a.name())));
    attributes.filter_map(|(range, loss)| Some((range, loss?))).collect()
}

/// Sets the orientation in a packet to upright.
fn reset_orientation(mut packet: String) -> String {
    let mut from = 0;
    while let Some(found) = packet[from..].find(ORIENTATION) {
        let after = from + found + ORIENTATION.len();
        // As an attribute, `="6"`, or as an element, `>6<`.
        let value = packet[after..].find(|c: char| !matches!(c, '=' | '"' | '\'' | '>' | ' '));
        if let Some(at) = value.map(|value| after + value).filter(|&at| matches!(packet.as_bytes()[at], b'2'..=b'8')) {
            packet.replace_range(at..=at, "1");
        }
        from = after;
    }
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMESPACES: &str = "xmlns:x=\"adobe:ns:meta/\" xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" \
         xmlns:dc=\"http://purl.org/dc/elements/1.1/\" xmlns:xmp=\"http://ns.adobe.com/xap/1.0/\" \
         xmlns:xmpNote=\"http://ns.adobe.com/xmp/note/\" xmlns:d=\"http://ns.google.com/photos/1.0/depthmap/\" \
         xmlns:GFocus=\"http://ns.google.com/photos/1.0/focus/\" \
         xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\" \
         xmlns:Device=\"http://ns.google.com/photos/dd/1.0/device/\" \
         xmlns:Container=\"http://ns.google.com/photos/1.0/container/\" \
         xmlns:Item=\"http://ns.google.com/photos/1.0/container/item/\" \
         xmlns:hdrgm=\"http://ns.adobe.com/hdr-gain-map/1.0/\"";

    fn packet(attributes: &str, elements: &str) -> String {
        format!(
            "<x:xmpmeta {NAMESPACES}><rdf:RDF><rdf:Description dc:rights=\"Me &amp; \u{e4}\"{attributes}>{elements}\
             </rdf:Description></rdf:RDF></x:xmpmeta>"
        )
    }

    #[test]
    fn rights_stay_and_what_is_about_other_parts_of_the_file_does_not() {
        let title = "<dc:title>GDepth: a poem = 'x', d:Data='AA'</dc:title>";
        for (attributes, elements, lost) in [
            ("", "", &[][..]),
            (
                " d:Format=\"RangeInverse\"\n d:Data = 'AA>A=='\txmpNote:HasExtendedXMP=\"1F\" GFocus:FocalPointX='1'",
                "",
                &["the depth map in its XMP", "Extended XMP"],
            ),
            ("", "<d:Format>RangeInverse</d:Format><d:Data>AAAA</d:Data>", &["the depth map in its XMP"]),
            (
                "",
                "<Device:Container><Container:Directory><rdf:Seq><rdf:li><Container:Item Item:Mime='image/jpeg'/>\
                 </rdf:li></rdf:Seq></Container:Directory></Device:Container>\
                 <Device:Cameras><rdf:Seq><rdf:li dc:rights='camera'/></rdf:Seq></Device:Cameras>",
                &["the list of depth maps in its XMP (Dynamic Depth)"],
            ),
            (" hdrgm:Version=\"1.0\"", "<Container:Directory/>", &["the HDR gain map"]),
            ("", "<xmp:Thumbnails><rdf:Alt/></xmp:Thumbnails>", &[]),
        ] {
            for (first, second) in [("", title), (title, "")] {
                let held = packet(attributes, &format!("{first}{elements}{second}"));
                let kept = keep_valid_parts(format!("\u{feff}{held}\0").into_bytes());
                assert_eq!(kept, Ok(ValidParts { packet: packet("", title), lost: lost.to_vec() }), "{held}");
            }
        }
        // What describes the whole view stays.
        let panorama = packet(" GPano:ProjectionType=\"equirectangular\"", title);
        assert_eq!(keep_valid_parts(panorama.clone().into()).unwrap().packet, panorama);
    }

    #[test]
    fn a_packet_that_cannot_be_parsed_is_kept_whole_or_not_at_all() {
        let broken = packet("", "").replace("</rdf:RDF>", "");
        assert_eq!(keep_valid_parts(broken.clone().into()).unwrap().packet, broken);
        let long = packet("", &"<rdf:li/>".repeat(MAX_MARKS));
        assert_eq!(keep_valid_parts(long.clone().into()).unwrap().packet, long);
        for elements in ["<GDepth:Data>AAAA</GDepth:Data>", "<xmp:Thumbnails>", "<Container:Directory/"] {
            assert!(keep_valid_parts(packet("", elements).into()).is_err(), "{elements}");
        }
        assert!(keep_valid_parts(vec![0xff, 0xfe, b'<', 0]).is_err());
    }

    #[test]
    fn the_picture_is_upright() {
        for (held, upright) in [
            (" tiff:Orientation=\"6\"", " tiff:Orientation=\"1\""),
            ("<tiff:Orientation>8</tiff:Orientation>", "<tiff:Orientation>1</tiff:Orientation>"),
            ("<tiff:Orientation>1</tiff:Orientation>", "<tiff:Orientation>1</tiff:Orientation>"),
            (" tiff:Orientation", " tiff:Orientation"),
        ] {
            assert_eq!(keep_valid_parts(held.into()).unwrap().packet, upright);
        }
    }
}
