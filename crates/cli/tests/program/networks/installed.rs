//! Known networks: download, verification and installation.

use std::fs;
use std::path::Path;

use bokehcam::frame::DepthMap;
use bokehcam_networks::network::{KNOWN_NETWORKS, KnownNetwork, Task};
use bokehcam_networks::single_camera::{Hints, SingleCamera};

use super::onnx::matte;
use super::{WEIGHTS, disc, read, real, written};
use crate::program::{Home, Ran};

#[test]
fn only_known_networks_are_installed_and_nothing_of_others_is_replaced() {
    let home = Home::new();
    written(&home.0, "m.onnx", &matte(8, 4, WEIGHTS, 0.0));
    home.run(&["models", "add", "m.onnx"]).failed(1, &["not a known network"]);
    let listed = home.run(&["models"]).stdout;
    for known in &KNOWN_NETWORKS {
        assert!(listed.contains(known.address) && listed.contains(known.sha256), "{}", known.file);
    }
    assert!(!listed.contains("here     /"));
}

/// Adds a fake `curl` that outputs `content` and logs its arguments.
fn client(home: &Home, content: &Path) {
    home.add_program("curl", &format!("echo \"called with $*\" >&2\ncat {}", content.display()));
}

#[test]
fn what_is_fetched_is_checked_and_how_is_shown() {
    let home = Home::new();
    let get = |arguments: &[&str]| {
        let path = format!("{}:/usr/bin:/bin", home.arg("bin"));
        Ran::of(home.command(&[&["models", "get"], arguments].concat()).env("PATH", path))
    };
    client(&home, &written(&home.0, "other", b"<html>not found</html>"));
    let ran = get(&[]);
    let said = ran.failed(1, &["was discarded", KNOWN_NETWORKS[0].address]);
    assert!(said.find("curl --fail").unwrap() < said.find("called with").unwrap(), "{said}");
    // An endless download.
    client(&home, Path::new("/dev/zero"));
    get(&["tcmonodepth-small"]).failed(1, &["was discarded"]);
    assert!(!home.path("data").exists());
    get(&["nothing"]).failed(2, &[KNOWN_NETWORKS[0].file]);
}

/// The networks recommended to users.
#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models"]
fn the_known_networks_run_and_are_installed() {
    let data = std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data");
    let files = || fs::read_dir(Path::new(&data).join("models")).unwrap().flatten().map(|entry| entry.path());
    let home = Home::new();
    let add = |file: &Path| home.run(&["models", "add", file.to_str().unwrap()]);
    let (color, _) = disc(320, 240, (160.0, 120.0), 70.0);
    for file in files() {
        let Some(known) = KnownNetwork::identify(&fs::read(&file).unwrap()) else { continue };
        let (matte, mono) = if known.task == Task::Matte { (Some(&*file), None) } else { (None, Some(&*file)) };
        let mut camera = SingleCamera::open(matte, mono, &Hints::default())
            .unwrap_or_else(|error| panic!("{}: {error}", known.file));
        assert!(read(&mut camera, &color, 0).metres.iter().all(|&metres| DepthMap::is_known(metres)));
        add(&file).done();
        assert!(home.path("data/bokehcam/models").join(known.file).is_file());
        // Adding a network again changes nothing.
        add(&file).done();
    }
    let best = real::model(Task::Matte);
    let known = KnownNetwork::identify(&fs::read(&best).unwrap()).unwrap();
    let foreign = home.path("data/bokehcam/models").join(known.file);
    fs::write(&foreign, "mine").unwrap();
    assert_eq!((add(&best).code, fs::read_to_string(&foreign).unwrap().as_str()), (1, "mine"));
}
