//! The demonstration: a short loop of the project's own scene with its depth, which is in the program itself.
//!
//! `recordings/make.rs` renders it, anti-aliased, into three files. `color.jpg` and `depth.png` are sheets of one layout: on
//! top a whole picture, and below it, frame by frame, the tiles that ever change; `moving.png` says which those are. They
//! are decoded once, so that playing is copying.

use std::io::Cursor;
use std::thread;

use image::{DynamicImage, ImageFormat, ImageReader};

use super::{Brings, Camera, CaptureError, Captured, Shot, SourceInfo};
use crate::frame::Stamp;

/// What the command line calls it.
pub const NAME: &str = "demo";
/// Width and height of its pictures, and of the whole picture on top of a sheet.
pub const SIZE_PX: (u32, u32) = (640, 360);
/// Its frame rate.
pub const FRAMES_PER_SECOND: u32 = 24;
/// Frames of the loop.
pub const FRAMES: u32 = 48;
/// Side of a tile: a block of a JPEG, so that tiles beside each other on a sheet do not mix.
pub const TILE_PX: u32 = 8;
/// What the lowest and the highest level of depth stand for.
const RANGE_M: [f32; 2] = [13.0, 0.44];

const COLOR: &[u8] = include_bytes!("../../recordings/demo/color.jpg");
const DEPTH: &[u8] = include_bytes!("../../recordings/demo/depth.png");
const MOVING: &[u8] = include_bytes!("../../recordings/demo/moving.png");

/// Plays the demonstration, again and again.
pub struct Demo {
    layout: Layout,
    /// The sheet of colours, RGB.
    rgb: Vec<u8>,
    /// The sheet of depth.
    levels: Vec<u8>,
    /// What each level stands for.
    metres: [f32; 256],
    /// Frames until the end.
    frames: Option<u64>,
    position: u64,
}

/// Where things are on a sheet, which is as wide as the picture.
pub struct Layout {
    /// Column and row of the first pixel of each tile that ever changes.
    moving: Vec<[u32; 2]>,
}

impl Layout {
    /// A layout for the tiles that `moves` is true for, row by row.
    pub fn new(moves: impl IntoIterator<Item = bool>) -> Self {
        let columns = SIZE_PX.0 / TILE_PX;
        let places = (0..).map(|tile| [tile % columns * TILE_PX, tile / columns * TILE_PX]);
        Self { moving: places.zip(moves).filter(|(_, moves)| *moves).map(|(place, _)| place).collect() }
    }

    /// Rows of pixels that the tiles of a frame take.
    fn frame_px(&self) -> u32 {
        (self.moving.len() as u32).div_ceil(SIZE_PX.0 / TILE_PX) * TILE_PX
    }

    /// Rows of pixels of a sheet.
    pub fn height_px(&self) -> u32 {
        SIZE_PX.1 + FRAMES * self.frame_px()
    }

    /// The rows of a frame's tiles, [`TILE_PX`] pixels each: numbers of their first pixels on the sheet and in the picture.
    pub fn runs(&self, frame: u32) -> impl Iterator<Item = [usize; 2]> {
        let (width, top) = (SIZE_PX.0, SIZE_PX.1 + frame * self.frame_px());
        self.moving.iter().zip(0..).flat_map(move |(&[column, row], tile)| {
            let start = TILE_PX * tile;
            let (from_column, from_row) = (start % width, top + start / width * TILE_PX);
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
        let (rgb, levels) = thread::scope(|scope| {
            let levels = scope.spawn(|| decoded(DEPTH, ImageFormat::Png));
            (decoded(COLOR, ImageFormat::Jpeg), levels.join())
        });
        let levels = levels.map_err(|_| CaptureError::Demo("its depth".into()))?;
        let (rgb, levels) = (rgb?.into_rgb8(), levels?.into_luma8());
        let moving = decoded(MOVING, ImageFormat::Png)?.into_luma8();
        let layout = Layout::new(moving.iter().map(|&moves| moves != 0));
        let expected = (SIZE_PX.0, layout.height_px());
        if rgb.dimensions() != expected || levels.dimensions() != expected {
            return Err(CaptureError::Demo("its files do not fit each other".into()));
        }
        let metres = std::array::from_fn(|level| metres(level as u8));
        Ok(Self { layout, rgb: rgb.into_raw(), levels: levels.into_raw(), metres, frames, position: 0 })
    }

    fn at_end(&self) -> bool {
        self.frames.is_some_and(|frames| self.position >= frames)
    }
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
        color.resize(SIZE_PX.0, SIZE_PX.1);
        depth.resize(SIZE_PX.0, SIZE_PX.1);
        let (pixels, tile) = (depth.metres.len(), TILE_PX as usize);
        color.rgb.copy_from_slice(&self.rgb[..3 * pixels]);
        let set = |to: &mut [f32], levels: &[u8]| {
            to.iter_mut().zip(levels).for_each(|(to, &level)| *to = self.metres[usize::from(level)]);
        };
        set(&mut depth.metres, &self.levels[..pixels]);
        for [from, to] in self.layout.runs((self.position % u64::from(FRAMES)) as u32) {
            color.rgb[3 * to..3 * (to + tile)].copy_from_slice(&self.rgb[3 * from..3 * (from + tile)]);
            set(&mut depth.metres[to..to + tile], &self.levels[from..from + tile]);
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
