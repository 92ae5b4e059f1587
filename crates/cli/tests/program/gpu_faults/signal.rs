//! A signal ends a run whose device hangs.

use std::fs;
use std::process::Stdio;
use std::time::Duration;

use rustix::process::Signal;

use super::{layer, under};
use crate::program::{Beside, Home, PORTRAIT, until};

/// For a software device, the hang timeout is one minute; the run ends earlier.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_signal_ends_a_run_whose_device_hangs() {
    let (layer, home) = (layer(), Home::new());
    let mut command = home.with_drivers(&["stream", PORTRAIT, "--backend", "gpu", "--loop", "--to", "out.y4m"]);
    let run = Beside::start(under(&layer, "hang:20", &mut command).stderr(Stdio::piped()));
    let is_part = |entry: fs::DirEntry| entry.path().extension().is_some_and(|extension| extension == "part");
    let is_begun = || fs::read_dir(home.0.path()).unwrap().any(|entry| is_part(entry.unwrap()));
    until("it begins its file", Duration::from_secs(120), is_begun);
    // The run waits for the device soon after it creates its file; on a slower machine, the remaining wait is shorter.
    std::thread::sleep(Duration::from_secs(5));
    run.end_by(Signal::TERM, Duration::from_secs(30)).done();
    assert!(fs::read(home.path("out.y4m")).unwrap().starts_with(b"YUV4MPEG2"));
}
