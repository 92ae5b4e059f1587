//! Writes a recording.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::growing::GrowingList;
use super::{COLOR_LIST, DEPTH_LIST};
use crate::recording::error::RecordingError;
use crate::recording::frame_sequence::{FrameSequence, RecordingSummary};
use crate::recording::time::Seconds;
use crate::recording::{check_depth_scale, encode};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_files::folder::{Folder, FolderError};

const COLOR_FOLDER: &str = "rgb";
const DEPTH_FOLDER: &str = "depth";

/// Options for writing a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriterOptions {
    /// Units of the depth pictures per metre, > 0. A depth beyond 65535 units is written as unknown.
    pub depth_scale: f32,
    /// Whether the folder of an existing recording by this program may be replaced, once the new one is complete.
    pub overwrite: bool,
}

impl Default for WriterOptions {
    /// 5000 units per metre, as in the TUM benchmark: 0.2 mm steps up to 13.1 m. Nothing is overwritten.
    fn default() -> Self {
        Self { depth_scale: super::DEPTH_SCALE, overwrite: false }
    }
}

/// Writes a recording frame by frame, with memory for one frame.
///
/// The pictures are `rgb/000000.png` (8-bit RGB), `depth/000000.png` (16-bit grey, 0 = unknown) and so on. The lists
/// are finished last; until then the folder is not a recording. An earlier recording stays until the new one is complete.
/// [`Writer::finish`] or [`Writer::finish_incomplete`] must
/// end it; otherwise there are no lists.
pub struct Writer {
    dir: PathBuf,
    depth_scale: f32,
    color: GrowingList,
    /// Created with the first depth map: a recording without depth has no depth list.
    depth: Option<GrowingList>,
    /// Declared after the lists, so that it is dropped after them.
    folder: Folder,
    frames: FrameSequence,
    /// Working memory for encoding: samples of a depth map, and the picture file.
    units: Vec<u8>,
    file: Vec<u8>,
}

impl Writer {
    /// Starts a recording in the folder `dir`, which is created if needed. An unfinished recording of a killed process
    /// in that folder gets its lists first.
    ///
    /// # Errors
    /// The folder has content that may not be replaced; another process writes it, or it cannot be written; the depth
    /// scale is not a number > 0.
    pub fn create(dir: &Path, options: &WriterOptions) -> Result<Self, RecordingError> {
        check_depth_scale(options.depth_scale)?;
        GrowingList::recover_interrupted(dir, &[DEPTH_LIST, COLOR_LIST])?;
        let folder = Folder::open(dir, options.overwrite).map_err(|error| match error {
            FolderError::NotEmpty { path } => RecordingError::Exists { path },
            other => other.into(),
        })?;
        let color =
            GrowingList::create(&folder, COLOR_LIST, "# colour pictures, 8-bit RGB PNG\n# timestamp filename\n")?;
        Ok(Self {
            dir: dir.to_owned(),
            depth_scale: options.depth_scale,
            color,
            depth: None,
            folder,
            frames: FrameSequence::default(),
            units: Vec::new(),
            file: Vec::new(),
        })
    }

    /// Adds a frame at `time_ns`, in nanoseconds of any clock. Readers skip a frame without depth if others have it.
    ///
    /// # Errors
    /// The frame does not fit the recording: its time is not after the last one, the size of the colour picture differs
    /// from the first, or the depth map does not cover it. Or a file cannot be written. The recording is unchanged.
    pub fn add(&mut self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), RecordingError> {
        self.frames.check(time_ns, color, depth)?;

        let file_name = format!("{:06}.png", self.frames.count());
        if let Some(depth) = depth {
            self.file.clear();
            encode::encode_depth_png(depth, self.depth_scale, None, &mut self.units, &mut self.file)
                .map_err(|e| self.frames.refuse(e))?;
            self.write_picture(DEPTH_FOLDER, &file_name)?;
        }
        self.file.clear();
        encode::encode_color_png(color, &mut self.file).map_err(|e| self.frames.refuse(e))?;
        self.write_picture(COLOR_FOLDER, &file_name)?;

        // Lists after pictures, so that listed files exist; a frame that fails is in neither list.
        let time = Seconds(time_ns);
        if depth.is_some() {
            let list = match &mut self.depth {
                Some(list) => list,
                none => {
                    none.insert(GrowingList::create(&self.folder, DEPTH_LIST, &format_depth_header(self.depth_scale))?)
                }
            };
            list.add_line(format_args!("{time} {DEPTH_FOLDER}/{file_name}"))?;
        }
        if let Err(error) = self.color.add_line(format_args!("{time} {COLOR_FOLDER}/{file_name}")) {
            if let (Some(list), Some(_)) = (&mut self.depth, depth) {
                list.remove_last_line();
            }
            return Err(error);
        }
        self.frames.add(time_ns, color, depth, self.max_depth_m());
        Ok(())
    }

    /// Returns the number of frames so far.
    pub fn frames(&self) -> usize {
        self.frames.count()
    }

    /// Returns the largest depth that can be written, in metres.
    pub fn max_depth_m(&self) -> f32 {
        encode::max_value(self.depth_scale)
    }

    /// Completes the recording: its lists get their names, and a replaced recording is removed.
    ///
    /// # Errors
    /// No frame was added (an empty recording cannot be read), or a list cannot be written.
    pub fn finish(self) -> Result<RecordingSummary, RecordingError> {
        let mut written = self.frames.summary(&self.dir);
        let folder = self.finish_lists()?;
        written.replaced = folder.finish()?;
        Ok(written)
    }

    /// Ends a recording that was interrupted. If it was to replace an earlier one, that one stays, and the new one is
    /// kept next to the folder as `NAME.incomplete`; otherwise it stays in its folder. It is readable in either place.
    ///
    /// # Errors
    /// Same as for [`Writer::finish`].
    pub fn finish_incomplete(self) -> Result<RecordingSummary, RecordingError> {
        let mut written = self.frames.summary(&self.dir);
        let folder = self.finish_lists()?;
        written.dir = folder.finish_incomplete()?.unwrap_or(written.dir);
        Ok(written)
    }

    /// Finishes the lists and returns the folder.
    fn finish_lists(self) -> Result<Folder, RecordingError> {
        let mut folder = self.folder;
        if self.frames.count() == 0 {
            return Err(RecordingError::NothingRecorded { dir: self.dir });
        }
        // The colour list comes last, because it makes the folder a recording.
        if let Some(depth) = self.depth {
            depth.commit(&mut folder)?;
        }
        self.color.commit(&mut folder)?;
        Ok(folder)
    }

    fn write_picture(&mut self, folder: &str, file_name: &str) -> Result<(), RecordingError> {
        let part = self.folder.create_file(&format!("{folder}/{file_name}"))?;
        part.file().write_all(&self.file).map_err(RecordingError::io("write", part.path()))?;
        Ok(self.folder.commit_file(part)?)
    }
}

fn format_depth_header(depth_scale: f32) -> String {
    format!("# depth maps, 16-bit PNG, {depth_scale} units per metre, 0 = unknown\n# timestamp filename\n")
}
