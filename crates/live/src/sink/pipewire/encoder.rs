//! Encodes pictures in the formats that readers of a camera may request.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use crate::layout::{Family, FourCc, Layout};
use crate::pipewire::mode::{Mode, NegotiatedFormat, Offer};
use crate::pipewire::node::PictureMemory;
use crate::sink::{raw, yuyv};
use bokehcam::frame::ColorImage;
use bokehcam::frame::fit::Letterbox;

/// At least the quality of usual cameras.
const JPEG_QUALITY: u8 = 90;
/// Upper bound for a noise picture as JPEG, and for its header.
const JPEG_BYTES_PER_PX: usize = 3;
const JPEG_HEAD_BYTES: usize = 4096;
/// Picture sides that are offered: from one block of JPEG's subsampled chroma to a size that fits the node's memory.
const MIN_SIDE_PX: u32 = 16;
const MAX_SIDE_PX: u32 = 4096;

/// Encodes pictures of any size into one format of one size.
pub(super) struct Encoder {
    format: Format,
    layout: Layout,
    method: Method,
    fit: Letterbox,
    fitted: ColorImage,
}

enum Method {
    Yuyv(yuyv::Encoder),
    Raw(Box<raw::Encoder>),
    Jpeg,
}

/// A format with a size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Format {
    fourcc: [u8; 4],
    size: (u32, u32),
}

impl From<&NegotiatedFormat> for Format {
    fn from(negotiated: &NegotiatedFormat) -> Self {
        Self { fourcc: negotiated.fourcc, size: negotiated.size }
    }
}

impl Format {
    /// Packs the format into one number, which threads exchange without a lock. 16 bits per side are sufficient.
    pub fn pack(self) -> u64 {
        let (width, height) = self.size;
        u64::from(u32::from_le_bytes(self.fourcc)) << 32 | u64::from(width as u16) << 16 | u64::from(height as u16)
    }

    pub fn unpack(packed: u64) -> Self {
        let side = |shift: u32| u32::from((packed >> shift) as u16);
        Self { fourcc: ((packed >> 32) as u32).to_le_bytes(), size: (side(16), side(0)) }
    }

    /// Whether the format is YUYV of that size.
    pub fn is_yuyv(self, size: (u32, u32)) -> bool {
        self.fourcc == *b"YUYV" && self.size == size
    }

    pub fn yuyv(size: (u32, u32)) -> Self {
        Self { fourcc: *b"YUYV", size }
    }

    pub fn size(self) -> (u32, u32) {
        self.size
    }

    fn layout(self) -> Option<Layout> {
        Layout::packed(FourCc(self.fourcc), self.size.0, self.size.1).ok()
    }
}

impl Encoder {
    /// Creates an encoder; `None` for a format that cannot be written.
    pub fn new(format: Format) -> Option<Self> {
        let layout = format.layout()?;
        let method = match layout.family() {
            Family::Jpeg => Method::Jpeg,
            // Two pixels share their chroma.
            _ if format.is_yuyv(format.size) && format.size.0.is_multiple_of(2) => Method::Yuyv(yuyv::Encoder::new()),
            _ => Method::Raw(Box::new(raw::Encoder::new(&layout)?)),
        };
        let fitted = ColorImage::new(format.size.0, format.size.1);
        Some(Self { format, layout, method, fit: Letterbox::default(), fitted })
    }

    pub fn format(&self) -> Format {
        self.format
    }

    /// Memory that a picture needs.
    pub fn picture_memory(&self) -> PictureMemory {
        let (width, height) = self.format.size;
        match self.method {
            Method::Jpeg => PictureMemory {
                bytes: JPEG_HEAD_BYTES + JPEG_BYTES_PER_PX * width as usize * height as usize,
                stride: 0,
            },
            _ => PictureMemory {
                bytes: self.layout.min_size_bytes(0),
                stride: self.layout.planes().first().map_or(0, |plane| plane.stride_bytes),
            },
        }
    }

    /// Encodes a picture, scaled into the format's size, into `bytes`, whose content is replaced.
    pub fn encode(&mut self, picture: &ColorImage, bytes: &mut Vec<u8>) {
        let needed = self.picture_memory().bytes;
        let picture = self.fit.fit_if_needed(picture, &mut self.fitted);
        match &mut self.method {
            Method::Yuyv(encoder) => {
                bytes.resize(needed, 0);
                encoder.encode(picture, bytes);
            }
            Method::Raw(encoder) => {
                bytes.resize(needed, 0);
                encoder.encode(picture, &mut [bytes]);
            }
            Method::Jpeg => {
                bytes.clear();
                let mut encoder = JpegEncoder::new_with_quality(&mut *bytes, JPEG_QUALITY);
                let done = encoder.encode(&picture.rgb, picture.width, picture.height, ExtendedColorType::Rgb8);
                if let Err(error) = done {
                    tracing::debug!("a picture could not be compressed: {error}");
                    bytes.clear();
                }
            }
        }
    }
}

