//! The demonstration: a short, built-in loop of the project's own scene with its depth.
//!
//! `crates/lab/examples/make_recordings` renders it, anti-aliased. `color.mjpeg` and `depth.mpng` are concatenated JPEGs and PNGs: first
//! a full picture, then for each frame the tiles that ever change, packed side by side; `moving.png` marks these tiles.
//! Each picture is decoded when it is first shown, and cached: from the second round on, playing only copies.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};

use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam::frame::Stamp;

/// Name on the command line.
pub const NAME: &str = "demo";
/// Width and height of its pictures.
pub const SIZE_PX: (u32, u32) = (640, 360);
/// Frame rate.
pub const FRAMES_PER_SECOND: u32 = 24;
/// Number of frames in the loop.
pub const FRAMES: u32 = 48;
/// Side of a tile: a JPEG block, so that neighbouring tiles do not mix.
pub const TILE_PX: u32 = 8;
/// Depths of the lowest and the highest level, in metres.
const RANGE_M: [f32; 2] = [13.0, 0.44];

const COLOR: &[u8] = include_bytes!("../../../../recordings/demo/color.mjpeg");
const DEPTH: &[u8] = include_bytes!("../../../../recordings/demo/depth.mpng");
const MOVING: &[u8] = include_bytes!("../../../../recordings/demo/moving.png");
/// Signatures at which the files are split into pictures.
const JPEG_SIGNATURE: &[u8] = &[0xff, 0xd8, 0xff];
const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Plays the demonstration in a loop.
pub struct Demo {
    layout: Layout,
    /// The encoded pictures of each file.
    color: Vec<&'static [u8]>,
    depth: Vec<&'static [u8]>,
    base: Pixels,
    /// The tiles of each frame, once it was shown.
    tiles: Vec<Option<Pixels>>,
    /// The depth of each level, in metres.
    metres: [f32; 256],
    /// Number of frames until the end.
    frames: Option<u64>,
    position: u64,
}

/// The colours and depth levels of a picture, or of its tiles.
struct Pixels {
    rgb: Vec<u8>,
    levels: Vec<u8>,
}

/// The positions of the tiles that ever change.
pub struct Layout {
    /// Column and row of each tile's first pixel.
    moving: Vec<[u32; 2]>,
}

impl Layout {
    /// Creates a layout of the tiles for which `moves` is true, in raster order.
    pub fn new(moves: impl IntoIterator<Item = bool>) -> Self {
        let columns = SIZE_PX.0 / TILE_PX;
        let places = (0..).map(|tile| [tile % columns * TILE_PX, tile / columns * TILE_PX]);
        Self { moving: places.zip(moves).filter(|(_, moves)| *moves).map(|(place, _)| place).collect() }
    }

    /// Width and height in pixels of the packed tiles of a frame.
    pub fn size_px(&self) -> (u32, u32) {
        (SIZE_PX.0, (self.moving.len() as u32).div_ceil(SIZE_PX.0 / TILE_PX) * TILE_PX)
    }

