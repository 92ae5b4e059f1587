//! Writing a recording.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::time::Seconds;
use super::{ASSOCIATIONS, COLOR_LIST, DEPTH_LIST};
use crate::frame::{ColorImage, DepthMap};
use crate::recording::error::RecordingError;
use crate::recording::whole::WholeList;
use crate::recording::{MAX_SIDE_PX, check_depth_scale, depth_covers, encode};

const COLOR_FOLDER: &str = "rgb";
const DEPTH_FOLDER: &str = "depth";

/// How to write a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriterOptions {
    /// Units of the depth pictures per metre, > 0. A depth beyond 65535 units is written as unknown.
    pub depth_scale: f32,
    /// Whether a recording that is already in the folder may be replaced.
    pub overwrite: bool,
}

impl Default for WriterOptions {
    /// 5000 units per metre, as in the TUM benchmark: 0.2 mm steps up to 13.1 m. Nothing is overwritten.
    fn default() -> Self {
        Self { depth_scale: super::DEPTH_SCALE, overwrite: false }
    }
}

/// Writes a recording frame by frame, with the memory of one frame.
///
/// The pictures are `rgb/000000.png` (8-bit RGB) and `depth/000000.png` (16-bit grey, 0 = unknown) and so on. The
/// lists appear when [`Writer::finish`] has made them whole; until then they are `rgb.txt.part` and
/// `depth.txt.part`, and the folder is not a recording.
pub struct Writer {
    dir: PathBuf,
    depth_scale: f32,
    color: WholeList,
    /// Begins with the first depth map: a recording without depth has no list of it.
    depth: Option<WholeList>,
    count: usize,
    last_ns: Option<u64>,
    size: Option<(u32, u32)>,
    units: Vec<u8>,
    file: Vec<u8>,
}

impl Writer {
    /// Starts a recording in the folder `dir`, which is created where needed.
    ///
    /// # Errors
    /// The folder holds a recording (finished or not) that may not be overwritten; it cannot be written; the depth
    /// scale is not a number > 0.
    pub fn create(dir: &Path, options: &WriterOptions) -> Result<Self, RecordingError> {
        check_depth_scale(options.depth_scale)?;
        if !options.overwrite {
            refuse_existing(dir)?;
        }
        let color_folder = dir.join(COLOR_FOLDER);
        fs::create_dir_all(&color_folder).map_err(RecordingError::io("create the folder", &color_folder))?;
        remove_recording(dir)?;

        let mut color = WholeList::create(dir.join(COLOR_LIST))?;
        color.line(format_args!("# colour pictures, 8-bit RGB PNG\n# timestamp filename"))?;
        Ok(Self {
            dir: dir.to_owned(),
            depth_scale: options.depth_scale,
            color,
            depth: None,
            count: 0,
            last_ns: None,
            size: None,
            units: Vec::new(),
            file: Vec::new(),
        })
    }

    /// Adds a frame at `time_ns`, in nanoseconds of any clock. A frame without depth among others that have it is
    /// left unpaired by readers.
    ///
    /// # Errors
    /// The frame does not fit the recording, which stays as it was: the time is not after the last one, the colour
    /// picture differs in size from the first, the depth map does not cover it. Or a file cannot be written.
    pub fn add(&mut self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), RecordingError> {
        self.check(time_ns, color, depth)
            .map_err(|reason| RecordingError::Unrecordable { index: self.count, reason })?;

        let file_name = format!("{:06}.png", self.count);
        if let Some(depth) = depth {
            self.file.clear();
            encode::depth_png(depth, self.depth_scale, &mut self.units, &mut self.file)
                .map_err(|e| self.encoding(e))?;
            if self.depth.is_none() {
                let folder = self.dir.join(DEPTH_FOLDER);
                fs::create_dir_all(&folder).map_err(RecordingError::io("create the folder", &folder))?;
            }
            self.write_picture(DEPTH_FOLDER, &file_name)?;
        }
        self.file.clear();
        encode::color_png(color, &mut self.file).map_err(|e| self.encoding(e))?;
        self.write_picture(COLOR_FOLDER, &file_name)?;

        let time = Seconds(time_ns);
        if depth.is_some() {
            let list = match &mut self.depth {
                Some(list) => list,
                none => none.insert(start_depth_list(&self.dir, self.depth_scale)?),
            };
            list.line(format_args!("{time} {DEPTH_FOLDER}/{file_name}"))?;
        }
        self.color.line(format_args!("{time} {COLOR_FOLDER}/{file_name}"))?;
        (self.count, self.last_ns, self.size) = (self.count + 1, Some(time_ns), Some(color.size()));
        Ok(())
    }

