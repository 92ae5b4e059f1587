//! A folder of pictures without lists, in natural order of their names, or those of a pattern such as
//! `DIR/IMG_%04d.jpg`. Depth maps may be beside them: named `NAME-depth`, `NAME.depth` or `NAME_depth`, or `NAME` with
//! another ending and grey of 16 bits; in a folder `aligned_depth`, `depth` or `depths` within or beside the folder, or in
//! `DIR-depth`.
//! Masks (`NAME-mask`) and what else belongs to pictures is left out.

mod companions;
mod pattern;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::contents::{Contents, Layout, ListedFrame, Locator, PictureSource, RecordingFolder};
use super::error::{RecordingError, Result};
use super::fault::PictureFault;
use super::folder::{Pictures, find_pictures, has_pictures, strip_suffix};
use super::rgbd::{self, Scale};
use super::{Options, decode, mask_file, timeline};
use companions::stem_of;
pub use companions::{MAP_SUFFIXES, is_companion};
pub(super) use companions::{has_picture_of, is_map};
use pattern::Pattern;

/// Any folder with pictures: the last layout to try.
pub(super) const LAYOUT: Layout = Layout {
    name: "pictures",
    expected_files: "PNG or JPEG files",
    matches: |dir| has_pictures(dir, |stem| !is_map(stem)),
    open: |folder, options| from_names(folder, find_photos(&folder.dir)?, options),
};

/// Returns the names of the pictures in `dir` without depth maps, and what else belongs to pictures that are there.
fn find_photos(dir: &Path) -> Result<Vec<String>> {
    let names = find_pictures(dir, |stem| !is_map(stem))?;
    let stems: HashSet<String> = names.iter().map(|name| stem_of(name)).collect();
    let is_mask = |name: &String| mask_file::picture_stem(&stem_of(name)).is_some_and(|photo| stems.contains(photo));
    let count = names.len();
    let (masks, mut photos): (Vec<String>, Vec<String>) = names.into_iter().partition(is_mask);
    let all = photos.clone();
    photos.retain(|name| !is_companion(&dir.join(name)));
    // Grey pictures alone are what there is to play.
    let photos = if photos.is_empty() { all } else { photos };
    let dir = dir.display();
    if !masks.is_empty() {
        tracing::warn!("{dir}: {} masks of pictures are left out: they are for `render --mask`", masks.len());
    }
    let others = count - masks.len() - photos.len();
    if others > 0 {
        tracing::warn!("{dir}: {others} grey pictures that belong to others by their names are not played as pictures");
    }
    Ok(photos)
}

/// Returns whether `dir` has pictures and their depth maps.
pub(super) fn has_own_maps(dir: &Path) -> bool {
    has_pictures(dir, |stem| !is_map(stem)) && find_maps(dir).is_some()
}

/// Returns the folder of a pattern's pictures, such as `DIR` of `DIR/IMG_%04d.jpg`; `None` if the path is not a
/// pattern, or exists.
pub fn pattern_folder(path: &Path) -> Option<&Path> {
    pattern::split_pattern(path).map(|(folder, _)| folder)
}

/// Returns the folders that a recording opened by this name reads.
pub fn input_folders(path: &Path) -> Vec<PathBuf> {
    let folder = pattern_folder(path).unwrap_or(path);
    [Some(folder.to_owned()), find_maps(folder).map(|(maps, _)| maps)].into_iter().flatten().collect()
}

/// Reads the pictures of the pattern `path`, in the order of their numbers.
///
/// # Errors
/// The folder cannot be listed, or has no such picture.
pub(super) fn open_pattern(folder: &RecordingFolder, path: &Path, options: &Options) -> Result<Contents> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let number = |file: &str| Pattern::parse(&name)?.number(file);
    let mut names = find_pictures(&folder.dir, |_| true)?;
    names.retain(|file| number(file).is_some());
    names.sort_by_cached_key(|file| number(file));
    if names.is_empty() {
        return Err(RecordingError::NoMatch { folder: folder.dir.clone(), pattern: name.into_owned() });
    }
    from_names(folder, names, options)
}

