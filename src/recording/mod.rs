//! Recordings on disk, read and written frame by frame; and single pictures ([`still`], [`snapshot`]).
//!
//! A [`Recording`] is opened by its folder, and its layout is recognised by its content. [`tum`] is the layout that
//! is read and written; `kitti`, `euroc` and `middlebury` are read, and have two eyes.

pub mod geometry;
pub mod snapshot;
pub mod still;
pub mod tum;

mod calib;
mod coded;
mod contents;
mod decode;
mod encode;
mod error;
mod euroc;
mod extras;
mod fault;
mod jpeg;
mod kitti;
mod list;
mod middlebury;
mod pair;
mod pfm;
mod samples;
mod timeline;
mod unit;
mod xmp;

use std::collections::HashSet;
use std::path::Path;

pub use decode::Scratch;
pub use error::RecordingError;
pub use extras::Extras;
pub use fault::{GeometryFault, LineFault, PictureFault};

use crate::calibration::StereoCalibration;
use crate::frame::{ColorImage, DepthMap, GrayImage};
use crate::optics::StereoRig;
use contents::{DepthForm, Folder, Layout, Source};

/// The layouts that are read, in the order in which they are looked for.
const LAYOUTS: [Layout; 4] = [tum::LAYOUT, euroc::LAYOUT, kitti::LAYOUT, middlebury::LAYOUT];

/// Pictures with more columns or rows are refused by their header, before memory is allocated. Reading the largest
/// takes at most four times the 192 MiB of its RGB.
const MAX_SIDE_PX: u32 = 8192;

/// What the numbers of depth pictures are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthUnit {
    /// Distances, in 16 bits.
    #[default]
    Metres,
    /// Relative inverse depth, in grey pictures of any kind, from 0 to the largest number they can have.
    Inverse {
        /// Whether white is the farthest instead of the nearest.
        white_is_far: bool,
    },
}

/// How to read a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Units of the depth pictures per metre, > 0.
    pub depth_scale: f32,
    /// What the numbers of depth pictures are.
    pub depth_unit: DepthUnit,
    /// A depth value that means unknown; 0 always does.
    pub depth_invalid: Option<u16>,
    /// Largest difference in time between a colour picture and its depth map or right picture, in nanoseconds.
    pub pair_tolerance_ns: u64,
    /// Whether faulty lines of the lists become frames that fail to read, and so do right pictures that are missing.
    /// Otherwise the first one fails [`Recording::open`].
    pub keep_going: bool,
}

impl Default for Options {
    /// As in the TUM benchmark: 5000 units per metre, pairs within 20 ms. Faulty lists are refused.
    fn default() -> Self {
        Self {
            depth_scale: tum::DEPTH_SCALE,
            depth_unit: DepthUnit::Metres,
            depth_invalid: None,
            pair_tolerance_ns: 20_000_000,
            keep_going: false,
        }
    }
}

/// Listed pictures that belong to no frame, since no partner is near enough in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unpaired {
    /// Colour pictures.
    pub color: usize,
    /// Depth maps.
    pub depth: usize,
    /// Pictures of the right eye.
    pub right: usize,
}

/// Stereo geometry of a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum Pair {
    /// The pictures are rectified, and this is their geometry.
    Rectified(StereoRig),
    /// The pictures are as the cameras took them; with this they can be rectified.
    Raw(Box<StereoCalibration>),
    /// The recording has no calibration.
    Unstated,
}

/// An opened recording: its lists are in memory (some 300 bytes a frame), its pictures are read one by one when asked
/// for, into memory that the caller keeps.
///
/// Where there is depth, the frames are the pairs of a colour picture and a depth map, and where there are two eyes
/// those of a left and a right picture; [`Recording::unpaired`] counts what is left over.
#[derive(Debug)]
pub struct Recording {
    layout: &'static str,
    folder: Folder,
    frames: Vec<Frame>,
    size: (u32, u32),
    period_ns: u64,
    depth: Option<DepthForm>,
    pair: Option<Pair>,
    disparities: Option<u32>,
    unpaired: Unpaired,
}

/// A frame whose pictures are still on the disk.
#[derive(Debug)]
struct Frame {
    time_ns: u64,
    color: Source,
    right: Option<Source>,
    depth: Option<Source>,
}

impl Recording {
    /// Opens the recording in the folder `dir`. Reads its lists, and of its pictures the headers it needs.
    ///
    /// # Errors
    /// The folder is no recording, or a list is missing or empty; no depth map or right picture pairs with a colour
    /// picture; the calibration is faulty; the depth scale is not a number > 0; no colour picture can be read (the
    /// fault of the first is given). Without `keep_going`, any faulty line of a list, and a missing right picture.
    pub fn open(dir: &Path, options: &Options) -> Result<Self, RecordingError> {
        check_depth_scale(options.depth_scale)?;
        let root = dir.canonicalize().map_err(RecordingError::io("open the recording", dir))?;
        let folder = Folder { dir: dir.to_owned(), root };
        let not_a_recording = || RecordingError::NotARecording { dir: dir.to_owned(), looked_for: looked_for() };
        let layout = LAYOUTS.iter().find(|layout| (layout.is_in)(dir)).ok_or_else(not_a_recording)?;
        let contents = (layout.open)(&folder, options)?;

        let size = first_size(&folder, contents.frames.iter().map(|frame| &frame.color))?;
        let times_ns: Vec<_> = contents.frames.iter().map(|frame| frame.time_ns).collect();
        let listed = contents.frames.into_iter().zip(timeline::fill(&times_ns));
        let frames: Vec<_> = listed
            .map(|(frame, time_ns)| Frame { time_ns, color: frame.color, right: frame.right, depth: frame.depth })
            .collect();
        Ok(Self {
            layout: layout.name,
            folder,
            size,
            period_ns: timeline::median_period_ns(frames.iter().map(|frame| frame.time_ns)),
            frames,
            depth: contents.depth,
            pair: contents.pair,
            disparities: contents.disparities,
            unpaired: contents.unpaired,
        })
    }

