//! The layouts of the KITTI benchmarks, odometry (one sequence) and stereo, and what people make of them: a folder for
//! each eye, whose pictures have a number and the same name in both, `calib.txt`, and `times.txt` with one time a line.

pub(super) mod calib;
mod times;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::contents::{Contents, Folder, Layout, Listed, Source, numbered_pictures};
use super::error::RecordingError;
use super::geometry::Geometry;
use super::list::{clear_unordered_times, refuse_faults};
use super::{Options, Pair, Unpaired};

/// Recognised by the folders of the two eyes.
pub(super) const LAYOUT: Layout =
    Layout { name: "KITTI", looked_for: "image_2 and image_3, or image_0 and image_1", is_in, open };

/// The folders of two eyes.
struct Eyes {
    left: &'static str,
    right: &'static str,
    /// The number of the left camera in the calibration; the right one follows it.
    camera: Option<usize>,
}

/// Colour goes before grey.
const EYES: [Eyes; 6] = [
    Eyes { left: "image_2", right: "image_3", camera: Some(2) },
    Eyes { left: "image_02/data", right: "image_03/data", camera: Some(2) },
    Eyes { left: "colored_0", right: "colored_1", camera: Some(2) },
    Eyes { left: "image_0", right: "image_1", camera: Some(0) },
    Eyes { left: "image_00/data", right: "image_01/data", camera: Some(0) },
    Eyes { left: "image_l", right: "image_r", camera: None },
];

const CALIBRATIONS: [&str; 2] = ["calib.txt", "calib_cam_to_cam.txt"];

fn is_in(dir: &Path) -> bool {
    EYES.iter().any(|eyes| dir.join(eyes.left).is_dir())
}

/// The number of the left camera whose folder the picture `left` is in.
pub(super) fn camera_of(left: &Path) -> Option<usize> {
    let folder = left.parent()?;
    EYES.iter().find(|eyes| folder.ends_with(eyes.left))?.camera
}

/// Lists the pictures of both eyes, with their times, and reads the calibration.
fn open(folder: &Folder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let eyes = eyes(dir)?;
    let names = numbered_pictures(&dir.join(eyes.left))?;
    let right_names: HashSet<String> = numbered_pictures(&dir.join(eyes.right))?.into_iter().collect();
    let known_names: HashSet<&String> = names.iter().collect();
    let right_alone: Vec<_> = right_names.iter().filter(|name| !known_names.contains(name)).collect();
    if !options.keep_going {
        let no_partner =
            |eye: &str, name: &String, other| RecordingError::NoPartner { path: dir.join(eye).join(name), other };
        if let Some(name) = names.iter().find(|name| !right_names.contains(*name)) {
            return Err(no_partner(eyes.left, name, eyes.right));
        }
        // The smallest, so that the message is the same each time: a `HashSet` has no order.
        if let Some(name) = right_alone.iter().min() {
            return Err(no_partner(eyes.right, name, eyes.left));
        }
    }

    let pictures = names.iter().map(|name| (name.as_str(), PathBuf::from(format!("{}/{name}", eyes.left))));
    let mut entries = times::timed_entries(dir, pictures.collect(), options)?;
    clear_unordered_times(entries.iter_mut());
    if !options.keep_going {
        refuse_faults(dir, entries.iter())?;
    }
    let frames = entries.into_iter().zip(&names).map(|(left, name)| Listed {
        time_ns: left.time_ns,
        // `times.txt` does not name the pictures: its line is cited only where the time itself is faulty.
        color: Source { place: left.source.place.filter(|_| left.source.file.is_err()), ..left.source },
        right: Some(Source::found(Path::new(eyes.right).join(name))),
        depth: None,
    });
    let calibration = CALIBRATIONS.iter().map(|name| dir.join(name)).find(|path| path.exists());
    let pair = match calibration {
        Some(path) => Pair::Rectified(Geometry::read_as(&path, |text| calib::parse(text, eyes.camera))?.rig),
        None => Pair::Unstated,
    };
    Ok(Contents {
        frames: frames.collect(),
        depth: None,
        pair: Some(pair),
        disparities: None,
        unpaired: Unpaired { right: right_alone.len(), ..Unpaired::default() },
    })
}

/// The first pair of folders that are both there.
fn eyes(dir: &Path) -> Result<&'static Eyes, RecordingError> {
    let has = |eye: &str| dir.join(eye).is_dir();
    if let Some(eyes) = EYES.iter().find(|eyes| has(eyes.left) && has(eyes.right)) {
        return Ok(eyes);
    }
    let alone = EYES.iter().find(|eyes| has(eyes.left)).unwrap_or(&EYES[0]);
    Err(RecordingError::MissingEye { dir: dir.to_owned(), missing: alone.right, present: alone.left })
}
