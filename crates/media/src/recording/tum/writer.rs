//! Writes a recording.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::growing::GrowingList;
use super::{COLOR_LIST, DEPTH_LIST, DEPTH_SCALE};
use crate::recording::encode;
use crate::recording::error::{RecordingError, Result};
use crate::recording::time::Seconds;
use crate::recording::writer::Storage;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_files::folder::{Folder, FolderError};

const COLOR_FOLDER: &str = "rgb";
const DEPTH_FOLDER: &str = "depth";

/// A folder of pictures, and the lists that make it a recording at its end.
pub(in crate::recording) struct Writer {
    dir: PathBuf,
    color: GrowingList,
    /// Created with the first depth map: a recording without depth has no depth list.
    depth: Option<GrowingList>,
    /// Declared after the lists, so that it is dropped after them.
    folder: Folder,
    /// Working memory for encoding: samples of a depth map, and the picture file.
    units: Vec<u8>,
    file: Vec<u8>,
}

impl Writer {
    /// Starts a recording in the folder `dir`.
    pub fn create(dir: &Path, overwrite: bool) -> Result<Self> {
        GrowingList::recover_interrupted(dir, &[DEPTH_LIST, COLOR_LIST])?;
        let folder = Folder::open(dir, overwrite).map_err(|error| match error {
            FolderError::NotEmpty { path } => RecordingError::Exists { path },
            other => other.into(),
        })?;
        let color =
            GrowingList::create(&folder, COLOR_LIST, "# colour pictures, 8-bit RGB PNG\n# timestamp filename\n")?;
        let dir = dir.to_owned();
        Ok(Self { dir, color, depth: None, folder, units: Vec::new(), file: Vec::new() })
    }

    /// Finishes the lists and returns the folder.
    fn finish_lists(self) -> Result<Folder> {
        let mut folder = self.folder;
        // The colour list comes last, because it makes the folder a recording.
        if let Some(depth) = self.depth {
            depth.commit(&mut folder)?;
        }
        self.color.commit(&mut folder)?;
        Ok(folder)
    }

    fn write_picture(&mut self, folder: &str, file_name: &str) -> Result<()> {
        let part = self.folder.create_file(&format!("{folder}/{file_name}"))?;
        part.file().write_all(&self.file).map_err(RecordingError::io("write", part.path()))?;
        Ok(self.folder.commit_file(part)?)
    }
}

impl Storage for Writer {
    fn add(&mut self, number: usize, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<()> {
        let file_name = format!("{number:06}.png");
        if let Some(depth) = depth {
            self.file.clear();
            encode::encode_png_16bit(depth.size(), &depth.metres, DEPTH_SCALE, None, &mut self.units, &mut self.file)
                .map_err(RecordingError::unrecordable(number))?;
            self.write_picture(DEPTH_FOLDER, &file_name)?;
        }
        self.file.clear();
        encode::encode_color_png(color, &mut self.file).map_err(RecordingError::unrecordable(number))?;
        self.write_picture(COLOR_FOLDER, &file_name)?;

        // Lists after pictures, so that listed files exist; a frame that fails is in neither list.
        let time = Seconds(time_ns);
        if depth.is_some() {
            let list = match &mut self.depth {
                Some(list) => list,
                none => none.insert(GrowingList::create(
                    &self.folder,
                    DEPTH_LIST,
                    &format!(
                        "# depth maps, 16-bit PNG, {DEPTH_SCALE} units per metre, 0 = unknown\n# timestamp filename\n"
                    ),
                )?),
            };
            list.add_line(format_args!("{time} {DEPTH_FOLDER}/{file_name}"))?;
        }
        if let Err(error) = self.color.add_line(format_args!("{time} {COLOR_FOLDER}/{file_name}")) {
            if let (Some(list), Some(_)) = (&mut self.depth, depth) {
                list.remove_last_line();
            }
            return Err(error);
        }
        Ok(())
    }

    fn max_depth_m(&self) -> f32 {
        encode::max_value(DEPTH_SCALE)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(self.finish_lists()?.finish()?)
    }

    fn keep(self: Box<Self>) -> Result<PathBuf> {
        let dir = self.dir.clone();
        Ok(self.finish_lists()?.finish_incomplete()?.unwrap_or(dir))
    }
}
