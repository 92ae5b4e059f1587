//! What is said of a map's numbers beside them: in its metadata, by its name, and by its neighbours.

use std::path::Path;

use super::values::{Samples, Values};
use super::{DepthUnit, Options};
use crate::recording::coded;
use crate::recording::fault::PictureFault;
use crate::recording::geometry::Geometry;
use crate::recording::middlebury;
use crate::recording::rgbd::{Scale, StatedUnits};
use crate::recording::role::Role;
use crate::recording::unit::{KEYWORD, MapUnit};

/// Calibration of a pair, beside its disparities.
const CALIBRATION: &str = "calib.txt";

/// Number of names in a path that are asked what a map holds: its own, and those of folders.
const MAX_LEVELS: usize = 6;

/// Reads the unit that a PNG of ours states.
pub(super) fn read_text(path: &Path) -> Option<MapUnit> {
    let info = coded::read_png_info(path).ok()?;
    let chunk = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD)?;
    MapUnit::from_text(&chunk.text)
}

/// Adds what name and neighbours of the file `path` say of numbers of which neither the file nor the options state it.
pub(super) fn complete(mut values: Values, path: &Path, options: &Options) -> Result<Values, PictureFault> {
    if values.stated.is_some() || options.unit.is_some_and(|unit| unit != DepthUnit::Disparity) || options.invert {
        return Ok(values);
    }
    if values.role == Role::Unstated {
        values.role = role_of(path);
    }
    let is_disparity = values.role == Role::Disparity || options.unit == Some(DepthUnit::Disparity);
    if is_disparity {
        let rig = Some(path.with_file_name(CALIBRATION)).filter(|file| file.is_file()).and_then(|file| {
            let geometry = Geometry::read_with(&file, middlebury::calib::parse)
                .and_then(|read| read.scaled_to(&file, values.size));
            geometry.map_err(|error| values.notes.push(error.to_string())).ok()
        });
        let scale = if rig.is_some() { format!(", with the scale of {CALIBRATION} beside it") } else { String::new() };
        if options.unit.is_none() {
            values.notes.push(format!("holds disparity by its name{scale}; --depth-unit says what else it is"));
        }
        values.stated = Some(MapUnit::Disparity { rig: rig.map(|geometry| geometry.rig) });
    } else if values.role == Role::InverseDepth {
        values.notes.push("holds inverse depth by its name; --depth-unit says what else it is".to_owned());
    } else if matches!(values.samples, Samples::Sixteen | Samples::Whole)
        && options.scale.is_none()
        && let Some(units) = scale_beside(path, values.samples, Some(path))?
    {
        values.stated = Some(MapUnit::Depth { per_m: units.per_m });
        values.invalid = values.invalid.or(units.invalid.map(f32::from));
        values.notes.push(units.describe());
    }
    Ok(values)
}

/// Returns the role that the name of a file states; else that of its folder, or of one above that has no other name than its
/// role (`disparity/TRAIN/A/0000/left/0006.pfm`).
fn role_of(path: &Path) -> Role {
    let absolute = std::path::absolute(path).unwrap_or_default();
    let names = absolute.ancestors().filter_map(|part| Some(part.file_stem()?.to_string_lossy()));
    let mut roles = names.take(MAX_LEVELS).enumerate().filter_map(|(level, name)| {
        let role = Role::of_name(&name);
        (level < 2 || Role::is_name_only(&name)).then_some(role).filter(|role| *role != Role::Unstated)
    });
    roles.next().unwrap_or_default()
}

/// Returns the units of whole numbers like those of this map: a file of its recording or beside its picture states them, or
/// they are those of the kind of recording, where that may be assumed; those for the map `only`, or for all of the recording.
/// `None` if the map belongs to nothing.
///
/// # Errors
/// The file is faulty, or states several scales for all.
pub(super) fn scale_beside(
    path: &Path,
    samples: Samples,
    only: Option<&Path>,
) -> Result<Option<StatedUnits>, PictureFault> {
    let Some(scale) = Scale::of_map(path) else { return Ok(None) };
    let stated = scale.read(only).map_err(|error| PictureFault::Scale(Box::new(error)))?;
    Ok(Some(stated).filter(|stated| samples == Samples::Sixteen || !stated.are_assumed))
}
