//! Reads pictures and depth maps from an opened file.

use std::fs::File;
use std::os::unix::fs::FileExt;

use super::track::{Block, ColorFormat};
use crate::recording::contents::{Container, StoredColor};
use crate::recording::decode::{DepthUnits, Scratch};
use crate::recording::depth_covers;
use crate::recording::fault::{PictureFault, ReadResult};
use crate::recording::raw_image::{self, DepthSamples, RawImage};
use bokehcam::frame::DepthMap;

/// An opened file.
#[derive(Debug)]
pub(super) struct KinectFile {
    pub file: File,
    pub color_format: ColorFormat,
    /// Width and height of colour pictures, as stated.
    pub color_size: (u32, u32),
    pub depth_size: (u32, u32),
    pub units: DepthUnits,
    /// Why the file's calibration is not used, if so.
    pub uncalibrated: Option<String>,
    /// Colour and depth of each frame.
    pub frames: Vec<(Block, Option<Block>)>,
}

impl KinectFile {
    fn read<'a>(&self, block: Block, bytes: &'a mut Vec<u8>) -> ReadResult<&'a [u8]> {
        bytes.resize(block.length as usize, 0);
        self.file.read_exact_at(bytes, block.at)?;
        Ok(bytes)
    }
}

impl Container for KinectFile {
    fn read_stored_color<'a>(&self, frame: usize, bytes: &'a mut Vec<u8>) -> ReadResult<StoredColor<'a>> {
        let data = self.read(self.frames[frame].0, bytes)?;
        let (size, width) = (self.color_size, self.color_size.0 as usize);
        let raw = |format, stride_bytes| RawImage { size, format, is_big_endian: false, stride_bytes, data };
        Ok(match self.color_format {
            ColorFormat::Jpeg => StoredColor::Encoded(data),
            ColorFormat::Nv12 => StoredColor::Nv12(raw("", width)),
            ColorFormat::Raw { name, pixel_bytes } => StoredColor::Raw(raw(name, width * pixel_bytes)),
        })
    }

    fn read_depth(&self, frame: usize, size: (u32, u32), scratch: &mut Scratch, into: &mut DepthMap) -> ReadResult {
        if let Some(reason) = self.uncalibrated.clone().filter(|_| !depth_covers(self.depth_size, size)) {
            return Err(PictureFault::Uncalibrated { found: self.depth_size, reason });
        }
        let block = self.frames[frame].1.ok_or(PictureFault::Missing)?;
        let data = self.read(block, &mut scratch.file)?;
        let (size, stride_bytes) = (self.depth_size, 2 * self.depth_size.0 as usize);
        let image = RawImage { size, format: "16UC1", is_big_endian: true, stride_bytes, data };
        raw_image::decode_depth(&image, DepthSamples::Units, self.units, into)
    }
}
