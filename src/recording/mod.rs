//! Recordings on disk, read and written frame by frame; and single pictures ([`still`]).
//!
//! A [`Recording`] is opened by its folder, and its layout is recognised by its content. [`tum`] is the layout that
//! is read and written.

pub mod still;
pub mod tum;

mod decode;
mod encode;
mod error;
mod pfm;
mod timeline;
mod whole;

use std::path::{Path, PathBuf};

pub use decode::Scratch;
pub use error::{LineFault, PictureFault, RecordingError};

use crate::frame::{ColorImage, DepthMap};
use decode::DepthUnits;

/// Pictures with more columns or rows are refused from their header, before memory is taken for them.
const MAX_SIDE_PX: u32 = 8192;

/// How to read a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Units of the depth pictures per metre, > 0.
    pub depth_scale: f32,
    /// A depth value that means unknown; 0 always does.
    pub depth_invalid: Option<u16>,
    /// Largest difference in time between a colour picture and its depth map, in nanoseconds.
    pub pair_tolerance_ns: u64,
    /// Whether faulty lines of the lists become frames that fail to read. Otherwise the first one fails
    /// [`Recording::open`].
    pub keep_going: bool,
}

impl Default for Options {
    /// As in the TUM benchmark: 5000 units per metre, pairs within 20 ms. Faulty lists are refused.
    fn default() -> Self {
        Self { depth_scale: tum::DEPTH_SCALE, depth_invalid: None, pair_tolerance_ns: 20_000_000, keep_going: false }
    }
}

/// What the lists name and no frame has, for want of a partner near enough in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unpaired {
    /// Colour pictures.
    pub color: usize,
    /// Depth maps.
    pub depth: usize,
}

/// An opened recording: its lists are in memory (some 300 bytes a frame), its pictures are read one by one when asked
/// for, into memory that the caller keeps.
///
/// Where there is depth, the frames are the pairs of a colour picture and a depth map; [`Recording::unpaired`] counts
/// what is left over.
#[derive(Debug)]
pub struct Recording {
    folder: Folder,
    frames: Vec<Frame>,
    size: (u32, u32),
    period_ns: u64,
    units: DepthUnits,
    has_depth: bool,
    unpaired: Unpaired,
}

/// The folder of a recording.
#[derive(Debug)]
struct Folder {
    /// As it was named: for messages.
    dir: PathBuf,
    /// With every link resolved: no picture may lie outside it.
    root: PathBuf,
}

/// A frame whose pictures are still on the disk.
#[derive(Debug)]
struct Frame {
    time_ns: u64,
    color: Source,
    depth: Option<Source>,
}

/// A picture, and where it is named.
#[derive(Debug)]
struct Source {
    list: &'static str,
    line: u32,
    /// Relative to the folder.
    file: Result<PathBuf, LineFault>,
}

impl Recording {
    /// Opens the recording in the folder `dir`. Reads its lists, and of its pictures the headers it needs.
    ///
    /// # Errors
    /// The folder is no recording, or a list is missing or empty; no depth map pairs with a colour picture; the depth
    /// scale is not a number > 0; no colour picture can be read (the fault of the first is given). Without
    /// `keep_going`, any faulty line of a list.
    pub fn open(dir: &Path, options: &Options) -> Result<Self, RecordingError> {
        check_depth_scale(options.depth_scale)?;
        let root = dir.canonicalize().map_err(RecordingError::io("open the recording", dir))?;
        let folder = Folder { dir: dir.to_owned(), root };
        let contents = tum::open(&folder, options)?;

        let size = first_size(&folder, contents.frames.iter().map(|frame| &frame.color))?;
        let times_ns: Vec<_> = contents.frames.iter().map(|frame| frame.time_ns).collect();
        let listed = contents.frames.into_iter().zip(timeline::fill(&times_ns));
        let frames: Vec<_> =
            listed.map(|(frame, time_ns)| Frame { time_ns, color: frame.color, depth: frame.depth }).collect();
        Ok(Self {
            folder,
            size,
            period_ns: timeline::median_period_ns(frames.iter().map(|frame| frame.time_ns)),
            frames,
            units: DepthUnits { scale: options.depth_scale, invalid: options.depth_invalid },
            has_depth: contents.has_depth,
            unpaired: contents.unpaired,
        })
    }

