//! Sinks by their names.

use std::fs;
use std::path::Path;

use bokehcam_live::sink::{Ending, Target};

use super::{open, options};

#[test]
fn names_become_sinks() {
    for (name, target) in [
        ("null", Target::Null),
        ("-", Target::Stdout),
        ("window", Target::Window),
        ("window/", Target::Folder("window/".into())),
        ("out/", Target::Folder("out/".into())),
        ("clip.mp4/", Target::Folder("clip.mp4/".into())),
        ("a/b.Y4M", Target::Y4m("a/b.Y4M".into())),
        ("b.mp4", Target::Video("b.mp4".into())),
        ("b.mkv", Target::Video("b.mkv".into())),
        ("b.webm", Target::Video("b.webm".into())),
        ("/dev/video10", Target::Device("/dev/video10".into())),
        ("/dev/null", Target::Device("/dev/null".into())),
        ("/dev/shm/out/", Target::Folder("/dev/shm/out/".into())),
        ("/dev/video10.mp4", Target::Video("/dev/video10.mp4".into())),
    ] {
        assert_eq!(name.parse::<Target>().unwrap(), target);
    }
    for name in ["/dev/stdout", "/dev/fd/1"] {
        assert!(name.parse::<Target>().unwrap_err().to_string().contains("standard output, use -"), "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hostname");
    fs::write(&file, "").unwrap();
    let error = file.to_str().unwrap().parse::<Target>().unwrap_err().to_string();
    assert!(error.contains("hostname is neither a folder nor a video: give DIR/, FILE.y4m"), "{error}");
    for name in ["", "clip.avi", "a.png"] {
        let error = name.parse::<Target>().unwrap_err().to_string();
        assert!(error.contains(&format!("'{name}'")) && error.contains("FILE.y4m"), "{error}");
    }
}

/// A typo in the name of a camera must not fill the disk with pictures.
#[test]
fn what_is_nothing_else_is_no_folder_and_what_was_meant_is_said() {
    for (name, meant) in [
        ("pipwire", "pipewire"),
        ("PipeWire", "pipewire"),
        ("pipwire:Desk", "pipewire:Desk"),
        ("video10", "/dev/video10"),
        ("10", "/dev/video10"),
        ("windw", "window"),
        ("nul", "null"),
    ] {
        let error = name.parse::<Target>().unwrap_err().to_string();
        assert!(error.starts_with(&format!("no sink '{name}' (did you mean {meant}?): ")), "{error}");
    }
    for name in ["out", "bokehcam", "a/b", "./window", "/dev/shm/out"] {
        let error = name.parse::<Target>().unwrap_err().to_string();
        assert!(error.starts_with(&format!("no sink '{name}': ")) && error.contains("with the slash"), "{error}");
    }
    // An existing folder is accepted with a trailing slash, or if a run wrote it.
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().to_str().unwrap().to_owned();
    let error = name.parse::<Target>().unwrap_err().to_string();
    assert!(error.contains("it is a folder") && error.contains(&format!("{name}/ (with")), "{error}");
    let mut sink = open(&folder.path().join(""), &options((6, 4))).unwrap();
    super::put_all(&mut *sink, &[super::picture(6, 4, 0)]);
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(name.parse::<Target>().unwrap(), Target::Folder(name.into()));
}

#[test]
fn a_device_has_many_names() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("camera");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    let target: Target = link.to_str().unwrap().parse().unwrap();
    assert_eq!(target, Target::Device(link.clone()));
    assert!(target.is_device(Path::new("/dev/null")) && !target.is_device(Path::new("/dev/zero")));
    assert!(target.collides_with(&Target::Device("/dev/null".into())));
    assert!(!target.collides_with(&Target::Null) && !Target::Null.collides_with(&Target::Null));
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for name in ["file/clip.y4m", "file/out/"] {
        let error = open(&folder.path().join(name), &options((6, 4))).err().unwrap().to_string();
        assert!(error.starts_with("cannot write ") && error.contains("file"), "{error}");
        assert_eq!(error.ends_with("/file: it is not a folder"), name.ends_with('/'), "{error}");
    }
}

#[test]
fn what_is_no_file_is_never_replaced_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let (pipe, dir) = (folder.path().join("pipe.y4m"), folder.path().join("dir.y4m"));
    rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR).unwrap();
    fs::create_dir(&dir).unwrap();
    for (path, what) in [(pipe, "is a pipe"), (dir, "is a folder")] {
        let sink = Target::Y4m(path.clone());
        for options in [options((6, 4)), super::forced((6, 4))] {
            let error = sink.open(&options).err().unwrap().to_string();
            assert!(error.contains(what) && error.contains("not replaced"), "{error}");
        }
        assert!(!path.metadata().unwrap().is_file());
    }
}
