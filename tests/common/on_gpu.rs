//! What the tests of depth on a GPU share: a device, the bundled recording run by the program, and the times of passes.
#![allow(missing_docs)]

use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use bokehcam::compute::{Device, PassTimes};
use serde_json::Value;

pub fn device() -> Arc<Device> {
    Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"))
}

pub fn portrait() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/portrait"))
}

/// Streams the recording to nowhere, with these arguments; what the program said, and its report.
pub fn streamed(arguments: &[&str]) -> (String, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.env("XDG_CONFIG_HOME", folder.path()).arg("stream").arg(portrait()).args(arguments);
    let output = command.args(["--pace", "asap", "--to", "null", "--report"]).arg(&report).output();
    let output = output.expect("the program");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    let report = std::fs::read_to_string(report).expect("a report");
    (told, serde_json::from_str(&report).expect("JSON"))
}

/// The size of pictures whose passes are timed: `BOKEHCAM_SIZE=1280x720`, or a small one.
pub fn size_of_timed() -> (u32, u32) {
    let wanted = std::env::var("BOKEHCAM_SIZE").unwrap_or_else(|_| "160x120".to_owned());
    let (width, height) = wanted.split_once('x').expect("BOKEHCAM_SIZE: COLUMNSxROWS");
    let [width, height] = [width, height].map(|side| side.parse().expect("BOKEHCAM_SIZE: COLUMNSxROWS"));
    (width, height)
}

/// Prints the times of a frame that took so long as a whole: its passes take no longer.
pub fn tell_of_passes(device: &Device, whole: Duration, passes: &PassTimes) {
    eprintln!("{}: {whole:?} {:?}", device.name, passes.iter().collect::<Vec<_>>());
    assert!(passes.iter().map(|(_, time)| time).sum::<Duration>() <= whole);
    assert_eq!(passes.iter().count() > 0, device.timestamps);
}
