//! Uncompressed video with time stamps for ffmpeg: an endless Matroska stream with one frame per cluster.
//!
//! Elements are those of RFC 9559; the codec is `V_UNCOMPRESSED`, I420 or RGBA.

use std::io::{self, Write};

use crate::layout::Range;
use crate::sink::interleave_alpha;
use crate::sink::yuv::Converter;
use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;

/// Time stamps are in microseconds.
const TICK_NS: u64 = 1000;
/// Minimum distance of frames, 1 ms: encoders would merge closer ones.
const MIN_TICKS: u64 = 1000;

/// A stream of raw frames.
pub(super) struct RawVideo<W: Write> {
    pub(super) writer: W,
    /// `None` for RGBA.
    converter: Option<Converter>,
    /// A picture with its alpha channel.
    rgba: Vec<u8>,
    /// Time of the first frame.
    first_ns: Option<u64>,
    /// Time of the last frame, in ticks after the first.
    last_ticks: Option<u64>,
    /// An encoded cluster that is not written yet.
    bytes: Vec<u8>,
}

impl<W: Write> RawVideo<W> {
    /// Creates a stream into `writer` of frames of `size` that usually come every `period_ns`, with an alpha
    /// channel if `has_alpha`. Writes its header at once.
    pub(super) fn new(mut writer: W, size: (u32, u32), period_ns: u64, has_alpha: bool) -> io::Result<Self> {
        let matrix = Some(YcbcrMatrix::for_height(size.1)).filter(|_| !has_alpha);
        writer.write_all(&encode_header(&encode_track(size, period_ns, matrix)))?;
        Ok(Self {
            writer,
            converter: matrix.map(|matrix| Converter::new(matrix, Range::Limited)),
            rgba: Vec::new(),
            first_ns: None,
            last_ticks: None,
            bytes: Vec::new(),
        })
    }

    /// Whether frames have an alpha channel.
    pub(super) fn has_alpha(&self) -> bool {
        self.converter.is_none()
    }

