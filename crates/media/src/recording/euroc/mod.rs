//! The layout of the EuRoC and ASL data sets: `mav0/cam0` and `mav0/cam1`, each with `data.csv` (lines of
//! `nanoseconds,file`), the pictures in `data`, and `sensor.yaml`. The pictures are not rectified. Without `data.csv`,
//! the file names of the pictures are their times.

use std::path::{Path, PathBuf};

use super::contents::{Contents, Layout, ListedFrame, PictureSource, RecordingFolder};
use super::error::RecordingError;
use super::fault::LineFault;
use super::folder::find_numbered_pictures;
use super::list::{self, Entry, clear_unordered_times, parse_relative_path, quote, refuse_faults};
use super::{Options, StereoGeometry, Unpaired, pair, timeline};

/// One folder per camera, with its list.
pub(super) const LAYOUT: Layout = Layout {
    name: "EuRoC/ASL",
    expected_files: "mav0/cam0 with data.csv or data",
    matches: |dir| find_cameras(dir).is_some(),
    open,
};

/// A camera's list, and the folder of its pictures.
const LIST: &str = "data.csv";
const PICTURES: &str = "data";

/// The folder of a camera, relative to that of the recording.
struct Camera(String);

/// Returns the left and the right camera of a recording, whose folder is the parent of `mav0` or `mav0` itself.
fn find_cameras(dir: &Path) -> Option<[Camera; 2]> {
    let cameras = ["mav0/", ""].map(|parent| ["cam0", "cam1"].map(|camera| Camera(format!("{parent}{camera}"))));
    cameras.into_iter().find(|[left, _]| left.exists_in(dir))
}

impl Camera {
    fn path(&self, name: &str) -> String {
        format!("{}/{name}", self.0)
    }

    fn exists_in(&self, dir: &Path) -> bool {
        dir.join(self.path(LIST)).exists() || dir.join(self.path(PICTURES)).is_dir()
    }

    /// Reads the camera's pictures with their times, from its list or else from the file names.
    fn read(&self, dir: &Path, options: &Options) -> Result<Vec<Entry>, RecordingError> {
        let list = self.path(LIST);
        let mut entries = match dir.join(&list).exists() {
            true => list::read_list(dir, &list, |position, text| {
                let columns = text.map(|text| text.split(',').map(str::trim).collect::<Vec<_>>());
                match columns.as_deref() {
                    Ok(&[time, file]) => Entry::new(position, parse_ns(time), self.picture(file)),
                    Ok(columns) => {
                        let fault = LineFault::Columns { expected: "nanoseconds,file", found: columns.len() };
                        Entry::new(position, Err(fault.clone()), Err(fault))
                    }
                    Err(fault) => Entry::new(position, Err(fault.clone()), Err(fault.clone())),
                }
            })?,
            false => self.entries_by_name(dir)?,
        };
        clear_unordered_times(entries.iter_mut());
        if !options.keep_going {
            refuse_faults(dir, entries.iter())?;
        }
        Ok(entries)
    }

    /// Returns entries for the pictures whose names are times in nanoseconds; skips others.
    fn entries_by_name(&self, dir: &Path) -> Result<Vec<Entry>, RecordingError> {
        let names = find_numbered_pictures(&dir.join(self.path(PICTURES)))?;
        let entry = |name: String| {
            let time_ns = parse_ns(name.split('.').next()?).ok()?;
            Some(Entry {
                time_ns: Some(time_ns),
                source: PictureSource::from_path(Path::new(&self.path(PICTURES)).join(name)),
            })
        };
        Ok(names.into_iter().filter_map(entry).collect())
    }

    fn picture(&self, file: &str) -> Result<PathBuf, LineFault> {
        parse_relative_path(file).map(|file| Path::new(&self.path(PICTURES)).join(file))
    }
}

/// Pairs the pictures of the two cameras by time, and reads their calibration. A left camera alone yields no pair.
fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let [left, right] = find_cameras(dir).ok_or_else(|| RecordingError::EmptyFolder { folder: dir.clone() })?;
    let frame = |left: Entry, right| ListedFrame { time_ns: left.time_ns, color: left.source, right, depth: None };
    let entries = left.read(dir, options)?;
    if !right.exists_in(dir) {
        let frames = entries.into_iter().map(|left| frame(left, None)).collect();
        return Ok(Contents { frames, has_times: true, ..Contents::default() });
    }
    // A right picture more than half a period away belongs to another left one, which may be missing.
    let half_period_ns = timeline::median_period_ns(entries.iter().filter_map(|entry| entry.time_ns)) / 2;
    let tolerance_ns = options.pair_tolerance_ns.min(half_period_ns);
    let paired = pair::pair_by_time(entries, right.read(dir, options)?, tolerance_ns);
    if paired.frames.iter().all(|(_, right)| right.is_none()) {
        return Err(RecordingError::NoStereoPairs { dir: dir.clone(), tolerance_ns });
    }
    let sensors = [left, right].map(|camera| dir.join(camera.path("sensor.yaml")));
    let stereo_geometry = match sensors.iter().any(|sensor| sensor.exists()) {
        true => StereoGeometry::Raw(Box::new(bokehcam_calibration::euroc::read_sensors(&sensors[0], &sensors[1])?)),
        false => StereoGeometry::Uncalibrated,
    };
    Ok(Contents {
        frames: paired.frames.into_iter().map(|(left, right)| frame(left, right)).collect(),
        stereo_geometry: Some(stereo_geometry),
        unpaired: Unpaired { color: paired.unpaired, right: paired.unpaired_others, ..Unpaired::default() },
        has_times: true,
        ..Contents::default()
    })
}

/// Parses a whole number of nanoseconds: today's date takes 61 bits, and `f64` has 53.
fn parse_ns(text: &str) -> Result<u64, LineFault> {
    // `parse` alone would accept a sign.
    let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|_| is_number).ok_or_else(|| LineFault::Nanoseconds(quote(text)))
}
