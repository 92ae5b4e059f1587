//! `depth` of one picture: extracts the depth inside a photo.

use super::DepthCommand;
use crate::error::CliError;
use crate::files::{create_parent_folder, warn_of_leftovers};
use crate::log;
use crate::options::Global;
use crate::terminal;
use bokehcam::frame::DepthMap;
use bokehcam_live::source::options::DEPTH_SCALE;
use bokehcam_media::recording::depth_file::{DepthFile, DepthInside, Distances, has_other_view, read_inside};
use bokehcam_media::recording::still;

/// Extracts the depth inside the photo.
///
/// # Errors
/// The photo cannot be read, has no depth inside, or the result cannot be written.
pub(super) fn extract(command: &DepthCommand, global: &Global) -> Result<(), CliError> {
    let (photo, out) = (&command.left, &command.out);
    let size = still::read_color(photo)?.size();
    let Some(DepthInside { depth, kind, .. }) = read_inside(photo, size)? else {
        if has_other_view(photo) {
            return Err(CliError::Usage(format!(
                "{0}: there is no depth inside, but a picture of another camera; take both out, and give them as left and \
                 right: exiftool -b -mpimage2 {0} >right.jpg",
                photo.display()
            )));
        }
        return Err(CliError::Usage(format!(
            "{}: there is no depth inside; give the picture of the right camera, too, or depth by a network: render \
             PHOTO --depth mono",
            photo.display()
        )));
    };
    let DepthFile { map, distances, notes } = depth;
    notes.iter().for_each(|note| log::note(&format!("{}: {note}", photo.display())));
    if distances == Distances::Relative {
        log::note(&format!("{}: its distances have no unit; their ratios are right", photo.display()));
    }
    create_parent_folder(out)?;
    warn_of_leftovers([out.as_path()]);
    still::write_depth(out, &map, fitting_scale(&map), command.output.force)?;
    if !global.quiet {
        terminal::print_to_stderr(&format!("{}: written ({}x{}, {kind})", out.display(), map.width, map.height));
    }
    Ok(())
}

/// Returns the units per metre of a PNG that holds the whole map: the usual ones, or fewer.
fn fitting_scale(map: &DepthMap) -> f32 {
    let farthest = map.metres.iter().copied().fold(DepthMap::MIN_M, f32::max);
    DEPTH_SCALE.min(f32::from(u16::MAX) / farthest)
}
