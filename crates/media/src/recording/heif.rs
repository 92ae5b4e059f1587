//! HEIC pictures through the program `heif-convert` (package libheif-examples), which has their decoder.

use std::ffi::OsStr;
use std::fs;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use image::metadata::Orientation;
use tempfile::TempDir;

use super::coded;
use super::fault::PictureFault;
use super::file_kind::{self, FileKind};
use super::photo_metadata::PhotoMetadata;
use bokehcam_files::guardian::Guardian;
use bokehcam_files::process::{self, Process};

const PROGRAM: &str = "heif-convert";
/// Lists the pictures of a file; of the same package.
const LISTING_PROGRAM: &str = "heif-info";
/// Time after which the program counts as hung; the largest pictures take some seconds.
const TIMEOUT: Duration = Duration::from_secs(60);
/// The name of the converted picture. Several pictures are numbered, `picture-1.png`, and each one's depth is
/// `picture-depth.png`.
const PICTURE: &str = "picture.png";

/// A converted picture, in a temporary folder that is removed with it, or when this program is killed.
pub(super) struct Converted {
    _folder: TempDir,
    _guardian: Option<Guardian>,
    /// A PNG, upright, as its EXIF says.
    pub(super) picture: PathBuf,
    /// A PNG of its depth, if there is any; with XMP by newer versions of the program.
    pub(super) depth: Option<PathBuf>,
}

/// Converts a HEIC picture, and the depth inside.
///
/// # Errors
/// The program is not installed, fails or hangs, or leaves no picture.
pub(super) fn convert(path: &Path) -> Result<Converted, PictureFault> {
    convert_by(OsStr::new(PROGRAM), path)
}

fn convert_by(program: &OsStr, path: &Path) -> Result<Converted, PictureFault> {
    let folder = TempDir::with_prefix("bokehcam-")?;
    let mut guardian = Guardian::start(folder.path()).ok();
    // An absolute path is no option, whatever its name.
    let path = path.canonicalize()?;
    let mut command = Command::new(program);
    command.arg("--with-aux").arg(&path).arg(folder.path().join(PICTURE));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = Process::start(&mut command, &Arc::default()).map_err(|error| match error.kind() {
        ErrorKind::NotFound => FileKind::fault(Some(file_kind::HEIC), ""),
        _ => PictureFault::Io(error),
    })?;
    let mut guard = |group| guardian.iter_mut().for_each(|guardian| guardian.set_group(group));
    guard(Some(process.group()));
    let ended = process.wait_at_most(TIMEOUT)?;
    guard(None);
    let status = ended.status.ok_or_else(|| PictureFault::Damaged(format!("{PROGRAM} hung, and was killed")))?;
    let find = |ending: &str| {
        let file = folder.path().join(format!("picture{ending}.png"));
        file.is_file().then_some(file)
    };
    let ending = match (find(""), find("-2")) {
        (None, Some(_)) => format!("-{}", read_primary_number(&path)),
        (None, None) => "-1".to_owned(),
        (Some(_), _) => String::new(),
    };
    match find(&ending) {
        Some(picture) if status.success() => {
            // The decoder reports a fault of the PNG.
            let _ = mark_upright(&picture);
            let depth = find(&format!("{ending}-depth"));
            Ok(Converted { picture, depth, _folder: folder, _guardian: guardian })
        }
        _ => {
            let last = ended.stderr.rsplit(" | ").next().filter(|line| !line.is_empty());
            Err(PictureFault::Damaged(format!("{PROGRAM}: {}", last.unwrap_or("it left no picture"))))
        }
    }
}

/// Returns the number, from 1, of the primary picture of a file with several: the one that viewers show. Both programs
/// list the pictures in the same order.
fn read_primary_number(path: &Path) -> usize {
    let listed = process::read_output_within(Command::new(LISTING_PROGRAM).arg(path), TIMEOUT).unwrap_or_default();
    let mut pictures = listed.lines().filter(|line| line.starts_with("image: "));
    let primary = pictures.position(|line| line.ends_with(", primary"));
    if primary.is_none() {
        let path = path.display();
        tracing::warn!("{path}: it holds several pictures, and the first is used: {LISTING_PROGRAM} names no other");
    }
    primary.unwrap_or(0) + 1
}

