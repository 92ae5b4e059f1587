//! JPEG photos with all their pixels: the crate `image` would fill in missing ones, and say nothing.

use std::io::{Cursor, ErrorKind};

use image::codecs::jpeg::JpegDecoder;
use image::error::{DecodingError, ImageError, ImageResult};
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder, ImageFormat};
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::repair::{Fault, repair_jpeg};
use super::segments::find_end;

/// The end marker (EOI).
const END: [u8; 2] = [0xFF, 0xD9];

/// Decodes a JPEG as [`JpegDecoder`] does, or fails if a part of the picture is missing or damaged.
pub struct StrictJpeg<'a> {
    /// Reads the header and the metadata.
    header: JpegDecoder<Cursor<&'a [u8]>>,
    file: &'a [u8],
}

impl<'a> StrictJpeg<'a> {
    /// Reads the header of a file.
    ///
    /// # Errors
    /// It is damaged, or of an unsupported kind.
    pub fn new(file: &'a [u8]) -> ImageResult<Self> {
        Ok(Self { header: JpegDecoder::new(Cursor::new(file))?, file })
    }
}

impl ImageDecoder for StrictJpeg<'_> {
    fn dimensions(&self) -> (u32, u32) {
        self.header.dimensions()
    }

    fn color_type(&self) -> ColorType {
        self.header.color_type()
    }

    fn icc_profile(&mut self) -> ImageResult<Option<Vec<u8>>> {
        self.header.icc_profile()
    }

    fn exif_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        self.header.exif_metadata()
    }

    fn xmp_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        self.header.xmp_metadata()
    }

    fn iptc_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        self.header.iptc_metadata()
    }

    fn orientation(&mut self) -> ImageResult<Orientation> {
        self.header.orientation()
    }

    fn read_image(self, into: &mut [u8]) -> ImageResult<()> {
        let truncated = || ImageError::IoError(ErrorKind::UnexpectedEof.into());
        let damaged = |what: String| ImageError::Decoding(DecodingError::new(ImageFormat::Jpeg.into(), what));
        let mut repaired = Vec::with_capacity(self.file.len() + (1 << 12));
        repair_jpeg(self.file, &mut repaired).map_err(|fault| match fault {
            Fault::Header | Fault::Restart | Fault::Scans => truncated(),
            Fault::NoStart | Fault::NoSize | Fault::Coding(_) => damaged(fault.to_string()),
        })?;
        let color = self.color_type();
        decode(&repaired, color, into).map_err(|error| {
            // With zeros in place of an invalid code, the decoder goes on where data are only missing.
            let end = find_end(self.file).unwrap_or(self.file.len()).saturating_sub(END.len());
            let padded = [&self.file[..end], &[0; 64], &END].concat();
            if decode(&padded, color, into).is_ok() { truncated() } else { damaged(error) }
        })
    }

    fn read_image_boxed(self: Box<Self>, into: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(into)
    }
}

fn decode(file: &[u8], color: ColorType, into: &mut [u8]) -> Result<(), String> {
    let color = if color == ColorType::L8 { ColorSpace::Luma } else { ColorSpace::RGB };
    let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(color);
    let options = options.set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(file), options);
    decoder.decode_into(into).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(file: &[u8]) -> ImageResult<Vec<u8>> {
        let decoder = StrictJpeg::new(file)?;
        let mut pixels = vec![0; decoder.total_bytes() as usize];
        decoder.read_image(&mut pixels).map(|()| pixels)
    }

    fn is_truncated(read: ImageResult<Vec<u8>>) -> bool {
        matches!(read, Err(ImageError::IoError(error)) if error.kind() == ErrorKind::UnexpectedEof)
    }

    /// The last one is progressive.
    const FILES: [&[u8]; 5] = [
        include_bytes!("../../../fuzz/seeds/picture/420.jpg"),
        include_bytes!("../../../fuzz/seeds/picture/444.jpg"),
        include_bytes!("../../../fuzz/seeds/picture/grey.jpg"),
        include_bytes!("../../../fuzz/seeds/picture/restart.jpg"),
        include_bytes!("../../../fuzz/seeds/picture/progressive.jpg"),
    ];

    #[test]
    fn whole_pictures_are_those_of_the_other_decoder() {
        for file in FILES {
            let other = JpegDecoder::new(Cursor::new(file)).unwrap();
            let mut expected = vec![0; other.total_bytes() as usize];
            other.read_image(&mut expected).unwrap();
            assert!(read(file).unwrap() == expected);
        }
    }

    #[test]
    fn a_picture_that_was_cut_and_closed_is_truncated() {
        for file in &FILES[..4] {
            // Half of its scan is left.
            let scan = file.windows(2).rposition(|pair| pair == [0xFF, 0xDA]).unwrap();
            let closed = [&file[..usize::midpoint(scan + 14, file.len())], &END].concat();
            assert!(is_truncated(read(&closed)), "{} bytes", file.len());
        }
        // Progressive pictures begin with a scan of the mean of each block.
        let progressive = FILES[4];
        let first = progressive.windows(2).position(|pair| pair == [0xFF, 0xDA]).unwrap();
        let closed = [&progressive[..first + 20], &END].concat();
        assert!(is_truncated(read(&closed)));
    }
}
