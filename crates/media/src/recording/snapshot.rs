//! Snapshots: a blurred picture with its settings inside, optionally with its input files.
//!
//! `NAME.png` holds the settings as a text (keyword [`KEYWORD`]) of lines `--flag=value`, the version of the program
//! (`Software`) and the kind of the source (`Source`). `NAME-color.png` is the picture before the blur, `NAME-depth.pfm`
//! the depth that the blur used, in metres. The inputs are never inside `NAME.png`, which may be given away: they show the
//! room behind the blur.

use std::fs;
use std::io::ErrorKind;
use std::path::{self, Path, PathBuf};

use super::coded;
use super::decoders::guard;
use super::error::RecordingError;
use super::fault::PictureFault;
use super::fault::png_fault;
use super::still::{PhotoFormat, photo_format, write_color, write_depth};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_files::data::absolute_env_path;
use bokehcam_files::{atomic_file, user_folders};

/// The keyword of the PNG text with the settings.
pub const KEYWORD: &str = "bokehcam";

/// The content of a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// The blurred picture.
    pub picture: &'a ColorImage,
    /// The inputs to save, if any: the picture before the blur, and its depth, if there is one.
    pub sources: Option<(&'a ColorImage, Option<&'a DepthMap>)>,
    /// The settings, as flags without dashes and their values.
    pub settings: &'a [(&'static str, String)],
    /// The kind of the source, such as `camera`: no name, as names contain paths and serial numbers.
    pub source: &'a str,
}

impl Snapshot<'_> {
    /// Returns the file of the picture, for `path` in messages.
    fn encode(&self, path: &Path) -> Result<Vec<u8>, RecordingError> {
        let unfit = |what: String| RecordingError::picture(path)(PictureFault::Encoding(what));
        if self.settings.iter().any(|(_, value)| value.contains(['\n', '\r'])) {
            return Err(unfit("a setting has a line break in it".to_owned()));
        }
        let mut png = Vec::new();
        encode(self, &mut png).map_err(|error| unfit(error.to_string()))?;
        Ok(png)
    }
}

/// Saves a frame as `dir/stem.png` with its input files. If one of the names exists, uses the first free one of
/// `stem-2`, `stem-3` and so on. Creates the folder. Returns the path of the picture. The picture is written last, so
/// its inputs exist whenever it does. On failure no file remains.
///
/// # Errors
/// The folder or a file cannot be written; `stem` is not a plain file name; a setting has a line break.
pub fn save(dir: &Path, stem: &str, snapshot: &Snapshot) -> Result<PathBuf, RecordingError> {
    let all = dir.join(stem);
    if Path::new(stem).file_name() != Some(stem.as_ref()) {
        return Err(RecordingError::picture(&all)(PictureFault::Encoding("its name is not a file name".to_owned())));
    }
    let png = snapshot.encode(&all)?;
    fs::create_dir_all(dir).map_err(RecordingError::io("create", dir))?;
    for number in 1u32.. {
        let name = if number == 1 { format!("{stem}.png") } else { format!("{stem}-{number}.png") };
        let path = dir.join(name);
        match write(&path, snapshot, &png) {
            Err(RecordingError::Exists { .. }) => {}
            written => return written.map(|()| path),
        }
    }
    Err(RecordingError::io("create", &all)(ErrorKind::AlreadyExists.into()))
}

/// Saves a frame as the file `path`, as [`save`] does. In a format other than PNG there is only the picture, without
/// settings. Creates the folder.
///
/// # Errors
/// The extension is that of no picture; one of the files exists, or cannot be written; a setting has a line break.
pub fn save_as(path: &Path, snapshot: &Snapshot) -> Result<(), RecordingError> {
    let png = match photo_format(path)? {
        PhotoFormat::Png => Some(snapshot.encode(path)?),
        _ => None,
    };
    if let Some(dir) = path.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        fs::create_dir_all(dir).map_err(RecordingError::io("create", dir))?;
    }
    png.map_or_else(|| write_color(path, snapshot.picture, false), |png| write(path, snapshot, &png))
}

/// Writes the picture and its input files, or none of them.
fn write(path: &Path, snapshot: &Snapshot, png: &[u8]) -> Result<(), RecordingError> {
    let (color, depth) = source_paths(path);
    if let Some(taken) = [path, &color, &depth].into_iter().find(|path| path.symlink_metadata().is_ok()) {
        return Err(RecordingError::Exists { path: taken.to_owned() });
    }
    // Only these are removed on failure, as another process may write files of the same names.
    let mut written_files = Vec::new();
    let sources_written = snapshot.sources.map_or(Ok(()), |(before, map)| {
        write_color(&color, before, false)?;
        written_files.push(&color);
        map.map_or(Ok(()), |map| write_depth(&depth, map, 1.0, false).map(|()| written_files.push(&depth)))
    });
    let written = sources_written.and_then(|()| {
        atomic_file::write(path, png, false).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => RecordingError::Exists { path: path.to_owned() },
            _ => RecordingError::io("write", path)(error),
        })
    });
    if written.is_err() {
        // Report the first failure only.
        written_files.into_iter().for_each(|file| drop(fs::remove_file(file)));
    }
    written
}

/// Suffixes that replace `.png` in the names of the input files.
const COLOR: &str = "-color.png";
const DEPTH: &str = "-depth.pfm";

/// Returns the paths of a snapshot's input files: the picture before the blur, and its depth. They need not exist.
pub fn source_paths(path: &Path) -> (PathBuf, PathBuf) {
    (sibling_path(path, COLOR), sibling_path(path, DEPTH))
}

fn sibling_path(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}