    /// The name of the layout, such as `TUM RGB-D`.
    pub fn layout(&self) -> &'static str {
        tum::LAYOUT
    }

    /// Number of frames, those that will fail to read included.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is no frame. Never so for an opened recording.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Columns and rows of the colour pictures, in pixels: those of the first one with a readable header.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Time of frame `index` in nanoseconds after the first frame; strictly increasing. A frame whose own time cannot
    /// be used has one between its neighbours'.
    ///
    /// # Panics
    /// `index` is not below [`Recording::len`].
    pub fn time_ns(&self, index: usize) -> u64 {
        self.frames[index].time_ns
    }

    /// Median distance between frames in nanoseconds, > 0; that of 30 frames per second if there is only one.
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Whether the frames have depth.
    pub fn has_depth(&self) -> bool {
        self.has_depth
    }

    /// What is listed and belongs to no frame.
    pub fn unpaired(&self) -> Unpaired {
        self.unpaired
    }

    /// Reads the colour picture of frame `index`, of [`Recording::size`], into `into`.
    ///
    /// # Errors
    /// The picture is missing, of another size or kind, cut short or damaged, or outside the recording; its line in
    /// the list is faulty; there is no such frame. What `into` holds is then unspecified.
    pub fn read_color(&self, index: usize, scratch: &mut Scratch, into: &mut ColorImage) -> Result<(), RecordingError> {
        let source = &self.frame(index)?.color;
        let path = self.folder.locate(source)?;
        decode::color(&path, Some(self.size), scratch, into).map_err(|fault| source.wrong(&self.folder.dir, fault))
    }

    /// Reads the depth of frame `index` in metres, 0 = unknown, into `into`. It covers the view of the colour picture
    /// with at most as many pixels.
    ///
    /// # Errors
    /// As [`Recording::read_color`]; also where the recording has no depth.
    pub fn read_depth(&self, index: usize, scratch: &mut Scratch, into: &mut DepthMap) -> Result<(), RecordingError> {
        if !self.has_depth {
            return Err(RecordingError::NoDepth { dir: self.folder.dir.clone() });
        }
        let frame = self.frame(index)?;
        // Without a depth map, the line of the colour picture is at fault.
        let source = frame.depth.as_ref().unwrap_or(&frame.color);
        let path = self.folder.locate(source)?;
        decode::depth(&path, self.units, Some(self.size), scratch, into)
            .map_err(|fault| source.wrong(&self.folder.dir, fault))
    }

    fn frame(&self, index: usize) -> Result<&Frame, RecordingError> {
        self.frames.get(index).ok_or(RecordingError::NoSuchFrame { index, len: self.frames.len() })
    }
}

impl Folder {
    /// The path of a picture, with every link resolved.
    fn locate(&self, source: &Source) -> Result<PathBuf, RecordingError> {
        let path = self.root.join(source.file(&self.dir)?);
        // A path that cannot be resolved cannot be read either, and reading says why.
        let path = path.canonicalize().unwrap_or(path);
        if path.starts_with(&self.root) { Ok(path) } else { Err(source.wrong(&self.dir, PictureFault::Outside)) }
    }
}

impl Source {
    /// The file, or the fault of the line that should have named it.
    fn file(&self, dir: &Path) -> Result<&Path, RecordingError> {
        self.file.as_deref().map_err(|fault| RecordingError::Line {
            list: dir.join(self.list),
            line: self.line,
            fault: fault.clone(),
        })
    }

    /// The error that the picture has `fault`.
    fn wrong(&self, dir: &Path, fault: PictureFault) -> RecordingError {
        let file = self.file.clone().unwrap_or_default();
        RecordingError::Listed { list: dir.join(self.list), line: self.line, file, fault }
    }
}

/// The size of the first colour picture that has a readable header; if none has, what is wrong with the first.
fn first_size<'a>(folder: &Folder, colors: impl Iterator<Item = &'a Source>) -> Result<(u32, u32), RecordingError> {
    let mut scratch = Scratch::default();
    let mut first_error = None;
    for source in colors {
        let header = folder
            .locate(source)
            .and_then(|path| decode::header(&path, &mut scratch).map_err(|fault| source.wrong(&folder.dir, fault)));
        match header {
            Ok((size, _)) => return Ok(size),
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    Err(first_error.unwrap_or_else(|| RecordingError::EmptyList { list: folder.dir.clone() }))
}

/// A depth map covers the view of its colour picture when it is not larger and has the same aspect, within a pixel.
fn depth_covers(depth: (u32, u32), color: (u32, u32)) -> bool {
    let (depth_width, depth_height) = (u64::from(depth.0), u64::from(depth.1));
    let (width, height) = (u64::from(color.0), u64::from(color.1));
    let skew = (depth_width * height).abs_diff(depth_height * width);
    (1..=width).contains(&depth_width) && (1..=height).contains(&depth_height) && skew <= width.max(height)
}

fn check_depth_scale(depth_scale: f32) -> Result<(), RecordingError> {
    if depth_scale > 0.0 && depth_scale.is_finite() { Ok(()) } else { Err(RecordingError::DepthScale(depth_scale)) }
}
