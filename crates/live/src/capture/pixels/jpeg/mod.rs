//! Motion JPEG as cameras send it.
//!
//! Each file is copied into one that the decoder cannot misread (see [`repair_jpeg`]).

#[cfg(test)]
mod tests;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::PixelError;
use crate::layout::Layout;
use bokehcam::compute::catch_panic;
use bokehcam::frame::ColorImage;
use bokehcam_jpeg::repair_jpeg;

/// Decodes JPEGs; keeps the buffer for the repaired file.
#[derive(Debug, Default)]
pub(super) struct MotionJpeg {
    file: Vec<u8>,
}

impl MotionJpeg {
    /// Decodes the JPEG in `bytes` into `out` (resized to fit), if it is complete and of the layout's size.
    pub(super) fn decode(&mut self, layout: &Layout, bytes: &[u8], out: &mut ColorImage) -> Result<(), PixelError> {
        let expected = (layout.width as usize, layout.height as usize);
        let found = repair_jpeg(bytes, &mut self.file).map_err(|fault| PixelError::Jpeg(fault.to_string()))?;
        if found != expected {
            return Err(PixelError::Size { found, expected });
        }
        let options = DecoderOptions::new_fast().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&self.file[..]), options);
        out.resize(layout.width, layout.height);
        match catch_panic(|| decoder.decode_into(&mut out.rgb)) {
            // Errors may span lines.
            Some(decoded) => decoded.map_err(|error| PixelError::Jpeg(error.to_string().replace('\n', " "))),
            None => Err(PixelError::Jpeg("it makes the decoder fail".to_owned())),
        }
    }
}
