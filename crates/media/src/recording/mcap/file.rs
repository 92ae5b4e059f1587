//! Reads pictures and depth maps from an opened file.

use std::fs::File;
use std::os::unix::fs::FileExt;

use super::chunk::{Chunk, ChunkCache};
use super::message::Picture;
use super::rvl;
use super::topic::{Message, Topic};
use crate::recording::coded::EncodedPicture;
use crate::recording::contents::{Container, StoredColor};
use crate::recording::decode::{self, DepthUnits, Scratch};
use crate::recording::fault::{PictureFault, ReadResult};
use crate::recording::raw_image::{self, DepthSamples};
use bokehcam::frame::DepthMap;

/// Bytes of a compressed depth map before its picture: a format and two parameters.
const COMPRESSED_DEPTH_HEAD_BYTES: usize = 12;

/// Units of quantised depth, before it is converted.
const WHOLE_NUMBERS: DepthUnits = DepthUnits { scale: 1.0, invalid: None };

/// An opened file.
#[derive(Debug)]
pub(super) struct McapFile {
    pub file: File,
    pub topics: Vec<Topic>,
    pub chunks: Vec<Chunk>,
    /// The topics of colour and depth.
    pub chosen: [Option<usize>; 2],
    /// The messages of each frame: colour and depth.
    pub frames: Vec<(usize, Option<usize>)>,
    pub units: DepthUnits,
    pub cache: ChunkCache,
}

impl McapFile {
    /// Reads a message of colour or depth into `bytes`, and parses it.
    fn read_picture<'a>(&self, topic: usize, at: usize, bytes: &'a mut Vec<u8>) -> ReadResult<Picture<'a>> {
        let topic = &self.topics[topic];
        let Message { at, length, chunk, .. } = topic.messages[at];
        bytes.clear();
        match chunk {
            None => {
                bytes.resize(length as usize, 0);
                self.file.read_exact_at(bytes, at)?;
            }
            Some(chunk) => {
                let chunk = self.cache.read(&self.chunks, chunk, &self.file)?;
                let message = chunk.get(at as usize..).and_then(|rest| rest.get(..length as usize));
                bytes.extend_from_slice(message.ok_or(PictureFault::Truncated)?);
            }
        }
        Picture::parse(bytes, topic.kind, topic.encoding)
            .ok_or_else(|| PictureFault::Damaged("not a message of its type".to_owned()))
    }

    fn read_frame<'a>(
        &self,
        frame: usize,
        is_depth: bool,
        bytes: &'a mut Vec<u8>,
    ) -> ReadResult<(Picture<'a>, &Topic)> {
        let (color, depth) = self.frames[frame];
        let message = if is_depth { depth } else { Some(color) };
        let (topic, message) = self.chosen[usize::from(is_depth)].zip(message).ok_or(PictureFault::Missing)?;
        Ok((self.read_picture(topic, message, bytes)?, &self.topics[topic]))
    }
}

impl Container for McapFile {
    fn read_stored_color<'a>(&self, frame: usize, bytes: &'a mut Vec<u8>) -> ReadResult<StoredColor<'a>> {
        Ok(match self.read_frame(frame, false, bytes)?.0 {
            Picture::Image(image) => StoredColor::Raw(image),
            Picture::Compressed { data, .. } => StoredColor::Encoded(data),
        })
    }

    fn read_depth(&self, frame: usize, _: (u32, u32), scratch: &mut Scratch, into: &mut DepthMap) -> ReadResult {
        let (picture, topic) = self.read_frame(frame, true, &mut scratch.file)?;
        match picture {
            Picture::Image(image) => {
                let samples = DepthSamples::from_name(image.format).unwrap_or(DepthSamples::Units);
                raw_image::decode_depth(&image, samples, self.units, into)
            }
            Picture::Compressed { format, data } => {
                let has_head = format.contains("compressedDepth") || topic.name.ends_with("/compressedDepth");
                let (head, picture) = match has_head {
                    true => data.split_at_checked(COMPRESSED_DEPTH_HEAD_BYTES).ok_or(PictureFault::Truncated)?,
                    false => data.split_at(0),
                };
                let quantization = topic.has_metres().then(|| Quantization::parse(head)).flatten();
                let units = if quantization.is_some() { WHOLE_NUMBERS } else { self.units };
                match format.to_lowercase().contains("rvl") {
                    true => rvl::decode_depth(picture, units, into)?,
                    false => {
                        let coded = EncodedPicture::open_bytes(picture)?;
                        decode::decode_depth(coded, units, &mut scratch.pixels, into)?;
                    }
                }
                if let Some(quantization) = quantization {
                    into.metres.iter_mut().for_each(|value| *value = quantization.depth_m(*value));
                }
                Ok(())
            }
        }
    }
}

/// How `compressed_depth_image_transport` writes metres as whole numbers: `v = a / z + b`, and 0 for unknown.
struct Quantization {
    a: f32,
    b: f32,
}

impl Quantization {
    fn parse(head: &[u8]) -> Option<Self> {
        let [_, a, b] = head.as_chunks::<4>().0 else { return None };
        let [a, b] = [*a, *b].map(f32::from_le_bytes);
        Some(Self { a, b })
    }

    fn depth_m(&self, value: f32) -> f32 {
        if value == 0.0 { 0.0 } else { raw_image::to_depth(self.a / (value - self.b)) }
    }
}

#[cfg(test)]
mod tests {
    use super::Quantization;

    #[test]
    fn quantised_distances_come_back() {
        // As the ROS package computes them with its defaults: a resolution of 100, and 10 m at most.
        let a = 100.0_f32 * 101.0;
        let b = 1.0 - a / 10.0;
        let head = [[0; 4], a.to_le_bytes(), b.to_le_bytes()].concat();
        let quantization = Quantization::parse(&head).unwrap();
        for depth_m in [0.5, 1.0, 2.5, 9.9_f32] {
            let found = quantization.depth_m((a / depth_m + b).round());
            assert!((found / depth_m - 1.0).abs() < 1e-3, "{found} for {depth_m}");
        }
        assert_eq!(quantization.depth_m(0.0), 0.0);
        assert!(Quantization::parse(&head[..8]).is_none());
    }
}