    /// Writes a frame captured at `time_ns`, as a cluster of its own. `alpha` is one byte per pixel; empty is opaque.
    pub(super) fn write_frame(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> io::Result<()> {
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        let ticks = (time_ns.saturating_sub(first_ns) + TICK_NS / 2) / TICK_NS;
        let ticks = self.last_ticks.map_or(ticks, |last| ticks.max(last + MIN_TICKS));
        self.last_ticks = Some(ticks);
        let (width, height) = (frame.width as usize, frame.height as usize);
        let picture_bytes = match self.has_alpha() {
            true => 4 * width * height,
            false => width * height + 2 * width.div_ceil(2) * height.div_ceil(2),
        };
        let time = encode_element(TIMESTAMP, &ticks.to_be_bytes());
        // Track 1, at the time of the cluster, a key frame.
        let block_head = [0x81, 0, 0, 0x80];
        let block_bytes = block_head.len() + picture_bytes;
        append_element_head(CLUSTER, time.len() + SIMPLE_BLOCK.len() + SIZE_BYTES + block_bytes, &mut self.bytes);
        self.bytes.extend_from_slice(&time);
        append_element_head(SIMPLE_BLOCK, block_bytes, &mut self.bytes);
        self.bytes.extend_from_slice(&block_head);
        match &mut self.converter {
            Some(converter) => converter.append_planes(frame, &mut self.bytes),
            None => {
                let opaque = std::iter::repeat_n(&u8::MAX, if alpha.is_empty() { width * height } else { 0 });
                interleave_alpha(frame, alpha.iter().chain(opaque), &mut self.rgba);
                self.bytes.extend_from_slice(&self.rgba);
            }
        }
        let written = self.writer.write_all(&self.bytes);
        self.bytes.clear();
        written
    }
}

const SEGMENT: &[u8] = &[0x18, 0x53, 0x80, 0x67];
const CLUSTER: &[u8] = &[0x1f, 0x43, 0xb6, 0x75];
const TIMESTAMP: &[u8] = &[0xe7];
const SIMPLE_BLOCK: &[u8] = &[0xa3];
/// Sizes are written as eight bytes, which the first byte, 01, indicates.
const SIZE_BYTES: usize = 8;
const UNKNOWN_SIZE: [u8; SIZE_BYTES] = [0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];

/// Appends the head of an element whose content of `bytes` bytes is to follow.
fn append_element_head(id: &[u8], bytes: usize, to: &mut Vec<u8>) {
    to.extend_from_slice(id);
    to.extend_from_slice(&(bytes as u64 | 1 << 56).to_be_bytes());
}

fn encode_element(id: &[u8], content: &[u8]) -> Vec<u8> {
    let mut element = Vec::with_capacity(id.len() + SIZE_BYTES + content.len());
    append_element_head(id, content.len(), &mut element);
    element.extend_from_slice(content);
    element
}

/// Returns an element with a number.
fn number(id: &[u8], value: u64) -> Vec<u8> {
    encode_element(id, &value.to_be_bytes())
}

/// Returns an element that consists of others.
fn master_element(id: &[u8], parts: &[Vec<u8>]) -> Vec<u8> {
    encode_element(id, &parts.concat())
}

/// Builds everything before the first cluster: the EBML header, and the head of an endless segment with its info and
/// one `track`.
fn encode_header(track: &[u8]) -> Vec<u8> {
    let mut header = master_element(
        &[0x1a, 0x45, 0xdf, 0xa3],
        &[
            // Versions, longest identifiers and sizes, document type and its versions.
            number(&[0x42, 0x86], 1),
            number(&[0x42, 0xf7], 1),
            number(&[0x42, 0xf2], 4),
            number(&[0x42, 0xf3], 8),
            encode_element(&[0x42, 0x82], b"matroska"),
            number(&[0x42, 0x87], 4),
            number(&[0x42, 0x85], 2),
        ],
    );
    header.extend_from_slice(SEGMENT);
    header.extend_from_slice(&UNKNOWN_SIZE);
    // Info: the length of a tick, the muxing and the writing program.
    let app_name = |id: &[u8]| encode_element(id, b"bokehcam");
    header.extend(master_element(
        &[0x15, 0x49, 0xa9, 0x66],
        &[number(&[0x2a, 0xd7, 0xb1], TICK_NS), app_name(&[0x4d, 0x80]), app_name(&[0x57, 0x41])],
    ));
    header.extend(encode_element(&[0x16, 0x54, 0xae, 0x6b], track));
    header
}

/// Builds the track of a video, of RGBA if there is no `matrix`.
fn encode_track((width, height): (u32, u32), period_ns: u64, matrix: Option<YcbcrMatrix>) -> Vec<u8> {
    // Codes of ITU-T H.273.
    let (color, layout) = match matrix {
        Some(YcbcrMatrix::Bt601) => (6, b"I420"),
        Some(YcbcrMatrix::Bt709) => (1, b"I420"),
        Some(YcbcrMatrix::Bt2020) => (9, b"I420"),
        None => (0, b"RGBA"),
    };
    // Matrix, chroma siting (in the centre of four pixels, both ways), limited range, transfer, primaries.
    let colour = master_element(
        &[0x55, 0xb0],
        &[
            number(&[0x55, 0xb1], color),
            number(&[0x55, 0xb7], 2),
            number(&[0x55, 0xb8], 2),
            number(&[0x55, 0xb9], 1),
            number(&[0x55, 0xba], color),
            number(&[0x55, 0xbb], color),
        ],
    );
    // Width, height, pixel layout.
    let video = master_element(
        &[0xe0],
        &[
            number(&[0xb0], width.into()),
            number(&[0xba], height.into()),
            encode_element(&[0x2e, 0xb5, 0x24], layout),
            if matrix.is_some() { colour } else { Vec::new() },
        ],
    );
    master_element(
        &[0xae],
        &[
            // Number and unique number.
            number(&[0xd7], 1),
            number(&[0x73, 0xc5], 1),
            // Video, without lacing.
            number(&[0x83], 1),
            number(&[0x9c], 0),
            // Codec and frame period.
            encode_element(&[0x86], b"V_UNCOMPRESSED"),
            number(&[0x23, 0xe3, 0x83], period_ns),
            video,
        ],
    )
}
