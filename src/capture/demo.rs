//! The demonstration: a short loop of the project's own scene with its depth, which is in the program itself.
//!
//! `recordings/make.rs` renders it, anti-aliased. `color.mjpeg` and `depth.mpng` are JPEGs and PNGs, one after the other:
//! first a whole picture, then for each frame the tiles that ever change, side by side; `moving.png` says which those are.
//! Each is decoded when it is first shown, and kept: from the second round on, playing is copying.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};

use super::{Brings, Camera, CaptureError, Captured, Shot, SourceInfo};
use crate::frame::Stamp;

/// What the command line calls it.
pub const NAME: &str = "demo";
/// Width and height of its pictures.
pub const SIZE_PX: (u32, u32) = (640, 360);
/// Its frame rate.
pub const FRAMES_PER_SECOND: u32 = 24;
/// Frames of the loop.
pub const FRAMES: u32 = 48;
/// Side of a tile: a block of a JPEG, so that tiles beside each other do not mix.
pub const TILE_PX: u32 = 8;
/// What the lowest and the highest level of depth stand for.
const RANGE_M: [f32; 2] = [13.0, 0.44];

const COLOR: &[u8] = include_bytes!("../../recordings/demo/color.mjpeg");
const DEPTH: &[u8] = include_bytes!("../../recordings/demo/depth.mpng");
const MOVING: &[u8] = include_bytes!("../../recordings/demo/moving.png");
/// What each picture of them begins with.
const JPEG: &[u8] = &[0xff, 0xd8, 0xff];
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Plays the demonstration, again and again.
pub struct Demo {
    layout: Layout,
    /// The pictures of each file.
    color: Vec<&'static [u8]>,
    depth: Vec<&'static [u8]>,
    whole: Part,
    /// What changes in each frame, once it was shown.
    tiles: Vec<Option<Part>>,
    /// What each level of depth stands for.
    metres: [f32; 256],
    /// Frames until the end.
    frames: Option<u64>,
    position: u64,
}

/// A picture, or tiles of one.
struct Part {
    rgb: Vec<u8>,
    levels: Vec<u8>,
}

/// Where the tiles are that ever change.
pub struct Layout {
    /// Column and row of the first pixel of each.
    moving: Vec<[u32; 2]>,
}

impl Layout {
    /// A layout for the tiles that `moves` is true for, row by row.
    pub fn new(moves: impl IntoIterator<Item = bool>) -> Self {
        let columns = SIZE_PX.0 / TILE_PX;
        let places = (0..).map(|tile| [tile % columns * TILE_PX, tile / columns * TILE_PX]);
        Self { moving: places.zip(moves).filter(|(_, moves)| *moves).map(|(place, _)| place).collect() }
    }

    /// Width and height in pixels of the tiles of a frame, side by side.
    pub fn size_px(&self) -> (u32, u32) {
        (SIZE_PX.0, (self.moving.len() as u32).div_ceil(SIZE_PX.0 / TILE_PX) * TILE_PX)
    }

    /// The rows of the tiles, [`TILE_PX`] pixels each: numbers of their first pixels among the tiles and in the picture.
    pub fn runs(&self) -> impl Iterator<Item = [usize; 2]> {
        let width = SIZE_PX.0;
        self.moving.iter().zip(0..).flat_map(move |(&[column, row], tile)| {
            let start = TILE_PX * tile;
            let (from_column, from_row) = (start % width, start / width * TILE_PX);
            (0..TILE_PX).map(move |y| {
                [(from_row + y) * width + from_column, (row + y) * width + column].map(|pixel| pixel as usize)
            })
        })
    }
}

/// The level that a depth is kept as: even steps of inverse depth, 0.0086 per metre.
pub fn level(z_m: f32) -> u8 {
    let [far, near] = RANGE_M.map(f32::recip);
    ((z_m.recip() - far) / (near - far) * 255.0).round() as u8
}

/// The depth that a level stands for, in metres.
pub fn metres(level: u8) -> f32 {
    let [far, near] = RANGE_M.map(f32::recip);
    (far + (near - far) * f32::from(level) / 255.0).recip()
}

