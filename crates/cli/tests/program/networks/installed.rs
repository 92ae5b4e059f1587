//! Networks that are known: fetched, checked, installed.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use bokehcam::depth::single_camera::{Hints, SingleCamera};
use bokehcam::frame::DepthMap;
use bokehcam::network::{KNOWN, Known, Runtime, Task};
use tempfile::TempDir;

use super::onnx::matte;
use super::{WEIGHTS, bokehcam, disc, read, real, written};

#[test]
fn only_known_networks_are_installed_and_nothing_of_others_is_replaced() {
    let folder = TempDir::new().unwrap();
    let file = written(&folder, "m.onnx", &matte(8, 4, WEIGHTS, 0.0));
    let ran = bokehcam(&["models", "add", file.to_str().unwrap()], folder.path());
    assert_eq!(ran.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ran.stderr).contains("none of the networks that are known"));
    let listed = String::from_utf8(bokehcam(&["models"], folder.path()).stdout).unwrap();
    for known in &KNOWN {
        assert!(listed.contains(known.address) && listed.contains(known.sha256), "{}", known.file);
    }
    assert!(!listed.contains("here     /"));
}

/// A client that brings what a test wants, and says how it was called.
fn client(folder: &Path, content: &Path) {
    let program = folder.join("curl");
    fs::write(&program, format!("#!/bin/sh\necho \"called with $*\" >&2\ncat {}\n", content.display())).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn what_is_fetched_is_checked_and_how_is_shown() {
    let folder = TempDir::new().unwrap();
    let get = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
        command.args(["models", "get"]).args(arguments).env("XDG_DATA_HOME", folder.path().join("data"));
        let path = format!("{}:/usr/bin:/bin", folder.path().display());
        let ran = command.env("XDG_DATA_DIRS", folder.path()).env("PATH", path).output().unwrap();
        (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
    };
    client(folder.path(), &written(&folder, "other", b"<html>not found</html>"));
    let (code, said) = get(&[]);
    assert!(code == Some(1) && said.contains("is not kept") && said.contains(KNOWN[0].address), "{said}");
    assert!(said.find("curl --fail").unwrap() < said.find("called with").unwrap(), "{said}");
    // Endless, and far too much.
    client(folder.path(), Path::new("/dev/zero"));
    let (code, said) = get(&["tcmonodepth-small"]);
    assert!(code == Some(1) && said.contains("is not kept"), "{said}");
    assert!(!folder.path().join("data").exists());
    let (code, said) = get(&["nothing"]);
    assert!(code == Some(2) && said.contains(KNOWN[0].file), "{said}");
}

/// The networks that users are pointed to.
#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models"]
fn the_known_networks_run_and_are_installed() {
    let data = std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data");
    let files = || fs::read_dir(Path::new(&data).join("models")).unwrap().flatten().map(|entry| entry.path());
    let home = TempDir::new().unwrap();
    let (color, _) = disc(320, 240, (160.0, 120.0), 70.0);
    for file in files() {
        let Some(known) = Known::of(&fs::read(&file).unwrap()) else { continue };
        let (matte, mono) = if known.task == Task::Matte { (Some(&*file), None) } else { (None, Some(&*file)) };
        let mut camera = SingleCamera::open(matte, mono, &Hints::default(), Runtime::BuiltIn)
            .unwrap_or_else(|error| panic!("{}: {error}", known.file));
        assert!(read(&mut camera, &color, 0).metres.iter().all(|&metres| DepthMap::is_known(metres)));
        let ran = bokehcam(&["models", "add", file.to_str().unwrap()], home.path());
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        assert!(home.path().join("bokehcam/models").join(known.file).is_file());
        // Again changes nothing; and not over what is another's.
        assert!(bokehcam(&["models", "add", file.to_str().unwrap()], home.path()).status.success());
    }
    let best = real::model(Task::Matte);
    let known = Known::of(&fs::read(&best).unwrap()).unwrap();
    let foreign = home.path().join("bokehcam/models").join(known.file);
    fs::write(&foreign, "mine").unwrap();
    let ran = bokehcam(&["models", "add", best.to_str().unwrap()], home.path());
    assert_eq!((ran.status.code(), fs::read_to_string(&foreign).unwrap().as_str()), (Some(1), "mine"));
}