/// Makes the EXIF of a converted PNG say that it is upright: a HEIC picture is turned by its properties alone (`irot`), and
/// old versions of the program keep a tag that would turn it again.
fn mark_upright(picture: &Path) -> io::Result<()> {
    let file = fs::File::options().read(true).write(true).open(picture)?;
    let Some((position, exif)) = coded::read_png_exif(&file)? else { return Ok(()) };
    let mut metadata = PhotoMetadata { exif: Some(exif), ..PhotoMetadata::default() };
    if metadata.take_orientation() == Orientation::NoTransforms {
        return Ok(());
    }
    let chunk = [&b"eXIf"[..], &metadata.exif.unwrap_or_default()].concat();
    file.write_all_at(&[&chunk[4..], &crc32fast::hash(&chunk).to_be_bytes()].concat(), position)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use image::GrayImage;

    use super::super::embedded::{self, Meaning};
    use super::*;

    /// Runs a script in place of the program; `$2` is the HEIC picture and `$3` the PNG to write.
    fn convert_by_script(dir: &TempDir, script: &str) -> Result<Converted, PictureFault> {
        let program = dir.path().join("program");
        fs::write(&program, format!("#!/bin/sh\n[ \"$1\" = --with-aux ] && [ -f \"$2\" ] || exit 9\n{script}"))
            .unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        convert_by(program.as_os_str(), &dir.path().join("-in.heic"))
    }

    #[test]
    fn picture_and_depth_are_found_where_the_program_writes_them() {
        let dir = TempDir::new().unwrap();
        fs::write(dir.path().join("-in.heic"), "").unwrap();
        for (name, shade) in [("picture.png", 7), ("depth.png", 200)] {
            GrayImage::from_pixel(4, 2, [shade].into()).save(dir.path().join(name)).unwrap();
        }
        let copy =
            |from: &str, to: &str| format!("cp {}/{from} \"$(dirname \"$3\")/{to}\"\n", dir.path().to_str().unwrap());
        for (script, has_depth) in [
            (copy("picture.png", "picture.png"), false),
            (copy("picture.png", "picture.png") + &copy("depth.png", "picture-depth.png"), true),
            (copy("picture.png", "picture-1.png") + &copy("depth.png", "picture-1-depth.png"), true),
            // An auxiliary picture of another kind.
            (copy("picture.png", "picture.png") + &copy("depth.png", "picture-urn-matte.png"), false),
        ] {
            let converted = convert_by_script(&dir, &script).unwrap();
            let read = |path: &Path| image::open(path).unwrap().into_luma8().as_raw()[0];
            assert_eq!(read(&converted.picture), 7);
            assert_eq!(converted.depth.as_deref().map(read), has_depth.then_some(200));
            let embedded = embedded::of_converted(&converted).unwrap();
            assert_eq!(embedded.is_some(), has_depth);
            if let Some(embedded) = embedded {
                assert_eq!(embedded.meaning, Meaning::Disparity { min: 0.0, max: 1.0 });
                assert_eq!(embedded.original, None, "it is the picture itself");
            }
            let picture = converted.picture.clone();
            drop(converted);
            assert!(!picture.exists());
        }
    }

    #[test]
    fn a_program_that_is_missing_or_fails_is_told_in_one_line() {
        let dir = TempDir::new().unwrap();
        fs::write(dir.path().join("-in.heic"), "").unwrap();
        for (script, said) in [
            ("echo first >&2; echo Could not read HEIF >&2; exit 1", "heif-convert: Could not read HEIF"),
            ("exit 0", "it left no picture"),
            ("echo late >&2; cp \"$2\" \"$3\"; exit 3", "late"),
        ] {
            let fault = convert_by_script(&dir, script).err().unwrap().to_string();
            assert!(fault.contains(said) && !fault.contains('\n'), "{fault}");
        }
        let fault = convert_by(OsStr::new("no-such-program"), &dir.path().join("-in.heic")).err().unwrap().to_string();
        assert!(fault.contains("a HEIC picture") && fault.contains("package libheif-examples"), "{fault}");
    }
}
