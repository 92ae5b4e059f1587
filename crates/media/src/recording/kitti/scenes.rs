//! The stereo benchmarks of 2012 and 2015: single scenes such as `000003_10.png`, of several sizes, each with a
//! calibration of its own in `calib/000003.txt` or `calib_cam_to_cam/000003.txt`. The drives of a day share size and
//! calibration, so the scenes of one size are a recording with exact geometry.

use std::collections::BTreeMap;
use std::path::Path;

use super::calib;
use crate::recording::Options;
use crate::recording::contents::{Locator, PictureSource, RecordingFolder};
use crate::recording::decode;
use crate::recording::error::RecordingError;
use crate::recording::geometry::Geometry;
use bokehcam::optics::StereoRig;

/// Folders with a calibration for each scene.
const CALIBRATIONS: [&str; 2] = ["calib", "calib_cam_to_cam"];

/// Scenes that share size and calibration.
pub(super) struct Scenes {
    /// File names of their pictures.
    pub(super) names: Vec<String>,
    /// Their geometry, if there are calibrations.
    pub(super) rig: Option<StereoRig>,
}

/// Returns whether the pictures `names` in `dir` are single scenes rather than a sequence: by their names, or because
/// the first has a calibration of its own, as in the object benchmark.
pub(super) fn are_single(dir: &Path, names: &[String]) -> bool {
    let has_calibration = |name: &String| {
        CALIBRATIONS.iter().any(|calibrations| dir.join(calibrations).join(calibration_of(name)).is_file())
    };
    names.iter().all(|name| name.contains('_')) || names.first().is_some_and(has_calibration)
}

/// Returns the name of the calibration of a picture's scene.
fn calibration_of(picture: &str) -> String {
    format!("{}.txt", picture.split(['_', '.']).next().unwrap_or_default())
}

/// Selects scenes by [`Options::size`], or else the first scene's size, then by the first selected one's calibration.
/// `left` is the folder of the left pictures, and `camera` the number of the left camera.
///
/// # Errors
/// A calibration is faulty, or missing although other scenes have one; with `keep_going` its scene is left out.
pub(super) fn choose(
    folder: &RecordingFolder,
    left: &str,
    camera: Option<usize>,
    names: Vec<String>,
    options: &Options,
) -> Result<Scenes, RecordingError> {
    let mut locator = Locator::new(folder);
    let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut read_size = |name: &String| {
        let path = locator.locate(&PictureSource::from_path(Path::new(left).join(name))).ok()?;
        let (size, _) = decode::read_header(&path).ok()?;
        *sizes.entry(size).or_default() += 1;
        Some(size)
    };
    let sized: Vec<_> = names.into_iter().map(|name| (read_size(&name), name)).collect();
    let count = sized.len();
    let chosen =
        options.size.filter(|size| sizes.contains_key(size)).or_else(|| sized.iter().find_map(|(size, _)| *size));
    // A picture without a readable header is reported when it is read.
    let same_size = sized.into_iter().filter(|(size, _)| size.is_none_or(|size| Some(size) == chosen));

    let calibrations = CALIBRATIONS.iter().map(|calibrations| folder.dir.join(calibrations)).find(|dir| dir.is_dir());
    let mut rigs: BTreeMap<String, Option<StereoRig>> = BTreeMap::new();
    let mut scenes = Scenes { names: Vec::new(), rig: None };
    for (_, name) in same_size {
        if let Some(calibrations) = &calibrations {
            let scene = calibration_of(&name);
            if !rigs.contains_key(&scene) {
                let rig = match Geometry::read_with(&calibrations.join(&scene), |text| calib::parse(text, camera)) {
                    Ok(geometry) => Some(geometry.rig),
                    Err(_) if options.keep_going => None,
                    Err(error) => return Err(error),
                };
                rigs.insert(scene.clone(), rig);
            }
            let Some(rig) = rigs[&scene] else { continue };
            if *scenes.rig.get_or_insert(rig) != rig {
                continue;
            }
        }
        scenes.names.push(name);
    }
    describe(&folder.dir, &scenes, count, chosen, sizes);
    Ok(scenes)
}

/// Tells which scenes are played, unless it is all of them.
fn describe(
    dir: &Path,
    scenes: &Scenes,
    count: usize,
    chosen: Option<(u32, u32)>,
    mut sizes: BTreeMap<(u32, u32), usize>,
) {
    let Some((width, height)) = chosen.filter(|_| scenes.names.len() < count) else { return };
    sizes.remove(&(width, height));
    let others: Vec<_> = sizes.iter().map(|((width, height), count)| format!("{width}x{height} ({count})")).collect();
    let hint = match others.is_empty() {
        true => "the others have another calibration, or none".to_owned(),
        false => format!("--size plays others: {}", others.join(", ")),
    };
    let (dir, played) = (dir.display(), scenes.names.len());
    let calibration = if scenes.rig.is_some() { " and one calibration" } else { "" };
    tracing::warn!("{dir}: single scenes: the {played} of {count} with {width}x{height}{calibration}; {hint}");
}