/// Returns the modes of a camera that [`Encoder`] can write, with sizes from `MIN_SIDE_PX` to `MAX_SIDE_PX` a side.
pub(super) fn writable_modes(modes: &[Mode]) -> Vec<Mode> {
    let is_writable =
        |mode: &&Mode| Encoder::new(Format { fourcc: mode.fourcc, size: (MIN_SIDE_PX, MIN_SIDE_PX) }).is_some();
    let limited = |mode: &Mode| Some(Mode { sizes: limit_sizes(&mode.sizes)?, ..mode.clone() });
    modes.iter().filter(is_writable).filter_map(limited).collect()
}

/// Returns the sizes within bounds; `None` if there are none.
fn limit_sizes(sizes: &Offer<(u32, u32)>) -> Option<Offer<(u32, u32)>> {
    let sides = MIN_SIDE_PX..=MAX_SIDE_PX;
    match sizes {
        Offer::These(sizes) => {
            let is_within = |(width, height): &(u32, u32)| sides.contains(width) && sides.contains(height);
            let within: Vec<_> = sizes.iter().copied().filter(is_within).collect();
            (!within.is_empty()).then_some(Offer::These(within))
        }
        Offer::Range { min, max } => {
            let min = (min.0.max(MIN_SIDE_PX), min.1.max(MIN_SIDE_PX));
            let max = (max.0.min(MAX_SIDE_PX), max.1.min(MAX_SIDE_PX));
            (min.0 <= max.0 && min.1 <= max.1).then_some(Offer::Range { min, max })
        }
        Offer::Unknown => Some(Offer::Range { min: (MIN_SIDE_PX, MIN_SIDE_PX), max: (MAX_SIDE_PX, MAX_SIDE_PX) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::pixels::Decoder;

    const FORMATS: [&[u8; 4]; 10] =
        [b"YUYV", b"UYVY", b"YVYU", b"NV12", b"NV21", b"YU12", b"YV12", b"RGB3", b"BGR3", b"MJPG"];

    /// Every format that a reader may request decodes to the original picture.
    #[test]
    fn what_readers_decode_is_the_picture() {
        let mut picture = ColorImage::new(64, 48);
        for (at, pixel) in picture.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let (x, y) = (at % 64, at / 64);
            *pixel = [(4 * x) as u8, (5 * y) as u8, 128];
        }
        for fourcc in FORMATS {
            for size in [(64, 48), (128, 96)] {
                let mut encoder = Encoder::new(Format { fourcc: *fourcc, size }).unwrap();
                let mut bytes = vec![7; 3];
                encoder.encode(&picture, &mut bytes);
                assert!((1..=encoder.picture_memory().bytes).contains(&bytes.len()), "{}", FourCc(*fourcc));
                let layout =
                    Layout::with_stride(FourCc(*fourcc), size.0, size.1, encoder.picture_memory().stride).unwrap();
                let mut decoded = ColorImage::default();
                Decoder::new(&layout).unwrap().decode(&[&bytes], &mut decoded).unwrap();
                assert_eq!(decoded.size(), size);
                for (x, y) in [(5, 5), (40, 9), (60, 44)] {
                    let at = |image: &ColorImage, by: u32| {
                        let at = 3 * (y * by * image.width + x * by) as usize;
                        [0, 1, 2].map(|channel| i32::from(image.rgb[at + channel]))
                    };
                    let (one, other) = (at(&picture, 1), at(&decoded, size.0 / 64));
                    let far = one.iter().zip(other).map(|(one, other)| (one - other).abs()).max().unwrap();
                    assert!(far <= 9, "{} {size:?} at {x},{y}: {one:?} became {other:?}", FourCc(*fourcc));
                }
            }
        }
    }

    #[test]
    fn a_format_is_one_number() {
        let format = Format { fourcc: *b"MJPG", size: (3840, 2160) };
        assert_eq!(Format::unpack(format.pack()), format);
    }

    #[test]
    fn only_what_can_be_written_is_offered() {
        let mode = |fourcc: &[u8; 4], sizes| Mode { fourcc: *fourcc, sizes, rates: Offer::Unknown };
        let offered = writable_modes(&[
            mode(b"GREY", Offer::These(vec![(640, 480)])),
            mode(b"MJPG", Offer::These(vec![(640, 480), (10_000, 8)])),
            mode(b"NV12", Offer::Range { min: (1, 1), max: (1 << 31, 1 << 31) }),
            mode(b"YUYV", Offer::These(vec![(10_000, 8)])),
            // Ranges that lie outside of the bounds as a whole.
            mode(b"UYVY", Offer::Range { min: (8000, 4000), max: (10_000, 5000) }),
            mode(b"YVYU", Offer::Range { min: (1, 1), max: (640, 8) }),
        ]);
        let expected = [
            mode(b"MJPG", Offer::These(vec![(640, 480)])),
            mode(b"NV12", Offer::Range { min: (16, 16), max: (4096, 4096) }),
        ];
        assert_eq!(offered, expected);
    }
}
