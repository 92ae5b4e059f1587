//! Recordings on disk, read and written frame by frame, and single pictures ([`still`], [`snapshot`]).
//!
//! A [`Recording`] is opened by its folder; the content decides its layout. `tum` can be read and written; `kitti`,
//! `euroc` and `middlebury` can be read, and are stereo; `rgbd` and [`pictures`] are folders without lists; `mcap`
//! (which can be written), `record3d` and `kinect` are single files.

pub mod depth_file;
#[doc(hidden)]
pub mod embedded;
pub mod geometry;
pub mod mask_file;
mod mcap;
pub mod snapshot;
pub mod still;
mod tum;

mod calib;
mod coded;
mod color_space;
mod contents;
mod decode;
mod decoders;
mod depth;
mod encode;
mod error;
mod euroc;
mod fault;
mod file_kind;
mod folder;
mod frame_sequence;
mod heif;
mod image_resources;
mod jpeg;
mod kinect;
mod kitti;
mod list;
mod luma;
pub mod map_sequence;
mod middlebury;
mod options;
mod pair;
mod pfm;
mod photo;
mod photo_metadata;
pub mod pictures;
mod raw_image;
mod record3d;
mod rgbd;
mod role;
mod samples;
mod slow_search;
mod tiff_directory;
mod tiff_file;
mod tiff_form;
mod time;
mod timeline;
mod transparency;
mod unit;
mod upright;
mod writer;
mod xmp;

use std::path::Path;

pub use decode::Scratch;
pub use depth_file::{DepthUnit, covers as depth_covers};
pub use error::RecordingError;
pub use fault::{GeometryFault, LineFault, PictureFault};
pub use frame_sequence::RecordingSummary;
pub use options::Options;
use options::check_depth_scale;
pub use photo::Photo;
pub use photo_metadata::PhotoMetadata;
pub use writer::RecordingWriter;

use bokehcam::calibration::StereoCalibration;
use bokehcam::calibration::registration::Registration;
use bokehcam::frame::{ColorImage, GrayImage};
use bokehcam::optics::StereoRig;
use contents::{Contents, Layout, ListedFrame, RecordingFolder};

/// The supported layouts, in order of detection.
const LAYOUTS: [Layout; 9] = [
    mcap::LAYOUT,
    record3d::LAYOUT,
    kinect::LAYOUT,
    tum::LAYOUT,
    euroc::LAYOUT,
    kitti::LAYOUT,
    middlebury::LAYOUT,
    rgbd::LAYOUT,
    pictures::LAYOUT,
];

/// Maximum width and height; larger pictures are rejected by their header, before memory is allocated. Reading the
/// largest takes at most four times the 343 MiB of its RGB.
const MAX_SIDE_PX: u32 = 16384;
/// Maximum number of pixels: cameras have up to 102 megapixels.
const MAX_PIXELS: u64 = 120_000_000;

/// Maximum number of pictures in a recording: nine hours at 30 frames per second.
const MAX_ENTRIES: usize = 1_000_000;

/// Counts of listed pictures that belong to no frame, because no counterpart is near enough in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unpaired {
    /// Colour pictures.
    pub color: usize,
    /// Depth maps.
    pub depth: usize,
    /// Pictures of the right camera.
    pub right: usize,
}

impl Unpaired {
    /// Returns the counts where `frames` pairs were made of these counts of pictures and depth maps; zeros without depth.
    fn beside(frames: usize, color: usize, depth: Option<usize>) -> Self {
        depth.map_or(Self::default(), |depth| Self { color: color - frames, depth: depth - frames, right: 0 })
    }
}

/// The stereo geometry of a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum StereoGeometry {
    /// The pictures are rectified, with this geometry.
    Rectified(StereoRig),
    /// The pictures are not rectified; this calibration allows it.
    Raw(Box<StereoCalibration>),
    /// The recording has no calibration.
    Uncalibrated,
}