    /// The name of the layout, such as `TUM RGB-D`.
    pub fn layout(&self) -> &'static str {
        self.layout
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

    /// Whether its depth is only relative.
    pub fn has_relative_depth(&self) -> bool {
        matches!(self.depth, Some(DepthForm::Inverse { .. }))
    }

    /// Whether its depth is in units that [`Options::depth_scale`] states.
    pub fn has_depth_in_units(&self) -> bool {
        matches!(self.depth, Some(DepthForm::Units(_)))
    }

    /// Whether the frames have depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// The stereo geometry, if the frames have a right picture.
    pub fn pair(&self) -> Option<&Pair> {
        self.pair.as_ref()
    }

    /// How many disparities to search, from 0, where the recording says so: a multiple of 16.
    pub fn disparities(&self) -> Option<u32> {
        self.disparities
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
        decode::color(&path, Some(self.size), scratch, into)
            .map(drop)
            .map_err(|fault| source.error(&self.folder.dir, fault))
    }

    /// Reads the depth of frame `index` in metres, 0 = unknown, into `into`. It covers the view of the colour picture
    /// with at most as many pixels.
    ///
    /// # Errors
    /// As [`Recording::read_color`]; also where the recording has no depth.
    pub fn read_depth(&self, index: usize, scratch: &mut Scratch, into: &mut DepthMap) -> Result<(), RecordingError> {
        let no_depth = || RecordingError::NoDepth { dir: self.folder.dir.clone() };
        let form = self.depth.as_ref().ok_or_else(no_depth)?;
        let frame = self.frame(index)?;
        // Without a depth map, the line of the colour picture is at fault.
        let source = frame.depth.as_ref().unwrap_or(&frame.color);
        let path = self.folder.locate(source)?;
        let read = match form {
            DepthForm::Units(units) => decode::depth(&path, *units, Some(self.size), scratch, into),
            DepthForm::Inverse { white_is_far } => {
                decode::inverse_depth(&path, *white_is_far, self.size, scratch, into)
            }
            DepthForm::Disparity(rig) => pfm::read_disparity_as_depth(&path, rig, self.size, scratch, into),
        };
        read.map_err(|fault| source.error(&self.folder.dir, fault))
    }

    /// Reads the right picture of frame `index`, of [`Recording::size`], as luma into `into`.
    ///
    /// # Errors
    /// As [`Recording::read_color`]; also where the recording has one eye only.
    pub fn read_right(&self, index: usize, scratch: &mut Scratch, into: &mut GrayImage) -> Result<(), RecordingError> {
        let one_eye = || RecordingError::NoRight { dir: self.folder.dir.clone() };
        let frame = self.frame(index)?;
        self.pair.as_ref().ok_or_else(one_eye)?;
        // Without a right picture, the line of the left one is at fault.
        let source = frame.right.as_ref().unwrap_or(&frame.color);
        let path = self.folder.locate(source)?;
        decode::right_luma(&path, self.size, scratch, into).map_err(|fault| source.error(&self.folder.dir, fault))
    }

    fn frame(&self, index: usize) -> Result<&Frame, RecordingError> {
        self.frames.get(index).ok_or(RecordingError::NoSuchFrame { index, len: self.frames.len() })
    }
}

/// The files that make a folder a recording, for each layout: for messages.
fn looked_for() -> String {
    LAYOUTS.map(|layout| format!("{} ({})", layout.looked_for, layout.name)).join(", ")
}

/// The size of the first colour picture that has a readable header; if none has, what is wrong with the first.
fn first_size<'a>(folder: &Folder, colors: impl Iterator<Item = &'a Source>) -> Result<(u32, u32), RecordingError> {
    let mut first_error = None;
    // A list may name one unreadable file many times: it is opened once.
    let mut unreadable = HashSet::new();
    for source in colors {
        let size = folder.locate(source).and_then(|path| {
            if unreadable.contains(&path) {
                return Ok(None);
            }
            let header = decode::header(&path).map_err(|fault| source.error(&folder.dir, fault));
            unreadable.insert(path);
            header.map(|(size, _)| Some(size))
        });
        match size {
            Ok(Some(size)) => return Ok(size),
            Ok(None) => {}
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    Err(first_error.unwrap_or_else(|| RecordingError::EmptyList { list: folder.dir.clone() }))
}

/// Whether a depth map of these columns and rows covers the view of a colour picture of these: it is not larger and has the
/// same aspect, within a pixel.
pub fn depth_covers(depth: (u32, u32), color: (u32, u32)) -> bool {
    let (depth_width, depth_height) = (u64::from(depth.0), u64::from(depth.1));
    let (width, height) = (u64::from(color.0), u64::from(color.1));
    // Cross-multiplied aspect ratios: one pixel of the depth map changes them by at most the longer colour side.
    let skew = (depth_width * height).abs_diff(depth_height * width);
    (1..=width).contains(&depth_width) && (1..=height).contains(&depth_height) && skew <= width.max(height)
}

fn check_depth_scale(depth_scale: f32) -> Result<(), RecordingError> {
    if depth_scale > 0.0 && depth_scale.is_finite() { Ok(()) } else { Err(RecordingError::DepthScale(depth_scale)) }
}
