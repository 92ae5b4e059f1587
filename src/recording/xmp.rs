//! XMP packets, which hold rights, authors and titles: keeps the parts that stay valid after the pixels have changed.
//!
//! Only the main packet is kept. References to other parts of the file are removed: Extended XMP, depth maps (GDepth),
//! gain maps, and thumbnails.

/// The keyword of a packet in a PNG.
pub(super) const PNG_KEYWORD: &str = "XML:com.adobe.xmp";
/// Identifier at the start of a JPEG segment with a packet.
pub(super) const JPEG_NAME: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
/// Maximum bytes of a packet in a JPEG: a segment has 65533.
pub(super) const MAX_JPEG_BYTES: usize = 65_533 - JPEG_NAME.len();
/// Maximum bytes of a packet that is read; most have a few thousand.
pub(super) const MAX_BYTES: usize = 4 << 20;

/// Prefixes of attributes about other parts of the file.
const EXTERNAL_PREFIXES: [&str; 8] =
    ["xmpNote:", "GDepth:", "GImage:", "GAudio:", "GCamera:", "hdrgm:", "Container:", "HDRGainMap:"];
/// Names of elements with thumbnails of the original picture.
const THUMBNAILS: [&str; 2] = ["xmp:Thumbnails", "xmpGImg:image"];
const ORIENTATION: &str = "tiff:Orientation";

/// Attributes whose loss is reported, with the words for it.
const REPORTED_LOSSES: [(&str, &str); 2] =
    [("xmpNote:HasExtendedXMP", "Extended XMP"), ("GDepth:Format", "the depth map in its XMP")];

/// Returns, in words, the parts of a packet that are not kept.
pub(super) fn find_lost_properties(packet: &[u8]) -> impl Iterator<Item = &'static str> {
    let has = |name: &str| packet.windows(name.len()).any(|bytes| bytes == name.as_bytes());
    REPORTED_LOSSES.into_iter().filter(move |(name, _)| has(name)).map(|(_, word)| word)
}

/// Returns the packet for a picture that is upright and alone in its file.
///
/// # Errors
/// Returns, in words, what cannot be kept.
pub(super) fn keep_valid_parts(packet: Vec<u8>) -> Result<String, &'static str> {
    let packet = String::from_utf8(packet).map_err(|_| "XMP that is not in UTF-8")?;
    let packet = remove_attributes(&packet, &EXTERNAL_PREFIXES);
    let is_there = |name: &&str| packet.contains(&format!("<{name}"));
    if EXTERNAL_PREFIXES.iter().chain(&THUMBNAILS).any(is_there) || packet.contains(THUMBNAILS[1]) {
        return Err("XMP that has other pictures");
    }
    Ok(reset_orientation(packet))
}

/// Removes attributes with these prefixes. The declarations of the prefixes stay, which is harmless.
fn remove_attributes(packet: &str, prefixes: &[&str]) -> String {
    let mut kept = String::with_capacity(packet.len());
    let mut rest = packet;
    while let Some(at) = rest.find(|c: char| c.is_ascii_whitespace()) {
        let name = rest[at..].trim_ascii_start();
        let is_removed = prefixes.iter().any(|prefix| name.starts_with(prefix));
        let space = rest.len() - name.len();
        match is_removed.then(|| attribute_length(name)).flatten() {
            Some(bytes) => {
                kept.push_str(&rest[..at]);
                rest = &name[bytes..];
            }
            None => {
                kept.push_str(&rest[..space]);
                rest = name;
            }
        }
    }
    kept + rest
}

/// Returns the length of the attribute at the start of a text: a name, `=`, and a quoted value.
fn attribute_length(text: &str) -> Option<usize> {
    let (name, value) = text.split_once('=')?;
    let is_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, ':' | '_' | '-' | '.');
    let quoted = value.trim_ascii_start();
    let quote = quoted.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    let end = quoted[1..].find(quote)? + 2;
    name.trim_ascii_end().chars().all(is_name).then_some(text.len() - quoted.len() + end)
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

    fn packet(attributes: &str, elements: &str) -> String {
        format!(
            "<x:xmpmeta><rdf:RDF><rdf:Description xmlns:GDepth=\"u\" dc:rights=\"Me &amp; \u{e4}\"{attributes}>{elements}\
             </rdf:Description></rdf:RDF></x:xmpmeta>"
        )
    }

    #[test]
    fn rights_stay_and_what_is_about_other_parts_of_the_file_does_not() {
        let kept = |attributes: &str, elements: &str| keep_valid_parts(packet(attributes, elements).into_bytes());
        let plain = packet("", "<dc:title>GDepth: a poem = 'x'</dc:title>");
        assert_eq!(kept("", "<dc:title>GDepth: a poem = 'x'</dc:title>"), Ok(plain));
        let depth = " GDepth:Format=\"RangeInverse\"\n GDepth:Data = 'AAAA=='\txmpNote:HasExtendedXMP=\"1F\"";
        assert_eq!(kept(depth, ""), Ok(packet("", "")));
        assert_eq!(
            find_lost_properties(packet(depth, "").as_bytes()).collect::<Vec<_>>(),
            ["Extended XMP", "the depth map in its XMP"]
        );
        assert_eq!(find_lost_properties(packet("", "").as_bytes()).count(), 0);
        // An unterminated value stays as it is.
        assert!(kept(" GDepth:Data=\"AAAA", "").unwrap().contains("GDepth:Data"));
        for elements in ["<GDepth:Data>AAAA</GDepth:Data>", "<xmp:Thumbnails/>", "<Container:Directory/>"] {
            assert!(kept("", elements).is_err(), "{elements}");
        }
        assert!(super::keep_valid_parts(vec![0xff, 0xfe, b'<', 0]).is_err());
    }

    #[test]
    fn the_picture_is_upright() {
        for (held, upright) in [
            (" tiff:Orientation=\"6\"", " tiff:Orientation=\"1\""),
            ("<tiff:Orientation>8</tiff:Orientation>", "<tiff:Orientation>1</tiff:Orientation>"),
            ("<tiff:Orientation>1</tiff:Orientation>", "<tiff:Orientation>1</tiff:Orientation>"),
            (" tiff:Orientation", " tiff:Orientation"),
        ] {
            assert_eq!(keep_valid_parts(held.into()), Ok(upright.into()));
        }
    }
}