/// An opened recording: its lists are in memory (about 300 bytes per frame), its pictures are read on request, into
/// memory of the caller.
///
/// With depth, a frame is a pair of a colour picture and a depth map; with two cameras, of a left and a right picture.
/// [`Recording::unpaired`] counts the pictures without counterpart.
#[derive(Debug)]
pub struct Recording {
    layout: &'static str,
    folder: RecordingFolder,
    contents: Contents,
    /// Times of the frames.
    times_ns: Vec<u64>,
    size: (u32, u32),
    period_ns: u64,
    /// For depth of another camera's view.
    depth_registration: Option<Registration>,
    /// How depth of another aspect ratio is fitted.
    depth_fit: Option<depth_file::Fit>,
}

/// Returns whether a file is a recording by itself.
pub fn is_recording_file(path: &Path) -> bool {
    path.is_file() && [mcap::LAYOUT, record3d::LAYOUT, kinect::LAYOUT].iter().any(|layout| (layout.matches)(path))
}

impl Recording {
    /// Opens the recording in the folder or file `dir`, or the pictures of a pattern such as `DIR/IMG_%04d.jpg`. Reads
    /// its lists, and the headers of pictures where needed.
    ///
    /// # Errors
    /// The folder is not a recording, or a list is missing or empty; no depth map or right picture pairs with a colour
    /// picture; a calibration is faulty; the depth scale is not a number > 0; no colour picture is readable (reports
    /// the first). Without `keep_going` also any faulty line of a list, and a missing right picture.
    pub fn open(dir: &Path, options: &Options) -> Result<Self, RecordingError> {
        options.depth_scale.map_or(Ok(()), check_depth_scale)?;
        let (path, pattern_folder) = (dir, pictures::pattern_folder(dir));
        let dir = pattern_folder.unwrap_or(dir);
        let root = dir.canonicalize().map_err(RecordingError::io("open the recording", dir))?;
        let mut folder =
            RecordingFolder { dir: dir.to_owned(), root, maps_root: None, follow_links: options.follow_links };
        let not_a_recording = || RecordingError::NotARecording {
            dir: dir.to_owned(),
            expected_files: LAYOUTS.map(|layout| layout.describe_files()).join(", "),
        };
        let (layout, mut contents) = match pattern_folder {
            Some(_) => (&pictures::LAYOUT, pictures::open_pattern(&folder, path, options)?),
            None => {
                let layout = LAYOUTS.iter().find(|layout| (layout.matches)(dir)).ok_or_else(not_a_recording)?;
                (layout, (layout.open)(&folder, options)?)
            }
        };

        folder.maps_root = contents.maps_root.take();
        let sources = contents.frames.iter().map(|frame| &frame.color);
        let read_size = if contents.are_photos { decode::read_upright_size } else { decode::read_size };
        let size = contents::read_first_size(&folder, contents.container.as_deref(), sources, read_size)?;
        let times_ns: Vec<_> = contents.frames.iter().map(|frame| frame.time_ns).collect();
        let times_ns = timeline::interpolate_times(&times_ns);
        let period_ns = timeline::median_period_ns(times_ns.iter().copied());
        if contents.has_times && !timeline::PLAUSIBLE_PERIODS_NS.contains(&period_ns) {
            let rate = (1e12 / period_ns as f64).round() / 1e3;
            let dir = dir.display();
            tracing::warn!(
                "{dir}: by its times it has {rate} frames per second; are they in the unit of {}?",
                layout.name
            );
        }
        let calibration = options.depth_calibration.or(contents.depth_calibration);
        let layout = layout.name;
        let recording = Self {
            layout,
            folder,
            contents,
            times_ns,
            size,
            period_ns,
            depth_registration: None,
            depth_fit: options.depth_fit,
        };
        let is_given = options.depth_calibration.is_some();
        recording.register_depth(calibration, is_given)
    }

