//! Pictures that belong to others in their folder: depth maps, masks and confidence, by name and content.

use std::collections::HashMap;
use std::path::Path;

use super::super::decode::{self, PictureKind};
use super::super::folder::{ENDINGS, find_pictures, has_pictures, strip_suffix};
use super::super::role::Role;

/// What follows a picture's stem in the name of its depth map.
pub const MAP_SUFFIXES: [&str; 3] = ["-depth", ".depth", "_depth"];

/// Returns whether a stem ends as those of depth maps do, in whichever case.
pub(in crate::recording) fn is_map(stem: &str) -> bool {
    MAP_SUFFIXES.iter().any(|suffix| strip_suffix(stem, suffix).is_some())
}

/// Returns whether a picture belongs to another one beside it: its name ends as those of depth maps do; or it is grey, and
/// its name says that it holds depth or what is measured beside it, or is that of a picture in colours.
pub fn is_companion(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    // Names first: a header is a file to open.
    is_map(&stem)
        || (!matches!(Role::of_name(&stem), Role::Unstated | Role::Infrared) || has_color_twin(path)) && is_grey(path)
}

/// Returns whether a file is the depth map of a picture beside it, by its name.
pub(in crate::recording) fn has_picture_of(map: &Path) -> bool {
    let stem = map.file_stem().unwrap_or_default().to_string_lossy();
    let folder = map.parent().unwrap_or(Path::new(""));
    is_map(&stem) && has_pictures(folder, |stem| !is_map(stem)) || has_color_twin(map) && is_grey(map)
}

/// Returns the names of the depth maps in `dir` that have the name of a picture in colours but for its ending, and are grey
/// of 16 bits.
pub(super) fn find_twin_maps(dir: &Path) -> Vec<String> {
    let mut names = find_pictures(dir, |stem| !is_map(stem)).unwrap_or_default();
    let mut counts: HashMap<String, usize> = HashMap::new();
    names.iter().for_each(|name| *counts.entry(stem_of(name)).or_default() += 1);
    names.retain(|name| {
        let path = dir.join(name);
        counts[&stem_of(name)] > 1 && has_color_twin(&path) && kind(&path) == Some(PictureKind::Depth)
    });
    names
}

/// Returns the name of a file without its ending.
pub(super) fn stem_of(name: &str) -> String {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned()
}

fn kind(path: &Path) -> Option<PictureKind> {
    decode::read_header(path).ok().map(|(_, kind)| kind)
}

fn is_grey(path: &Path) -> bool {
    matches!(kind(path), Some(PictureKind::Depth | PictureKind::Grey))
}

fn has_color_twin(path: &Path) -> bool {
    let twins = ENDINGS.iter().flat_map(|ending| [(*ending).to_owned(), ending.to_uppercase()]);
    let mut twins = twins.map(|ending| path.with_extension(ending)).filter(|twin| twin != path);
    twins.any(|twin| twin.is_file() && kind(&twin) == Some(PictureKind::Color))
}
