//! Whole runs whose device is lost or hangs.

use std::fs;
use std::process::Stdio;
use std::time::Duration;

use rustix::process::Signal;

use super::{layer, under};
use crate::program::{Beside, Home, PORTRAIT, Ran, json, until};

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

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_run_ends_whole_and_says_in_one_line_what_happened() {
    let (layer, home) = (layer(), Home::new());
    let stream = ["stream", PORTRAIT, "--backend", "gpu", "--pace", "asap", "--to", "null", "--report", "report.json"];
    let ran = Ran::of(under(&layer, "submit:6", &mut home.with_drivers(&stream)));
    let told = ran.done();
    assert_eq!(told.matches("the CPU blurs from now on").count(), 1, "{told}");
    assert!(!told.contains("panicked"), "{told}");
    let report = json(home.path("report.json"));
    assert_eq!((&report["frames"]["captured"], &report["frames"]["delivered"]), (&24.into(), &24.into()), "{report}");
    assert_eq!(report["backend"], "gpu, then cpu");
    assert!(report["adapter"].as_str().unwrap().contains("; then cpu, "), "{report}");
}
