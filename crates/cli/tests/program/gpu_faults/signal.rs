//! Somebody ends a run whose device does not answer.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use super::layer;

/// A device in software counts as hung after a minute.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_signal_ends_a_run_whose_device_hangs() {
    let (layer, folder) = (layer(), tempfile::tempdir().unwrap());
    let out = folder.path().join("out.y4m");
    let recording = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/portrait");
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.env("XDG_CONFIG_HOME", folder.path()).env_remove("RUST_LOG").arg("stream").arg(recording);
    command.args(["--backend", "gpu", "--loop", "--to"]).arg(&out);
    command.env("VK_LAYER_PATH", layer.path()).env("VK_INSTANCE_LAYERS", "VK_LAYER_bokehcam_faults");
    let mut child = command.env("FAULT", "hang:20").stderr(std::process::Stdio::piped()).spawn().unwrap();
    let is_part = |entry: fs::DirEntry| entry.path().extension().is_some_and(|extension| extension == "part");
    while !fs::read_dir(folder.path()).unwrap().any(|entry| is_part(entry.unwrap())) {
        std::thread::sleep(Duration::from_millis(50));
    }
    // It waits for the device soon after it has begun its file; were it slower, it would have less to wait for.
    std::thread::sleep(Duration::from_secs(5));
    let asked = std::time::Instant::now();
    rustix::process::kill_process(rustix::process::Pid::from_child(&child), rustix::process::Signal::TERM).unwrap();
    assert!(child.wait().unwrap().success());
    assert!(asked.elapsed() < Duration::from_secs(30), "{:?}", asked.elapsed());
    assert!(fs::read(&out).unwrap().starts_with(b"YUV4MPEG2"));
}