impl Demo {
    /// The demonstration, for so many frames, or without end.
    ///
    /// # Errors
    /// It cannot be decoded: the program is damaged.
    pub fn new(frames: Option<u64>) -> Result<Self, CaptureError> {
        let moving = decoded(MOVING, ImageFormat::Png)?.into_luma8();
        let layout = Layout::new(moving.iter().map(|&moves| moves != 0));
        let [color, depth] = [(COLOR, JPEG), (DEPTH, PNG)].map(|(file, begin)| pictures(file, begin));
        if [&color, &depth].iter().any(|pictures| pictures.len() != 1 + FRAMES as usize) {
            return Err(CaptureError::Demo("pictures are missing".into()));
        }
        let whole = Part::decode(color[0], depth[0], SIZE_PX)?;
        let tiles = (0..FRAMES).map(|_| None).collect();
        let metres = std::array::from_fn(|level| metres(level as u8));
        Ok(Self { layout, color, depth, whole, tiles, metres, frames, position: 0 })
    }

    fn at_end(&self) -> bool {
        self.frames.is_some_and(|frames| self.position >= frames)
    }
}

impl Part {
    fn decode(color: &[u8], depth: &[u8], size_px: (u32, u32)) -> Result<Self, CaptureError> {
        let rgb = decoded(color, ImageFormat::Jpeg)?.into_rgb8();
        let levels = decoded(depth, ImageFormat::Png)?.into_luma8();
        if [rgb.dimensions(), levels.dimensions()] != [size_px; 2] {
            return Err(CaptureError::Demo("a picture has the wrong size".into()));
        }
        Ok(Self { rgb: rgb.into_raw(), levels: levels.into_raw() })
    }
}

/// The pictures of a file, each of which begins like this.
fn pictures(file: &'static [u8], begin: &[u8]) -> Vec<&'static [u8]> {
    let mut starts: Vec<usize> = (0..file.len()).filter(|&at| file[at..].starts_with(begin)).collect();
    starts.push(file.len());
    starts.windows(2).map(|pair| &file[pair[0]..pair[1]]).collect()
}

fn decoded(file: &[u8], format: ImageFormat) -> Result<DynamicImage, CaptureError> {
    let decoded = ImageReader::with_format(Cursor::new(file), format).decode();
    decoded.map_err(|error| CaptureError::Demo(error.to_string()))
}

fn time_ns(position: u64) -> u64 {
    (position as f64 / f64::from(FRAMES_PER_SECOND) * 1e9).round() as u64
}

impl Camera for Demo {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: NAME.into(),
            size: SIZE_PX,
            period_ns: time_ns(1),
            frames: self.frames,
            live: false,
            brings: Brings::Depth,
        }
    }

    fn next(&mut self, Shot { color, depth, .. }: Shot) -> Result<Captured, CaptureError> {
        if self.at_end() {
            return Ok(Captured::End);
        }
        let Self { layout, whole, .. } = self;
        let frame = (self.position % u64::from(FRAMES)) as usize;
        let tiles = match &mut self.tiles[frame] {
            Some(tiles) => tiles,
            none => none.insert(Part::decode(self.color[1 + frame], self.depth[1 + frame], layout.size_px())?),
        };
        let set = |to: &mut [f32], levels: &[u8]| {
            to.iter_mut().zip(levels).for_each(|(to, &level)| *to = self.metres[usize::from(level)]);
        };
        color.resize(SIZE_PX.0, SIZE_PX.1);
        depth.resize(SIZE_PX.0, SIZE_PX.1);
        color.rgb.copy_from_slice(&whole.rgb);
        set(&mut depth.metres, &whole.levels);
        let side = TILE_PX as usize;
        for [from, to] in layout.runs() {
            color.rgb[3 * to..3 * (to + side)].copy_from_slice(&tiles.rgb[3 * from..3 * (from + side)]);
            set(&mut depth.metres[to..to + side], &tiles.levels[from..from + side]);
        }
        let stamp = Stamp { index: self.position as usize, time_ns: time_ns(self.position), captured_ns: None };
        self.position += 1;
        Ok(Captured::Frame(stamp))
    }

    fn skip(&mut self, until_ns: u64) -> u64 {
        let from = self.position;
        while !self.at_end() && time_ns(self.position) < until_ns {
            self.position += 1;
        }
        self.position - from
    }
}
