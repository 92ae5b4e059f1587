//! Photos with depth inside, byte by byte.

use std::io::Cursor;

use image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgba, RgbaImage};

const ADOBE: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
const EXTENSION: &[u8] = b"http://ns.adobe.com/xmp/extension/\0";
pub(super) const GUID: &str = "0123456789ABCDEF0123456789ABCDEF";

pub(super) fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    image.into().write_to(&mut file, format).unwrap();
    file.into_inner()
}

/// A small JPEG whose shade tells it from others.
pub(super) fn jpeg(shade: u8) -> Vec<u8> {
    encode(GrayImage::from_pixel(16, 8, [shade].into()), ImageFormat::Jpeg)
}

/// Depth maps of every kind that phones write: a ramp from 0 to 1 from left to right.
pub(super) fn maps() -> [Vec<u8>; 4] {
    let grey = GrayImage::from_fn(8, 4, |x, _| [(x * 255 / 7) as u8].into());
    let rgba = RgbaImage::from_fn(8, 4, |x, _| {
        Rgba([[(x * 255 / 7) as u8; 3].as_slice(), &[255]].concat().try_into().unwrap())
    });
    let wide = ImageBuffer::<Luma<u16>, _>::from_fn(8, 4, |x, _| [(x * 65535 / 7) as u16].into());
    [
        encode(grey.clone(), ImageFormat::Png),
        encode(rgba, ImageFormat::Png),
        encode(wide, ImageFormat::Png),
        encode(grey, ImageFormat::Jpeg),
    ]
}

pub(super) fn base64(bytes: &[u8]) -> String {
    const SYMBOLS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let symbols = |three: &[u8]| {
        let bits = (0..3).fold(0, |bits, at| bits << 8 | u32::from(three.get(at).copied().unwrap_or(0)));
        let symbol =
            |at: usize| if at > three.len() { '=' } else { SYMBOLS[(bits >> (18 - 6 * at)) as usize % 64].into() };
        (0..4).map(symbol).collect::<String>()
    };
    bytes.chunks(3).map(symbols).collect()
}

/// Returns a packet with these attributes and elements of one description.
pub(super) fn packet(attributes: &str, elements: &str) -> String {
    format!(
        "<?xpacket begin=\"\u{feff}\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?><x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF \
         xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\"><rdf:Description rdf:about=\"\" {NAMESPACES} \
         {attributes}>{elements}</rdf:Description></rdf:RDF></x:xmpmeta>\n   <?xpacket end=\"w\"?>"
    )
}

const NAMESPACES: &str = "xmlns:xmpNote=\"http://ns.adobe.com/xmp/note/\" \
     xmlns:GDepth=\"http://ns.google.com/photos/1.0/depthmap/\" xmlns:GFocus=\"http://ns.google.com/photos/1.0/focus/\" \
     xmlns:GImage=\"http://ns.google.com/photos/1.0/image/\" xmlns:Device=\"http://ns.google.com/photos/dd/1.0/device/\" \
     xmlns:Camera=\"http://ns.google.com/photos/dd/1.0/camera/\" \
     xmlns:DepthMap=\"http://ns.google.com/photos/dd/1.0/depthmap/\" \
     xmlns:Container=\"http://ns.google.com/photos/dd/1.0/container/\" \
     xmlns:Item=\"http://ns.google.com/photos/dd/1.0/item/\" xmlns:apdi=\"http://ns.apple.com/pixeldatainfo/1.0/\" \
     xmlns:depthData=\"http://ns.apple.com/depthData/1.0/\"";

pub(super) fn segment(marker: u8, content: &[u8]) -> Vec<u8> {
    [&[0xFF, marker][..], &(content.len() as u16 + 2).to_be_bytes(), content].concat()
}

/// Inserts segments at the start of a JPEG.
pub(super) fn with_segments(jpeg: &[u8], segments: &[Vec<u8>]) -> Vec<u8> {
    [&jpeg[..2], &segments.concat(), &jpeg[2..]].concat()
}

pub(super) fn main_xmp(packet: &str) -> Vec<u8> {
    segment(0xE1, &[ADOBE, packet.as_bytes()].concat())
}

/// Splits a packet into segments of Extended XMP with pieces of `size` bytes.
pub(super) fn extended_xmp(packet: &str, guid: &str, size: usize) -> Vec<Vec<u8>> {
    let length = (packet.len() as u32).to_be_bytes();
    let piece = |(index, piece): (usize, &[u8])| {
        let offset = ((index * size) as u32).to_be_bytes();
        segment(0xE1, &[EXTENSION, guid.as_bytes(), &length, &offset, piece].concat())
    };
    packet.as_bytes().chunks(size).enumerate().map(piece).collect()
}

