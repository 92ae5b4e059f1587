//! The tracks of a file, and the blocks with their pictures.

use super::ebml;

const TRACK_NUMBER: u32 = 0xD7;
const TRACK_UID: u32 = 0x73C5;
const NAME: u32 = 0x536E;
const CODEC_ID: u32 = 0x86;
const CODEC_PRIVATE: u32 = 0x63A2;
const VIDEO: u32 = 0xE0;
const PIXEL_WIDTH: u32 = 0xB0;
const PIXEL_HEIGHT: u32 = 0xBA;

/// Where `BITMAPINFOHEADER` has the code of its pixel format.
const FOURCC_AT: usize = 16;

/// A picture in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// Its time in units of the file.
    pub ticks: u64,
    /// Position of the picture.
    pub at: u64,
    /// Bytes of the picture.
    pub length: u32,
}

/// A format of colour pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorFormat {
    Jpeg,
    Nv12,
    /// Pixels in a row, by the name of their [raw format](crate::recording::raw_image).
    Raw {
        name: &'static str,
        pixel_bytes: usize,
    },
}

/// A track.
#[derive(Debug, Default)]
pub(super) struct Track {
    pub number: u64,
    pub uid: u64,
    pub name: String,
    /// The pixel format as Windows names it, such as `MJPG`; the whole codec if it has none.
    pub format: String,
    /// Width and height as stated.
    pub size: (u32, u32),
    pub blocks: Vec<Block>,
}

impl Track {
    /// Parses the content of a `TrackEntry`.
    pub fn parse(content: &[u8]) -> Self {
        let (mut track, mut fourcc) = (Self::default(), None);
        for (id, content) in ebml::children(content) {
            match id {
                TRACK_NUMBER => track.number = ebml::big_endian(content),
                TRACK_UID => track.uid = ebml::big_endian(content),
                NAME => track.name = ebml::text(content),
                CODEC_ID => track.format = ebml::text(content),
                CODEC_PRIVATE => fourcc = content.get(FOURCC_AT..FOURCC_AT + 4).map(ebml::text),
                VIDEO => {
                    for (id, content) in ebml::children(content) {
                        let side = u32::try_from(ebml::big_endian(content)).unwrap_or(u32::MAX);
                        match id {
                            PIXEL_WIDTH => track.size.0 = side,
                            PIXEL_HEIGHT => track.size.1 = side,
                            _ => {}
                        }
                    }
                }
                _ => {}
            }
        }
        match &*track.format {
            "V_MS/VFW/FOURCC" => track.format = fourcc.unwrap_or_default(),
            "V_MJPEG" => track.format = "MJPG".to_owned(),
            _ => {}
        }
        track
    }

    /// Returns the format of its colour pictures; `None` if it is not read.
    pub fn color_format(&self) -> Option<ColorFormat> {
        match &*self.format {
            "MJPG" => Some(ColorFormat::Jpeg),
            "NV12" => Some(ColorFormat::Nv12),
            "YUY2" => Some(ColorFormat::Raw { name: "yuyv", pixel_bytes: 2 }),
            "BGRA" => Some(ColorFormat::Raw { name: "bgra8", pixel_bytes: 4 }),
            _ => None,
        }
    }

    /// Returns whether it has depth or infrared: 16 bits, big-endian.
    pub fn is_grey16(&self) -> bool {
        self.format == "b16g"
    }

    /// Returns its pictures in the order of their times, each time once.
    pub fn in_order(&self) -> Vec<Block> {
        let mut blocks = self.blocks.clone();
        blocks.sort_unstable_by_key(|block| (block.ticks, block.at));
        blocks.dedup_by_key(|block| block.ticks);
        blocks
    }
}