    /// Iterates over the rows of the tiles, [`TILE_PX`] pixels each: the indices of their first pixels among the packed
    /// tiles and in the picture.
    pub fn tile_rows(&self) -> impl Iterator<Item = [usize; 2]> {
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

/// Quantizes a depth in metres to a level: uniform steps of inverse depth, 0.0086 per metre.
pub fn quantize_depth(z_m: f32) -> u8 {
    let [far, near] = RANGE_M.map(f32::recip);
    ((z_m.recip() - far) / (near - far) * 255.0).round() as u8
}

/// Returns the depth of a level, in metres.
fn depth_of_level_m(level: u8) -> f32 {
    let [far, near] = RANGE_M.map(f32::recip);
    (far + (near - far) * f32::from(level) / 255.0).recip()
}

impl Demo {
    /// Creates the demonstration, for this number of frames, or endless.
    ///
    /// # Errors
    /// It cannot be decoded: the program is damaged.
    pub fn new(frames: Option<u64>) -> Result<Self, CaptureError> {
        let moving = decode_image(MOVING, ImageFormat::Png)?.into_luma8();
        let layout = Layout::new(moving.iter().map(|&moves| moves != 0));
        let [color, depth] =
            [(COLOR, JPEG_SIGNATURE), (DEPTH, PNG_SIGNATURE)].map(|(file, signature)| split_pictures(file, signature));
        if [&color, &depth].iter().any(|pictures| pictures.len() != 1 + FRAMES as usize) {
            return Err(CaptureError::Demo("pictures are missing".into()));
        }
        let base = Pixels::decode(color[0], depth[0], SIZE_PX)?;
        let tiles = (0..FRAMES).map(|_| None).collect();
        let metres = std::array::from_fn(|level| depth_of_level_m(level as u8));
        Ok(Self { layout, color, depth, base, tiles, metres, frames, position: 0 })
    }

    fn is_at_end(&self) -> bool {
        self.frames.is_some_and(|frames| self.position >= frames)
    }
}

impl Pixels {
    fn decode(color: &[u8], depth: &[u8], size_px: (u32, u32)) -> Result<Self, CaptureError> {
        let rgb = decode_image(color, ImageFormat::Jpeg)?.into_rgb8();
        let levels = decode_image(depth, ImageFormat::Png)?.into_luma8();
        if [rgb.dimensions(), levels.dimensions()] != [size_px; 2] {
            return Err(CaptureError::Demo("a picture has the wrong size".into()));
        }
        Ok(Self { rgb: rgb.into_raw(), levels: levels.into_raw() })
    }
}

/// Splits a file into its pictures, each of which begins with a signature.
fn split_pictures(file: &'static [u8], signature: &[u8]) -> Vec<&'static [u8]> {
    let mut starts: Vec<usize> = (0..file.len()).filter(|&at| file[at..].starts_with(signature)).collect();
    starts.push(file.len());
    starts.windows(2).map(|pair| &file[pair[0]..pair[1]]).collect()
}

fn decode_image(file: &[u8], format: ImageFormat) -> Result<DynamicImage, CaptureError> {
    let decoded = ImageReader::with_format(Cursor::new(file), format).decode();
    decoded.map_err(|error| CaptureError::Demo(error.to_string()))
}

fn frame_time_ns(position: u64) -> u64 {
    (position as f64 / f64::from(FRAMES_PER_SECOND) * 1e9).round() as u64
}

impl Camera for Demo {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: NAME.into(),
            size: SIZE_PX,
            period_ns: frame_time_ns(1),
            frames: self.frames,
            live: false,
            frame_data: FrameData::Depth,
        }
    }

    fn next(&mut self, FrameBuffers { color, depth, .. }: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.is_at_end() {
            return Ok(Captured::End);
        }
        let Self { layout, base, .. } = self;
        let frame = (self.position % u64::from(FRAMES)) as usize;
        let tiles = match &mut self.tiles[frame] {
            Some(tiles) => tiles,
            none => none.insert(Pixels::decode(self.color[1 + frame], self.depth[1 + frame], layout.size_px())?),
        };
        let copy_depth = |to: &mut [f32], levels: &[u8]| {
            to.iter_mut().zip(levels).for_each(|(to, &level)| *to = self.metres[usize::from(level)]);
        };
        color.resize(SIZE_PX.0, SIZE_PX.1);
        depth.resize(SIZE_PX.0, SIZE_PX.1);
        // Only the moving tiles are stored per frame; everything else comes from the base picture.
        color.rgb.copy_from_slice(&base.rgb);
        copy_depth(&mut depth.metres, &base.levels);
        let side = TILE_PX as usize;
        for [from, to] in layout.tile_rows() {
            color.rgb[3 * to..3 * (to + side)].copy_from_slice(&tiles.rgb[3 * from..3 * (from + side)]);
            copy_depth(&mut depth.metres[to..to + side], &tiles.levels[from..from + side]);
        }
        let stamp = Stamp { index: self.position as usize, time_ns: frame_time_ns(self.position), captured_ns: None };
        self.position += 1;
        Ok(Captured::Frame(stamp))
    }

    fn skip_until(&mut self, until_ns: u64) -> u64 {
        let from = self.position;
        while !self.is_at_end() && frame_time_ns(self.position) < until_ns {
            self.position += 1;
        }
        self.position - from
    }
}
