//! The pictures of a `render` of many: files, folders and patterns, and the names of their results.

use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use glob::MatchOptions;

use crate::error::CliError;
use crate::log;
use bokehcam_files::place;
use bokehcam_live::source::photo;
use bokehcam_media::recording::Photo;
use bokehcam_media::recording::still::{self, PhotoFormat};

/// As in a shell: `*` neither matches a separator nor hidden files.
const LIKE_A_SHELL: MatchOptions =
    MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };

/// Size of a HEIC picture whose header does not tell it: that of a large camera, as memory has to suffice.
const UNKNOWN_PIXELS: u64 = 50_000_000;

/// One of many pictures.
#[derive(Debug)]
pub(super) struct Picture {
    pub path: PathBuf,
    /// File of the result.
    pub target: PathBuf,
    /// Its size; [`UNKNOWN_PIXELS`], or 0 if it cannot be read.
    pub pixels: u64,
}

/// Returns whether a command renders many pictures into a folder.
pub(super) fn is_many(images: &[PathBuf], out: &Path) -> bool {
    match images {
        [] => false,
        [image] => image.is_dir() || find_pattern(image).is_some() || is_folder(out),
        _ => true,
    }
}

/// Lists the pictures of `images`, each once, with results in the folder `out`, in `format` or that of each picture. Depth
/// maps, masks and originals of snapshots among them are left out.
///
/// # Errors
/// `out` is no folder, a folder cannot be read, there is no picture, or two would have the same result.
pub(super) fn list_pictures(
    images: &[PathBuf],
    out: &Path,
    format: Option<PhotoFormat>,
) -> Result<Vec<Picture>, CliError> {
    if !is_folder(out) && (out.exists() || still::photo_format(out).is_ok()) {
        let out = out.display();
        return Err(CliError::Usage(format!(
            "--out {out}: many pictures need a folder, such as --out results/; a depth map is given by --depth-map FILE"
        )));
    }
    let (mut paths, mut seen) = (Vec::new(), HashSet::new());
    for image in images {
        let found = expand(image)?;
        if found.is_empty() {
            let image = image.display();
            return Err(CliError::Usage(format!(
                "{image}: no picture there (PNG, JPEG, TIFF, WebP, BMP or HEIC); recordings are for `stream`"
            )));
        }
        paths.extend(found.into_iter().filter(|path| seen.insert(place::resolve_links(path))));
    }
    let count = paths.len();
    paths.retain(|path| count == 1 || !photo::is_companion(path));
    match count - paths.len() {
        0 => {}
        left if left == count => {
            let what =
                "these are depth maps, masks, or pictures that belong to snapshots: name the pictures themselves";
            return Err(CliError::Usage(format!("{}: {what}", images[0].display())));
        }
        left => {
            log::note(&format!("{left} files left out by their names: depth maps, masks, or pictures of snapshots"))
        }
    }
    let result_name = |path: &Path| result_name(path, format);
    let mut owners: HashMap<OsString, &Path> = HashMap::new();
    for path in &paths {
        if let Some(other) = owners.insert(result_name(path), path) {
            let (path, other, to) = (path.display(), other.display(), out.join(result_name(path)));
            let what = format!("{other} and {path} have the same result, {}", to.display());
            return Err(CliError::Usage(format!("{what}: render them into different folders")));
        }
    }
    let measure = |path: PathBuf| {
        // A picture without a readable header fails before it takes memory, but for HEIC.
        let size = still::read_size(&path).ok().or_else(|| Photo::read_heic_size(&path));
        let unknown = if Photo::is_heic(&path) { UNKNOWN_PIXELS } else { 0 };
        let pixels = size.map_or(unknown, |(width, height)| u64::from(width) * u64::from(height));
        Picture { target: out.join(result_name(&path)), pixels, path }
    };
    Ok(paths.into_iter().map(measure).collect())
}

/// Returns whether `out` is a folder, or meant to be one.
fn is_folder(out: &Path) -> bool {
    out.is_dir() || out.as_os_str().as_encoded_bytes().ends_with(b"/")
}

/// Returns the pattern that `image` is, if it is one and no file.
fn find_pattern(image: &Path) -> Option<&str> {
    image.to_str().filter(|text| text.contains(['*', '?', '[']) && !image.exists())
}

/// Returns the pictures of a file, folder or pattern; those of the last two are sorted by name.
fn expand(image: &Path) -> Result<Vec<PathBuf>, CliError> {
    let is_picture = |path: &Path| path.is_file() && (still::photo_format(path).is_ok() || still::is_photo(path));
    if image.is_dir() {
        let entries = fs::read_dir(image).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let is_hidden = |entry: &fs::DirEntry| entry.file_name().as_encoded_bytes().starts_with(b".");
        let entries = entries.map_err(CliError::io(image))?.into_iter().filter(|entry| !is_hidden(entry));
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_picture(path)).collect();
        paths.sort();
        return Ok(paths);
    }
    let Some(pattern) = find_pattern(image) else { return Ok(vec![image.to_owned()]) };
    let matches = glob::glob_with(pattern, LIKE_A_SHELL)
        .map_err(|error| CliError::Usage(format!("{pattern}: this is no pattern: {}", error.msg)))?;
    let paths = matches.collect::<Result<Vec<_>, _>>().map_err(|error| {
        let path = error.path().to_owned();
        CliError::Io { path, source: error.into() }
    })?;
    Ok(paths.into_iter().filter(|path| is_picture(path)).collect())
}

/// Returns the file name of a picture's result: that of the picture, with the extension of `format` or its own.
fn result_name(path: &Path, format: Option<PhotoFormat>) -> OsString {
    // A picture that cannot be read is named by its extension.
    let own = || still::result_format(path).or_else(|| still::photo_format(path).ok());
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{}", format.or_else(own).unwrap_or(PhotoFormat::Png)));
    name
}