    /// Returns the name of the layout, such as `TUM RGB-D`.
    pub fn layout(&self) -> &'static str {
        self.layout
    }

    /// Returns the number of frames, including those that will fail to read.
    pub fn len(&self) -> usize {
        self.contents.frames.len()
    }

    /// Returns whether there are no frames; never true for an opened recording.
    pub fn is_empty(&self) -> bool {
        self.contents.frames.is_empty()
    }

    /// Returns width and height of the colour pictures: those of the first one with a readable header.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Returns the time of frame `index` in nanoseconds after the first frame; strictly increasing. A frame without a
    /// usable time gets one between its neighbours'.
    ///
    /// # Panics
    /// `index` is not below [`Recording::len`].
    pub fn time_ns(&self, index: usize) -> u64 {
        self.times_ns[index]
    }

    /// Returns the median frame period in nanoseconds, > 0; that of 30 frames per second if there is only one frame.
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns whether its times are recorded, so that [`Options::period_ns`] does not count.
    pub fn has_times(&self) -> bool {
        self.contents.has_times
    }

    /// Returns whether [`Options::size`] chose its scenes.
    pub fn is_chosen_by_size(&self) -> bool {
        self.contents.is_chosen_by_size
    }

    /// Returns whether [`Options::topics`] can choose its pictures.
    pub fn has_topics(&self) -> bool {
        self.layout == mcap::LAYOUT.name
    }

    /// Returns the file names of the colour pictures, without extension; empty for lines that name none.
    pub fn picture_stems(&self) -> Vec<String> {
        let stem = |frame: &ListedFrame| frame.color.file.as_deref().ok()?.file_stem()?.to_str().map(str::to_owned);
        self.contents.frames.iter().map(|frame| stem(frame).unwrap_or_default()).collect()
    }

    /// Returns the stereo geometry, if the frames have right pictures.
    pub fn stereo_geometry(&self) -> Option<&StereoGeometry> {
        self.contents.stereo_geometry.as_ref()
    }

    /// Returns the number of disparities to search, from 0, if the recording states it: a multiple of 16.
    pub fn disparity_count(&self) -> Option<u32> {
        self.contents.disparity_count
    }

    /// Returns the counts of listed pictures without a frame.
    pub fn unpaired(&self) -> Unpaired {
        self.contents.unpaired
    }

    /// Reads the colour picture of frame `index`, of [`Recording::size`], into `into`.
    ///
    /// # Errors
    /// The picture is missing, of another size or kind, truncated or damaged, or outside the recording; its line in the
    /// list is faulty; there is no such frame. The content of `into` is then unspecified.
    pub fn read_color(&self, index: usize, scratch: &mut Scratch, into: &mut ColorImage) -> Result<(), RecordingError> {
        let source = &self.frame(index)?.color;
        if let Some(container) = &self.contents.container {
            let read = container.read_color(index, self.size, scratch, into);
            return read.map_err(|fault| source.error(&self.folder.dir, fault));
        }
        let path = self.folder.locate(source)?;
        let read = match self.contents.are_photos {
            true => decode::read_upright(&path, self.size, scratch, into),
            false => decode::read_color(&path, Some(self.size), scratch, into).map(drop),
        };
        read.map_err(|fault| source.error(&self.folder.dir, fault))
    }

    /// Reads the right picture of frame `index`, of [`Recording::size`], as luma into `into`.
    ///
    /// # Errors
    /// Same as for [`Recording::read_color`]; or the recording has one camera only.
    pub fn read_right(&self, index: usize, scratch: &mut Scratch, into: &mut GrayImage) -> Result<(), RecordingError> {
        let no_right_picture = || RecordingError::NoRight { dir: self.folder.dir.clone() };
        let frame = self.frame(index)?;
        self.contents.stereo_geometry.as_ref().ok_or_else(no_right_picture)?;
        // Without a right picture, the line of the left one is at fault.
        let source = frame.right.as_ref().unwrap_or(&frame.color);
        let path = self.folder.locate(source)?;
        decode::read_right_luma(&path, self.size, scratch, into).map_err(|fault| source.error(&self.folder.dir, fault))
    }

    fn frame(&self, index: usize) -> Result<&ListedFrame, RecordingError> {
        self.contents.frames.get(index).ok_or(RecordingError::NoSuchFrame { index, len: self.contents.frames.len() })
    }
}