/// `GDepth` in the main packet only.
pub(super) fn gdepth(attributes: &str, map: &[u8]) -> Vec<u8> {
    let data = format!("{attributes} GDepth:Mime=\"image/png\" GDepth:Data=\"{}\"", base64(map));
    with_segments(&jpeg(90), &[main_xmp(&packet(&data, ""))])
}

/// `GDepth` as Google's camera writes it: the data in Extended XMP, whose pieces `order` may rearrange.
pub(super) fn gdepth_extended(attributes: &str, map: &[u8], original: &[u8], order: fn(&mut Vec<Vec<u8>>)) -> Vec<u8> {
    let note = format!("{attributes} xmpNote:HasExtendedXMP=\"{GUID}\"");
    let data = format!("GDepth:Data=\"{}\" GImage:Data=\"{}\"", base64(map), base64(original));
    let mut pieces = extended_xmp(&packet(&data, ""), GUID, 100);
    order(&mut pieces);
    with_segments(&jpeg(90), &[vec![main_xmp(&packet(&note, ""))], pieces].concat())
}

/// One item of a Dynamic Depth list: name, padding after it, content.
pub(super) type Item<'a> = (&'a str, usize, &'a [u8]);

/// Dynamic Depth: `items` after the photo, and `trailer` after those.
pub(super) fn dynamic_depth(depth_map: &str, first_padding: usize, items: &[Item], trailer: &[u8]) -> Vec<u8> {
    let item = |name: &str, length: usize, padding: usize| {
        format!(
            "<rdf:li rdf:parseType=\"Resource\"><Container:Item Item:Mime=\"image/jpeg\" Item:Length=\"{length}\" \
             Item:Padding=\"{padding}\" Item:DataURI=\"{name}\"/></rdf:li>"
        )
    };
    let list: String = items.iter().map(|(name, padding, content)| item(name, content.len(), *padding)).collect();
    let elements = format!(
        "<Device:Container><Container:Directory><rdf:Seq>{}{list}</rdf:Seq></Container:Directory></Device:Container>\
         <Device:Cameras><rdf:Seq><rdf:li><Device:Camera><Camera:DepthMap {depth_map}/></Device:Camera></rdf:li>\
         </rdf:Seq></Device:Cameras>",
        item("primary_image", 0, first_padding)
    );
    let mut file = with_segments(&jpeg(90), &[main_xmp(&packet("", &elements))]);
    file.extend(vec![0; first_padding]);
    for (_, padding, content) in items {
        file.extend(*content);
        file.extend(vec![0; *padding]);
    }
    file.extend(trailer);
    file
}

/// An auxiliary picture of Apple's, described by elements.
pub(super) fn auxiliary(shade: u8, elements: &str) -> Vec<u8> {
    with_segments(&jpeg(shade), &[main_xmp(&packet("", elements))])
}

/// Apple's JPEG: `pictures` after the photo, with an index of them.
pub(super) fn multi_picture(is_big_endian: bool, pictures: &[Vec<u8>]) -> Vec<u8> {
    let u16 = |value: u16| if is_big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    let u32 = |value: usize| if is_big_endian { (value as u32).to_be_bytes() } else { (value as u32).to_le_bytes() };
    let index = |photo_bytes: usize| {
        let mut index = [*if is_big_endian { b"MM\0*" } else { b"II*\0" }, u32(8)].concat();
        index.extend([u16(2), u16(0xB000), u16(7)].concat());
        index.extend([&u32(4)[..], b"0100", &u16(0xB002), &u16(7)].concat());
        index.extend([u32(16 * (pictures.len() + 1)), u32(38), u32(0)].concat());
        // Positions count from the index, which is at byte 10 of the file.
        let mut at = photo_bytes - 10;
        index.extend([u32(0x3_0000), u32(photo_bytes), u32(0), u32(0)].concat());
        for picture in pictures {
            index.extend([u32(0), u32(picture.len()), u32(at), u32(0)].concat());
            at += picture.len();
        }
        index
    };
    let photo = |index: &[u8]| with_segments(&jpeg(90), &[segment(0xE2, &[b"MPF\0", index].concat())]);
    let bytes = photo(&index(10)).len();
    [photo(&index(bytes)), pictures.concat()].concat()
}