/// Reads the settings from a snapshot, as flags without dashes and their values.
///
/// # Errors
/// The file is missing, not a PNG, damaged, or contains no settings.
pub fn read_settings(path: &Path) -> Result<Vec<(String, String)>, RecordingError> {
    read_text(path).and_then(|text| parse_settings(&text)).map_err(RecordingError::picture(path))
}

/// The prefixes of settings that name a file, and the prefix of a path in the home folder.
const FILES: [&str; 2] = ["image:", "video:"];
const HOME: &str = "~/";

/// Writes the path of a file that a setting names so that it is found from any folder, and without the user's name.
fn hide_home(value: &str) -> String {
    let file = FILES.iter().find_map(|kind| Some((kind, path::absolute(value.strip_prefix(kind)?).ok()?)));
    file.map_or_else(|| value.to_owned(), |(kind, file)| format!("{kind}{}", user_folders::format_path(&file)))
}

/// Undoes [`hide_home`], for the present user.
fn resolve_home(value: &str) -> String {
    let inside = FILES.iter().find_map(|kind| Some((kind, value.strip_prefix(kind)?.strip_prefix(HOME)?)));
    let file = inside.and_then(|(kind, inside)| Some((kind, absolute_env_path("HOME")?.join(inside))));
    file.map_or_else(|| value.to_owned(), |(kind, file)| format!("{kind}{}", file.display()))
}

/// Parses lines of `--name=value`.
fn parse_settings(text: &str) -> Result<Vec<(String, String)>, PictureFault> {
    let setting = |line: &str| {
        let (name, value) = line.strip_prefix("--")?.split_once('=')?;
        Some((name.to_owned(), resolve_home(value)))
    };
    let short = |line: &str| line.chars().take(40).collect::<String>();
    let parsed = |line| {
        setting(line).ok_or_else(|| PictureFault::Damaged(format!("its setting {:?} is not --NAME=VALUE", short(line))))
    };
    text.lines().filter(|line| !line.trim().is_empty()).map(parsed).collect()
}

/// Reads the settings from a PNG as text. Other programs may have rewritten the iTXt chunk as tEXt or zTXt.
fn read_text(path: &Path) -> Result<String, PictureFault> {
    let info = coded::read_png_info(path)?;
    if let Some(chunk) = info.utf8_text.iter().find(|chunk| chunk.keyword == KEYWORD) {
        return guard(|| chunk.get_text().map_err(png_fault));
    }
    // Programs that save the file again may store the text in another kind of chunk.
    let plain = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD);
    let packed = info.compressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD);
    match (plain, packed) {
        (Some(chunk), _) => Ok(chunk.text.clone()),
        (None, Some(chunk)) => guard(|| chunk.get_text().map_err(png_fault)),
        (None, None) => Err(PictureFault::NoSettings),
    }
}

/// Appends the blurred picture to `file` as PNG, with the settings as text.
fn encode(snapshot: &Snapshot, file: &mut Vec<u8>) -> Result<(), png::EncodingError> {
    let lines = snapshot.settings.iter().map(|(name, value)| format!("--{name}={}\n", hide_home(value)));
    let mut encoder = png::Encoder::new(file, snapshot.picture.width, snapshot.picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Paeth);
    encoder.add_itxt_chunk(KEYWORD.to_string(), lines.collect())?;
    encoder.add_text_chunk("Software".to_string(), concat!("bokehcam ", env!("CARGO_PKG_VERSION")).to_string())?;
    encoder.add_text_chunk("Source".to_string(), snapshot.source.to_string())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&snapshot.picture.rgb)?;
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_tells_what_made_it_and_not_who() {
        let folder = tempfile::tempdir().unwrap();
        let home = absolute_env_path("HOME").expect("tests have a home");
        let wall = format!("image:{}", home.join("walls/sea.jpg").display());
        let here = format!("image:{}", path::absolute("heart.png").unwrap().display());
        let settings =
            [("behind", wall.clone()), ("aperture", "image:heart.png".to_owned()), ("rim", "0.5".to_owned())];
        let picture = ColorImage::new(4, 3);
        let shot = Snapshot { picture: &picture, sources: None, settings: &settings, source: "camera" };
        let path = folder.path().join("new/me.png");
        save_as(&path, &shot).unwrap();
        let info = coded::read_png_info(&path).unwrap();
        let text = info.utf8_text[0].get_text().unwrap();
        assert!(text.contains("--behind=image:~/walls/sea.jpg\n"), "{text}");
        let plain: Vec<_> = info.uncompressed_latin1_text.iter().map(|chunk| (&*chunk.keyword, &*chunk.text)).collect();
        assert_eq!(plain, [("Software", concat!("bokehcam ", env!("CARGO_PKG_VERSION"))), ("Source", "camera")]);
        let read = read_settings(&path).unwrap();
        let read: Vec<_> = read.iter().map(|(name, value)| (&**name, &**value)).collect();
        assert_eq!(read, [("behind", &*wall), ("aperture", &*here), ("rim", "0.5")]);

        // Other formats hold the picture alone; nothing is replaced.
        let jpeg = folder.path().join("me.jpg");
        save_as(&jpeg, &shot).unwrap();
        assert!(read_settings(&jpeg).is_err());
        for taken in [&path, &jpeg] {
            let before = fs::read(taken).unwrap();
            assert!(matches!(save_as(taken, &shot), Err(RecordingError::Exists { .. })));
            assert_eq!(fs::read(taken).unwrap(), before);
        }
        assert!(save_as(&folder.path().join("none/me.txt"), &shot).is_err() && !folder.path().join("none").exists());
    }
}