    /// Completes the recording: its lists appear.
    ///
    /// # Errors
    /// No frame was added (an empty recording cannot be read), or a list cannot be written.
    pub fn finish(self) -> Result<(), RecordingError> {
        if self.count == 0 {
            self.color.abandon();
            return Err(RecordingError::NothingRecorded { dir: self.dir });
        }
        // The colour list comes last: with it, the folder becomes a recording.
        if let Some(depth) = self.depth {
            depth.finish()?;
        }
        self.color.finish()
    }

    fn check(&self, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<(), String> {
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

    fn encoding(&self, error: image::ImageError) -> RecordingError {
        RecordingError::Unrecordable { index: self.count, reason: error.to_string() }
    }

    fn write_picture(&self, folder: &str, file_name: &str) -> Result<(), RecordingError> {
        let path = self.dir.join(folder).join(file_name);
        fs::write(&path, &self.file).map_err(RecordingError::io("write", &path))
    }
}

fn start_depth_list(dir: &Path, depth_scale: f32) -> Result<WholeList, RecordingError> {
    let mut list = WholeList::create(dir.join(DEPTH_LIST))?;
    list.line(format_args!("# depth maps, 16-bit PNG, {depth_scale} units per metre, 0 = unknown"))?;
    list.line(format_args!("# timestamp filename"))?;
    Ok(list)
}

/// The files that a recording, finished or not, has in its folder besides the pictures.
fn lists(dir: &Path) -> impl Iterator<Item = PathBuf> {
    let lists = [COLOR_LIST, DEPTH_LIST, ASSOCIATIONS].map(|name| dir.join(name));
    let parts = lists.clone().map(|list| WholeList::part_of(&list));
    lists.into_iter().chain(parts)
}

/// The numbered pictures in `folder`, which may be missing.
fn pictures(folder: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    let is_ours = |path: &PathBuf| {
        path.extension().is_some_and(|extension| extension == "png")
            && path.file_stem().is_some_and(|stem| stem.as_encoded_bytes().iter().all(u8::is_ascii_digit))
    };
    match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        entries => entries
            .and_then(|entries| {
                entries.map(|entry| Ok(entry?.path())).filter(|p| p.as_ref().map_or(true, is_ours)).collect()
            })
            .map_err(RecordingError::io("list", folder)),
    }
}

fn refuse_existing(dir: &Path) -> Result<(), RecordingError> {
    if let Some(path) = lists(dir).find(|list| list.exists()) {
        return Err(RecordingError::Exists { path });
    }
    for folder in [COLOR_FOLDER, DEPTH_FOLDER] {
        if let Some(path) = pictures(&dir.join(folder))?.pop() {
            return Err(RecordingError::Exists { path });
        }
    }
    Ok(())
}

/// Removes an earlier recording, lists first: the folder stops being a recording before it stops being whole.
fn remove_recording(dir: &Path) -> Result<(), RecordingError> {
    let pictures = [COLOR_FOLDER, DEPTH_FOLDER].map(|folder| pictures(&dir.join(folder)));
    for path in lists(dir).chain(pictures.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten()) {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(RecordingError::io("remove", &path)(error));
            }
            _ => {}
        }
    }
    Ok(())
}
