//! Commands about cameras, and the machine report of `doctor`, meant for publication.

use std::fs;

use crate::program::{Home, Ran, run};

/// The report contains neither user nor host names, even if they occur in the collected information.
#[test]
fn a_report_names_no_user_and_no_machine() {
    let home = Home::at(tempfile::Builder::new().prefix("planted-user").tempdir().unwrap());
    let user = home.0.path().file_name().unwrap().to_str().unwrap();
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    // The session type is printed verbatim.
    let planted = format!("x11 {} {user} {} /home/somebody/x", home.0.path().display(), host.trim());
    let file = home.path("report.md");
    let report = |args: &[&str]| {
        let mut command = home.command(args);
        Ran::of(command.env("HOME", home.0.path()).env("USER", user).env("XDG_SESSION_TYPE", &planted))
    };
    assert!(report(&["doctor"]).stdout.contains(&planted), "it is not where it would be told");

    let written = report(&["doctor", "--report", "report.md"]);
    assert!(written.done().contains("report.md"), "{}", written.stderr);
    assert_eq!(fs::read_to_string(&file).unwrap(), written.stdout);
    assert!(written.stdout.contains("session x11 ~ (user)"), "{}", written.stdout);
    for name in [home.0.path().to_str().unwrap(), user, "somebody"] {
        assert!(!written.stdout.contains(name), "{name}: {}", written.stdout);
    }
    // A host name that equals a common word, such as the distribution's name, is not redacted.
    let is_common = ["localhost", "linux", "debian", "ubuntu", "fedora"].contains(&host.trim());
    let is_told = written.stdout.split_whitespace().any(|word| word == host.trim());
    assert!(is_common || !is_told, "{}", written.stdout);
    let parts = [
        "### Machine",
        "### Cameras",
        "### What doctor found",
        "### Time of the blur\n\n```text\nsize ",
        "### A run of ten seconds\n\n```text\nbokehcam stream ",
        " frames delivered in ",
        "blur ms: p50 ",
    ];
    for part in parts {
        assert!(written.stdout.contains(part), "{part}: {}", written.stdout);
    }

    fs::write(&file, "mine").unwrap();
    let refused = report(&["doctor", "--report", "report.md"]);
    assert_eq!((refused.code, refused.stdout.as_str()), (1, ""), "{}", refused.stderr);
    assert!(refused.stderr.contains("report.md exists") && !refused.stderr.contains("--force"), "{}", refused.stderr);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
}

#[test]
fn a_virtual_camera_that_is_not_there_is_refused_with_the_way_to_make_one() {
    let refused = run(&["stream", "synthetic", "--size", "64x48", "--frames", "1", "--to", "/dev/video199"]);
    refused.refused(1, &["sudo modprobe v4l2loopback devices=1 video_nr=199"]);
}

#[test]
fn devices_are_listed_or_the_way_to_help_is_named() {
    let (text, json) = (run(&["devices"]), run(&["devices", "--json", "--controls"]));
    assert_eq!((text.code, json.code, json.stderr.as_str()), (0, 0, ""), "{}", text.stderr);
    let list = json.json();
    let told: Vec<_> =
        ["cameras", "virtual_cameras"].iter().flat_map(|group| list[group].as_array().unwrap()).collect();
    for device in &told {
        let path = device["path"].as_str().unwrap();
        assert!(path.starts_with("/dev/") && text.stdout.contains(path), "{device}");
        assert!(device["formats"].is_array() && device["controls"].is_array(), "{device}");
    }
    if told.is_empty() && list["pipewire"].is_null() {
        assert_eq!((text.stdout.as_str(), text.stderr.lines().count()), ("", 1));
        assert!(text.stderr.contains("bokehcam doctor"), "{}", text.stderr);
    }
}

#[test]
fn a_device_that_is_not_there_costs_one_line() {
    for (name, said) in [
        ("no camera has this name", "there is no camera 'no camera has this name'"),
        ("/dev/video4711", "there is no camera '/dev/video4711'"),
        ("/dev/null", "not a video device"),
        ("/etc/hostname", "not a device node"),
    ] {
        run(&["devices", name]).refused(1, &[said]);
    }
}

#[test]
fn the_doctor_has_a_fix_for_what_is_not_good() {
    // One home: the folder for sockets is part of what is found.
    let home = Home::new();
    let (text, json) = (home.run(&["doctor"]), home.run(&["doctor", "--json"]));
    let told = json.json();
    let findings = told["findings"].as_array().unwrap();
    for about in ["camera", "virtual camera", "blur", "programs"] {
        assert!(findings.iter().any(|finding| finding["about"] == about), "{about}: {told}");
    }
    for finding in findings {
        assert_eq!(finding["level"] == "good", finding["fix"].is_null(), "{finding}");
        assert!(text.stdout.contains(finding["found"].as_str().unwrap()), "{finding}: {}", text.stdout);
    }
    let missing = |about| findings.iter().any(|finding| finding["about"] == about && finding["level"] == "missing");
    let ready = !missing("camera") && !missing("virtual camera");
    assert_eq!(told["ready"], ready);
    for ran in [&text, &json] {
        assert_eq!((ran.code, ran.stderr.lines().count()), if ready { (0, 0) } else { (1, 1) }, "{}", ran.stderr);
    }
    let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap();
    assert!(text.stdout.lines().next().unwrap().contains(kernel.trim()), "{}", text.stdout);
}

#[test]
fn what_a_camera_cannot_do_is_said_in_one_line() {
    let cases: [(&[&str], i32, &str); 6] = [
        (&["--pace", "asap"], 2, "leave --pace out"),
        (&["--start", "1"], 2, "--loop are for recordings and videos: a camera never ends"),
        (&["--control", "exposure"], 2, "NAME=VALUE"),
        (&["--format", "MJPEG"], 2, "such as MJPG"),
        (&["--fps", "0"], 2, "from 0.1 to 1000"),
        // A device that is not a camera.
        (&["--control", "a=1,b=2", "--format", "YUYV", "--size", "640x480"], 1, "/dev/null: this is not a camera"),
    ];
    for (more, code, told) in cases {
        println!("{more:?}");
        run(&[&["stream", "/dev/null", "--to", "null"], more].concat()).refused(code, &[told]);
    }
}
