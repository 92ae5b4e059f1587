//! Base64 (RFC 4648), as XMP holds pictures.

/// Decodes a text; white space is skipped, and padding may be missing. `None` if anything else is in it.
pub(super) fn decode(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_ascii_end().trim_end_matches('=');
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    let (mut bits, mut bit_count) = (0_u32, 0);
    for symbol in text.bytes().filter(|symbol| !symbol.is_ascii_whitespace()) {
        let value = match symbol {
            b'A'..=b'Z' => symbol - b'A',
            b'a'..=b'z' => symbol - b'a' + 26,
            b'0'..=b'9' => symbol - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        (bits, bit_count) = (bits << 6 | u32::from(value), bit_count + 6);
        if bit_count >= 8 {
            bit_count -= 8;
            bytes.push((bits >> bit_count) as u8);
        }
    }
    // A single symbol is less than a byte.
    (bit_count < 6).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn the_vectors_of_the_standard_are_decoded() {
        // RFC 4648, section 10.
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(decode(text).as_deref(), Some(bytes.as_bytes()), "{text}");
            assert_eq!(decode(text.trim_end_matches('=')).as_deref(), Some(bytes.as_bytes()), "{text} unpadded");
        }
        assert_eq!(decode(" Zm9v\n YmFy\r\n").as_deref(), Some(b"foobar".as_slice()));
        assert_eq!(decode("/+8=").as_deref(), Some([0xff, 0xef].as_slice()));
        for damaged in ["Z", "Zm9vY", "Zm*v", "Zm=v", "Zm9v\u{e4}", "Zm-_"] {
            assert_eq!(decode(damaged), None, "{damaged}");
        }
    }
}
