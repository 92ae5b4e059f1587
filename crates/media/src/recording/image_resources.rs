//! Photoshop's image resources, in which JPEG and TIFF hold captions and rights as IPTC.
//!
//! Format: Adobe Photoshop File Formats Specification, "Image Resource Blocks": signature (4 bytes), number (2), name
//! (its length in a byte, padded to even), length (4, big-endian), and content, padded to even.

/// Identifier at the start of a JPEG segment (APP13) with resources.
pub(super) const JPEG_NAME: &[u8] = b"Photoshop 3.0\0";
/// Maximum bytes of resources in a JPEG segment; more are split.
pub(super) const MAX_SEGMENT_BYTES: usize = 65_533 - JPEG_NAME.len();

const SIGNATURE: &[u8] = b"8BIM";
/// Captions, rights and authors.
const IPTC: u16 = 0x0404;
/// Thumbnails, which show the picture before the blur, and copies of the profile, EXIF and XMP.
const REMOVED: [u16; 6] = [0x0409, 0x040C, 0x040F, 0x0422, 0x0423, 0x0424];

/// A resource: its number, and all of its bytes.
type Resource<'a> = (u16, &'a [u8]);

/// Returns the resources that are still valid for a picture with other pixels; `None` if they are damaged.
pub(super) fn keep_valid_parts(resources: &[u8]) -> Option<Vec<u8>> {
    let (mut kept, mut rest) = (Vec::new(), resources);
    // Some writers append zeros.
    while rest.iter().any(|byte| *byte != 0) {
        let (number, resource) = read_first(rest)?;
        rest = &rest[resource.len()..];
        if !REMOVED.contains(&number) {
            kept.extend_from_slice(resource);
            kept.extend((resource.len() % 2 == 1).then_some(0));
        }
    }
    Some(kept)
}

/// Returns whether there are captions among valid resources.
pub(super) fn have_iptc(resources: &[u8]) -> bool {
    let mut rest = resources;
    let mut numbers = std::iter::from_fn(|| {
        let (number, resource) = read_first(rest)?;
        rest = &rest[resource.len()..];
        Some(number)
    });
    numbers.any(|number| number == IPTC)
}

/// Returns IPTC data as the only resource.
pub(super) fn from_iptc(iptc: &[u8]) -> Vec<u8> {
    let padding: &[u8] = if iptc.len() % 2 == 1 { &[0] } else { &[] };
    [SIGNATURE, &IPTC.to_be_bytes(), &[0; 2], &(iptc.len() as u32).to_be_bytes(), iptc, padding].concat()
}

fn read_first(resources: &[u8]) -> Option<Resource<'_>> {
    let (number, rest) = resources.strip_prefix(SIGNATURE)?.split_first_chunk()?;
    let name_bytes = (1 + usize::from(*rest.first()?)).next_multiple_of(2);
    let (length, rest) = rest.get(name_bytes..)?.split_first_chunk()?;
    let length = u32::from_be_bytes(*length) as usize;
    rest.get(..length)?;
    // The last one may lack its padding.
    let end = resources.len() - rest.len() + length.next_multiple_of(2).min(rest.len());
    Some((u16::from_be_bytes(*number), &resources[..end]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resource(number: u16, name: &str, content: &[u8]) -> Vec<u8> {
        let mut bytes = [SIGNATURE, &number.to_be_bytes(), &[name.len() as u8], name.as_bytes()].concat();
        bytes.extend(name.len().is_multiple_of(2).then_some(0));
        bytes.extend((content.len() as u32).to_be_bytes());
        bytes.extend_from_slice(content);
        bytes.extend((content.len() % 2 == 1).then_some(0));
        bytes
    }

    #[test]
    fn captions_stay_and_thumbnails_do_not() {
        let (captions, other) = (from_iptc(b"\x1c\x02\x74\0\x03(c)"), resource(0x040A, "odd", &[1]));
        assert_eq!(captions, resource(IPTC, "", b"\x1c\x02\x74\0\x03(c)"));
        let thumbnails = [resource(0x0409, "", b"BGR"), resource(0x040C, "name", b"JPEG")];
        let held = [&thumbnails[0][..], &captions, &thumbnails[1], &other].concat();
        let kept = [&captions[..], &other].concat();
        assert_eq!(keep_valid_parts(&held).as_ref(), Some(&kept));
        assert_eq!(keep_valid_parts(&[&held[..], &[0; 5]].concat()).as_ref(), Some(&kept));
        // The last padding may be missing.
        assert_eq!(keep_valid_parts(&held[..held.len() - 1]).as_ref(), Some(&kept));
        assert!(have_iptc(&kept) && !have_iptc(&other));
        assert_eq!(keep_valid_parts(&thumbnails.concat()), Some(Vec::new()));
        for damaged in [&held[..held.len() - 2], &held[1..], b"8BIM", b"8BIM\x04\x04\0\0\xFF\xFF\xFF\xFF"] {
            assert_eq!(keep_valid_parts(damaged), None);
        }
    }
}
