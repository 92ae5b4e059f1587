//! Units of depth maps, from the files of the data sets.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::{DEPTH_FOLDERS, LAYOUT, find_pair};
use crate::recording::error::RecordingError;
use crate::recording::{LAYOUTS, pictures};
use bokehcam_files::input;

/// Units per metre of Replica, as NICE-SLAM and iMAP render it: 65535 is 10 m.
const REPLICA_SCALE: f32 = 6553.5;

/// Maximum size of a file with scales: ten thousand pictures.
const MAX_BYTES: u64 = 4 << 20;

/// The origin of the units.
#[derive(Debug)]
pub(in crate::recording) enum Scale {
    /// Millimetres, as from nearly all depth cameras; 65535 is unknown.
    Millimetres,
    /// Replica's `cam_params.json`, if it exists: `camera.scale` units per metre.
    Replica(Option<PathBuf>),
    /// BOP's `scene_camera.json`: millimetres per unit as `depth_scale` of each picture.
    Bop(PathBuf),
    /// `transforms.json` of Nerfstudio, SplaTAM and Instant NGP: metres per unit.
    Transforms(PathBuf),
}

/// Units as stated by a data set.
pub(in crate::recording) struct StatedUnits {
    pub(in crate::recording) per_m: f32,
    pub(in crate::recording) invalid: Option<u16>,
    /// Whether no file states them.
    pub(in crate::recording) are_assumed: bool,
    /// What states them, for messages.
    pub(in crate::recording) origin: String,
}

impl StatedUnits {
    fn millimetres(origin: &str) -> Self {
        Self { per_m: 1000.0, invalid: Some(u16::MAX), are_assumed: true, origin: origin.to_owned() }
    }

    /// Returns a sentence about them, and the option that overrides them.
    pub(in crate::recording) fn describe(&self) -> String {
        format!("has {} units per metre ({}; --depth-scale)", self.per_m, self.origin)
    }
}

/// The scales of Instant NGP and SplaTAM, and of Nerfstudio.
#[derive(Deserialize)]
struct Transforms {
    integer_depth_scale: Option<f64>,
    depth_unit_scale_factor: Option<f64>,
}

impl Transforms {
    fn metres(&self) -> Option<f64> {
        self.integer_depth_scale.or(self.depth_unit_scale_factor)
    }
}

#[derive(Deserialize)]
struct BopCamera {
    depth_scale: f64,
}

impl Scale {
    /// Returns the origin of the units in the recording `dir`, whose colour pictures are in `color`.
    pub(in crate::recording) fn of_folder(dir: &Path, color: &Path) -> Self {
        let file = |dir: &Path, name: &str| Some(dir.join(name)).filter(|file| file.is_file());
        if let Some(file) = file(dir, "scene_camera.json") {
            return Self::Bop(file);
        }
        if let Some(file) = file(dir, "transforms.json") {
            return Self::Transforms(file);
        }
        // One file for all scenes, beside them.
        let beside = std::path::absolute(dir).ok().and_then(|dir| Some(dir.parent()?.to_owned()));
        let params = file(dir, "cam_params.json").or_else(|| file(&beside?, "cam_params.json"));
        match color == Path::new("results") || params.is_some() {
            true => Self::Replica(params),
            false => Self::Millimetres,
        }
    }

    /// Returns the origin of the units of a single map, if it is one of a recording of this kind, or lies beside the picture
    /// that it is of by its name.
    pub(in crate::recording) fn of_map(map: &Path) -> Option<Self> {
        let map = std::path::absolute(map).ok()?;
        let folder = map.parent()?;
        if pictures::has_picture_of(&map) {
            return Some(Self::of_folder(folder, Path::new("")));
        }
        [folder.parent(), Some(folder)].into_iter().flatten().find_map(|dir| {
            // Other layouts, such as lists of both, come before.
            LAYOUTS.iter().find(|layout| (layout.matches)(dir)).filter(|layout| layout.name == LAYOUT.name)?;
            let [color, depth] = find_pair(dir)?;
            let is_of_pair =
                [depth.folder].into_iter().chain(DEPTH_FOLDERS.map(Path::new)).any(|of| dir.join(of) == folder);
            is_of_pair.then(|| Self::of_folder(dir, color.folder))
        })
    }

    /// Reads the file, if there is one: for `map` alone, or for all maps.
    ///
    /// # Errors
    /// It is unreadable, or states no scale > 0; or that of its pictures differs, and it states none for `map`.
    pub(in crate::recording) fn read(&self, map: Option<&Path>) -> Result<StatedUnits, RecordingError> {
        match self {
            Self::Millimetres => Ok(StatedUnits::millimetres("assumed to be millimetres, 65535 unknown")),
            Self::Transforms(file) => match read_json::<Transforms>(file)?.metres() {
                Some(metres) => to_units(file, 1.0 / metres),
                None => Ok(StatedUnits::millimetres("assumed to be millimetres, as transforms.json states no scale")),
            },
            Self::Replica(None) => {
                let origin = "assumed to be Replica, without cam_params.json".to_owned();
                Ok(StatedUnits { per_m: REPLICA_SCALE, invalid: None, are_assumed: true, origin })
            }
            Self::Replica(Some(file)) => {
                let scale = read_json::<Value>(file)?["camera"]["scale"].as_f64();
                let what = "states no number camera.scale".to_owned();
                to_units(file, scale.ok_or_else(|| RecordingError::StatedScale { file: file.clone(), what })?)
            }
            Self::Bop(file) => {
                let cameras: BTreeMap<String, BopCamera> = read_json(file)?;
                let number = map.and_then(|map| map.file_stem()?.to_str()?.parse::<u64>().ok());
                if let Some(camera) = number.and_then(|number| cameras.get(&number.to_string())) {
                    return to_units(file, 1000.0 / camera.depth_scale);
                }
                let fault = |what: String| RecordingError::StatedScale { file: file.clone(), what };
                let mut scales = cameras.iter().map(|(picture, camera)| (picture, camera.depth_scale));
                let (first, scale) = scales.next().ok_or_else(|| fault("names no picture".to_owned()))?;
                match scales.find(|(_, other)| *other != scale) {
                    Some((other, differs)) => Err(fault(format!(
                        "depth_scale is {scale} for picture {first}, but {differs} for {other}, and all need one"
                    ))),
                    None => to_units(file, 1000.0 / scale),
                }
            }
        }
    }
}

fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, RecordingError> {
    let text = input::read_text(file, MAX_BYTES).map_err(RecordingError::io("read the depth scale", file))?;
    serde_json::from_str(&text)
        .map_err(|error| RecordingError::StatedScale { file: file.to_owned(), what: error.to_string() })
}

fn to_units(file: &Path, per_m: f64) -> Result<StatedUnits, RecordingError> {
    let usable = Some(per_m as f32).filter(|per_m| *per_m > 0.0 && per_m.is_finite());
    let name = file.file_name().unwrap_or_default().display().to_string();
    match usable {
        Some(per_m) => Ok(StatedUnits { per_m, invalid: None, are_assumed: false, origin: format!("from {name}") }),
        None => {
            let what = format!("states {per_m} units per metre, which is not a scale > 0");
            Err(RecordingError::StatedScale { file: file.to_owned(), what })
        }
    }
}
