//! Kinds of picture files, told by their first bytes: those that are read, and those that a program has to convert.

use image::ImageFormat;

use super::fault::PictureFault;

/// Number of bytes that tell the kind of a file.
pub(super) const START_BYTES: usize = 16;

/// The kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileKind {
    Png,
    Jpeg,
    Pfm,
    /// Decoded by the crate `image`.
    Other(ImageFormat),
    /// A kind that is not read: its name, and what to do.
    Foreign(&'static str, &'static str),
}

/// A kind of file, the position of its mark, and the mark, in which `?` is any byte.
type Mark = (FileKind, usize, &'static [u8]);

pub(super) const HEIC: FileKind = FileKind::Foreign(
    "a HEIC picture",
    "install heif-convert (package libheif-examples), which reads it, or convert it: heif-convert IN.heic OUT.png",
);
const AVIF: FileKind =
    FileKind::Foreign("an AVIF picture", "convert it: avifdec IN.avif OUT.png (package libavif-bin)");
const JPEG_XL: FileKind =
    FileKind::Foreign("a JPEG XL picture", "convert it: djxl IN.jxl OUT.png (package libjxl-tools)");
pub(super) const RAW: FileKind =
    FileKind::Foreign("a camera's raw picture", "develop it: darktable-cli IN.nef OUT.jpg (package darktable)");
const EXR: FileKind =
    FileKind::Foreign("an OpenEXR picture", "convert it: convert IN.exr OUT.png (package imagemagick)");
const NUMPY: FileKind = FileKind::Foreign("a NumPy array", "save it as a PNG, or give it as a depth map");
const PSD: FileKind =
    FileKind::Foreign("a Photoshop picture", "convert it: convert IN.psd[0] OUT.png (package imagemagick)");
const JPEG_2000: FileKind = FileKind::Foreign(
    "a JPEG 2000 picture",
    "convert it: opj_decompress -i IN.jp2 -o OUT.png (package libopenjp2-tools)",
);
const PDF: FileKind =
    FileKind::Foreign("a PDF document", "convert a page: pdftoppm -png -singlefile IN.pdf OUT (package poppler-utils)");
const SVG: FileKind =
    FileKind::Foreign("an SVG drawing", "convert it: rsvg-convert IN.svg -o OUT.png (package librsvg2-bin)");
const XML: FileKind = FileKind::Foreign(
    "an XML file",
    "if it is an SVG drawing, convert it: rsvg-convert IN.svg -o OUT.png (package librsvg2-bin)",
);
const PNM: FileKind = FileKind::Other(ImageFormat::Pnm);

/// Marks of files, the more specific ones first.
const MARKS: [Mark; 31] = [
    (FileKind::Png, 0, b"\x89PNG\r\n\x1a\n"),
    (FileKind::Jpeg, 0, b"\xFF\xD8\xFF"),
    (FileKind::Other(ImageFormat::WebP), 0, b"RIFF????WEBP"),
    (FileKind::Other(ImageFormat::Gif), 0, b"GIF87a"),
    (FileKind::Other(ImageFormat::Gif), 0, b"GIF89a"),
    // The two reserved words are 0.
    (FileKind::Other(ImageFormat::Bmp), 0, b"BM????\0\0\0\0"),
    (HEIC, 4, b"ftyphei"),
    (HEIC, 4, b"ftyphev"),
    (HEIC, 4, b"ftypmif1"),
    (HEIC, 4, b"ftypmsf1"),
    (AVIF, 4, b"ftypavi"),
    (RAW, 4, b"ftypcrx"),
    (JPEG_XL, 0, b"\xFF\x0A"),
    (JPEG_XL, 0, b"\0\0\0\x0CJXL \r\n"),
    (EXR, 0, b"\x76\x2F\x31\x01"),
    (NUMPY, 0, b"\x93NUMPY"),
    (PSD, 0, b"8BPS"),
    (JPEG_2000, 0, b"\0\0\0\x0CjP  \r\n"),
    (JPEG_2000, 0, b"\xFF\x4F\xFF\x51"),
    (PDF, 0, b"%PDF-"),
    (SVG, 0, b"<svg"),
    (XML, 0, b"<?xml"),
    // Canon, Olympus, Panasonic, Fujifilm, Sigma.
    (RAW, 0, b"II*\0????CR"),
    (RAW, 0, b"IIRO"),
    (RAW, 0, b"IIRS"),
    (RAW, 0, b"MMOR"),
    (RAW, 0, b"IIU\0"),
    (RAW, 0, b"FUJIFILMCCD-RAW"),
    (RAW, 0, b"FOVb"),
    (FileKind::Other(ImageFormat::Tiff), 0, b"II*\0"),
    (FileKind::Other(ImageFormat::Tiff), 0, b"MM\0*"),
];

impl FileKind {
    /// Tells the kind by the first bytes of a file; `None` if unknown.
    pub(super) fn detect(start: &[u8]) -> Option<Self> {
        let has = |&&(_, at, mark): &&Mark| {
            let bytes = start.get(at..at + mark.len());
            bytes.is_some_and(|bytes| bytes.iter().zip(mark).all(|(byte, mark)| *mark == b'?' || byte == mark))
        };
        match start {
            [b'P', b'f' | b'F', space, ..] if space.is_ascii_whitespace() => Some(Self::Pfm),
            [b'P', b'1'..=b'7', space, ..] if space.is_ascii_whitespace() => Some(PNM),
            _ => MARKS.iter().find(has).map(|(kind, ..)| *kind),
        }
    }

    /// Returns the fault of a file of this kind where another one is `expected`.
    pub(super) fn fault(kind: Option<Self>, expected: &'static str) -> PictureFault {
        match kind {
            Some(Self::Foreign(kind, remedy)) => PictureFault::Foreign { kind, remedy },
            _ => PictureFault::Format(expected),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_told_by_its_first_bytes() {
        for (kind, at, mark) in MARKS {
            let start = [vec![0; at], mark.iter().map(|byte| if *byte == b'?' { 7 } else { *byte }).collect()].concat();
            assert_eq!(FileKind::detect(&start), Some(kind), "{start:?}");
            assert!(start.len() <= START_BYTES);
            assert_ne!(FileKind::detect(&start[..start.len() - 1]), Some(kind), "{start:?}, cut short");
        }
        for unknown in [&b""[..], b"BM of two letters", b"RIFF\0\0\0\0WAVE", b"\0\0\0\x18ftypmp42", b"P8 1 1", b"P2: 7"]
        {
            assert_eq!(FileKind::detect(unknown), None);
        }
        for (start, kind) in [(&b"P1\n8"[..], PNM), (b"P6 1 1", PNM), (b"P7\r\n", PNM), (b"Pf\n8", FileKind::Pfm)] {
            assert_eq!(FileKind::detect(start), Some(kind));
        }
    }
}