/// Creates the contents from pictures in this order, with their depth maps if there are any.
fn from_names(folder: &RecordingFolder, names: Vec<String>, options: &Options) -> Result<Contents> {
    let dir = &folder.dir;
    if !options.keep_going {
        refuse_other_sizes(folder, &names)?;
    }
    let pictures = Pictures::all_in(Path::new(""));
    if let Some((maps_dir, suffix)) = find_maps(dir) {
        let maps = Pictures { suffix, ..pictures };
        let map_names = match maps_dir == *dir && suffix.is_empty() {
            true => companions::find_twin_maps(dir),
            false => maps.find_in(&maps_dir)?,
        };
        let maps_root = maps_dir.canonicalize().map_err(RecordingError::io("open the depth maps", &maps_dir))?;
        let maps_dir = if maps_dir == *dir { dir } else { &maps_root };
        let scale = Scale::of_folder(dir, pictures.folder);
        let paired = rgbd::from_pairs(dir, (pictures, names.clone()), (maps_dir, maps, map_names), scale, options);
        return match paired {
            Err(error @ RecordingError::NoNumberPairs { .. }) => {
                tracing::warn!("{error}; the pictures are used without depth");
                Ok(without_depth(dir, names, options))
            }
            contents => Ok(Contents { maps_root: Some(maps_root), ..contents? }),
        };
    }
    Ok(without_depth(dir, names, options))
}

fn without_depth(dir: &Path, names: Vec<String>, options: &Options) -> Contents {
    let rate = timeline::describe_rate(options);
    tracing::warn!("{}: {} pictures without lists, in the order of their names, {rate}", dir.display(), names.len());
    let frames = (0..).zip(names).map(|(index, name)| ListedFrame {
        time_ns: Some(timeline::numbered_time_ns(index, options)),
        color: PictureSource::from_path(name.into()),
        right: None,
        depth: None,
    });
    Contents { frames: frames.collect(), are_photos: true, ..Contents::default() }
}

/// Returns the folder of the depth maps for the pictures in `dir`, and the suffix of their stems.
fn find_maps(dir: &Path) -> Option<(PathBuf, &'static str)> {
    let stems: Vec<String> = find_pictures(dir, is_map).ok()?.iter().map(|name| stem_of(name).to_lowercase()).collect();
    let count = |suffix: &&str| stems.iter().filter(|stem| stem.ends_with(*suffix)).count();
    // The first of those that most maps have.
    if let Some(suffix) = MAP_SUFFIXES.into_iter().rev().max_by_key(count).filter(|_| !stems.is_empty()) {
        return Some((dir.to_owned(), suffix));
    }
    if !companions::find_twin_maps(dir).is_empty() {
        return Some((dir.to_owned(), ""));
    }
    let absolute = std::path::absolute(dir).ok()?;
    let (name, parent) = (absolute.file_name()?.to_str()?, absolute.parent()?);
    // A folder of any other name is no part of a recording with the folder beside it.
    let is_part = rgbd::COLOR_FOLDERS.contains(&name);
    let within = rgbd::DEPTH_FOLDERS.map(|folder| dir.join(folder));
    let beside = rgbd::DEPTH_FOLDERS.into_iter().filter(|_| is_part).map(|folder| parent.join(folder));
    // Of `NAME_rgb`, `NAME_depth` (RTAB-Map).
    let base =
        ["_rgb", "-rgb", "_color", "-color"].iter().find_map(|suffix| strip_suffix(name, suffix)).unwrap_or(name);
    let named = [name, base].map(|base| [format!("{base}-depth"), format!("{base}_depth")]);
    let named = named.iter().flatten().map(|folder| parent.join(folder));
    let mut folders = within.into_iter().chain(beside).chain(named);
    folders.find(|folder| has_pictures(folder, |_| true)).map(|folder| (folder, ""))
}

/// Refuses pictures of another size than the first. A picture without a readable header is reported when it is read.
fn refuse_other_sizes(folder: &RecordingFolder, names: &[String]) -> Result<()> {
    let (mut expected, mut locator) = (None, Locator::new(folder));
    for name in names {
        let source = PictureSource::from_path(name.into());
        let Ok(found) = decode::read_upright_size(&locator.locate(&source)?) else { continue };
        let expected = *expected.get_or_insert(found);
        if found != expected {
            return Err(source.error(&folder.dir, PictureFault::Size { found, expected }));
        }
    }
    Ok(())
}
