//! Writes a recording.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::growing::GrowingList;
use super::time::Seconds;
use super::{ASSOCIATIONS, COLOR_LIST, DEPTH_LIST, listed};
use crate::files::folder::{self, FileSet, Folder, FolderError};
use crate::frame::{ColorImage, DepthMap};
use crate::recording::error::RecordingError;
use crate::recording::{MAX_SIDE_PX, check_depth_scale, depth_covers, encode};

const COLOR_FOLDER: &str = "rgb";
const DEPTH_FOLDER: &str = "depth";

/// The files of a recording within its folder.
const FILE_SET: FileSet = FileSet { subfolders: &[COLOR_FOLDER, DEPTH_FOLDER], contains: &is_recording_file };

/// Options for writing a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriterOptions {
    /// Units of the depth pictures per metre, > 0. A depth beyond 65535 units is written as unknown.
    pub depth_scale: f32,
    /// Whether an existing recording in the folder may be replaced, once the new one is complete.
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
/// are finished last; until then the folder is not a recording. Files of an earlier recording stay until the new one is
/// complete, and no other file in the folder is touched. [`Writer::finish`] or [`Writer::finish_incomplete`] must
/// end it; otherwise there are no lists.
pub struct Writer {
    dir: PathBuf,
    depth_scale: f32,
    color: GrowingList,
    /// Created with the first depth map: a recording without depth has no depth list.
    depth: Option<GrowingList>,
    /// Declared after the lists, so that it is dropped after them.
    folder: Folder,
    count: usize,
    last_ns: Option<u64>,
    size: Option<(u32, u32)>,
    /// Number of known depth values, and of those beyond the range of the file.
    depth_counts: (u64, u64),
    /// Working memory for encoding: samples of a depth map, and the picture file.
    units: Vec<u8>,
    file: Vec<u8>,
}

/// The result of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingSummary {
    /// The folder of the recording.
    pub dir: PathBuf,
    /// The number of frames.
    pub frames: usize,
    /// Number of files removed of an earlier recording.
    pub replaced: u64,
    /// Number of known depth values in all frames.
    pub known_depths: u64,
    /// Number of depth values beyond the range of the file, written as unknown.
    pub out_of_range_depths: u64,
}

impl Writer {
    /// Starts a recording in the folder `dir`, which is created if needed. An unfinished recording of a killed process
    /// in that folder gets its lists first.
    ///
    /// # Errors
    /// The folder has content that may not be overwritten, or pictures with names of a recording that no list names;
    /// another process writes it, or it cannot be written; the depth scale is not a number > 0.
    pub fn create(dir: &Path, options: &WriterOptions) -> Result<Self, RecordingError> {
        check_depth_scale(options.depth_scale)?;
        GrowingList::recover_interrupted(dir, &[DEPTH_LIST, COLOR_LIST])?;
        if options.overwrite {
            folder::adopt_files(dir, listed::find_pictures(dir).chain(listed::find_lists(dir)))?;
        }
        let folder = Folder::open(dir, options.overwrite, &FILE_SET).map_err(|error| match error {
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
            count: 0,
            last_ns: None,
            size: None,
            depth_counts: (0, 0),
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
        self.check_frame(time_ns, color, depth)
            .map_err(|reason| RecordingError::Unrecordable { index: self.count, reason })?;

        let file_name = format!("{:06}.png", self.count);
        let mut depth_counts = self.depth_counts;
        if let Some(depth) = depth {
            self.file.clear();
            encode::encode_depth_png(depth, self.depth_scale, None, &mut self.units, &mut self.file)
                .map_err(|e| self.encoding_error(e))?;
            self.write_picture(DEPTH_FOLDER, &file_name)?;
            let known = || depth.metres.iter().filter(|&&metres| DepthMap::is_known(metres));
            let max_depth_m = self.max_depth_m();
            depth_counts.0 += known().count() as u64;
            depth_counts.1 += known().filter(|&&metres| metres > max_depth_m).count() as u64;
        }
        self.file.clear();
        encode::encode_color_png(color, &mut self.file).map_err(|e| self.encoding_error(e))?;
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
        (self.count, self.last_ns, self.size, self.depth_counts) =
            (self.count + 1, Some(time_ns), Some(color.size()), depth_counts);
        Ok(())
    }

    /// Returns the number of frames so far.
    pub fn frames(&self) -> usize {
        self.count
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
        let mut written = self.summary();
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
        let mut written = self.summary();
        let folder = self.finish_lists()?;
        written.dir = folder.finish_incomplete()?.unwrap_or(written.dir);
        Ok(written)
    }

    fn summary(&self) -> RecordingSummary {
        let (known_depths, out_of_range_depths) = self.depth_counts;
        RecordingSummary { dir: self.dir.clone(), frames: self.count, replaced: 0, known_depths, out_of_range_depths }
    }

    /// Finishes the lists and returns the folder.
    fn finish_lists(self) -> Result<Folder, RecordingError> {
        let mut folder = self.folder;
        if self.count == 0 {
            return Err(RecordingError::NothingRecorded { dir: self.dir });
        }
        // The colour list comes last, because it makes the folder a recording.
        if let Some(depth) = self.depth {
            depth.commit(&mut folder)?;
        }
        self.color.commit(&mut folder)?;
        Ok(folder)
    }

    /// Checks that the frame can be the next one of the recording; returns the reason if not.
    fn check_frame(&self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), String> {
        let (width, height) = color.size();
        if let Some(last_ns) = self.last_ns.filter(|&last_ns| time_ns <= last_ns) {
            return Err(format!("its time {} s is not after the last one, {} s", Seconds(time_ns), Seconds(last_ns)));
        }
        if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
            return Err(format!("it is {width}x{height}, and pictures have 1 to {MAX_SIDE_PX} pixels a side"));
        }
        if let Some((first_width, first_height)) = self.size.filter(|&size| size != color.size()) {
            return Err(format!("it is {width}x{height}, and the first frame was {first_width}x{first_height}"));
        }
        if color.rgb.len() != width as usize * height as usize * 3 {
            return Err(format!("it is {width}x{height}, and has {} bytes", color.rgb.len()));
        }
        if let Some(depth) = depth {
            let (depth_width, depth_height) = depth.size();
            if !depth_covers(depth.size(), color.size()) {
                return Err(format!(
                    "its depth is {depth_width}x{depth_height}, which does not cover {width}x{height}"
                ));
            }
            if depth.metres.len() != depth_width as usize * depth_height as usize {
                return Err(format!(
                    "its depth is {depth_width}x{depth_height}, and has {} values",
                    depth.metres.len()
                ));
            }
        }
        Ok(())
    }

    fn encoding_error(&self, error: impl std::fmt::Display) -> RecordingError {
        RecordingError::Unrecordable { index: self.count, reason: error.to_string() }
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

/// Returns whether a recording uses this name for a list or picture, such as `rgb/000000.png`.
fn is_recording_file(name: &str) -> bool {
    let folders = [COLOR_FOLDER, DEPTH_FOLDER];
    let number = folders.iter().find_map(|folder| name.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".png"));
    let is_number = |number: &str| number.len() >= 6 && number.bytes().all(|byte| byte.is_ascii_digit());
    [COLOR_LIST, DEPTH_LIST, ASSOCIATIONS].contains(&name) || number.is_some_and(is_number)
}
