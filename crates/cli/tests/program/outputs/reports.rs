//! Valid paths for a run's report, and failures to write it.

use std::fs;
use std::os::unix::fs::symlink;

use super::home::*;

#[test]
fn a_report_and_a_sink_never_share_a_place() {
    let home = Home::new();
    home.record("self", 3, 0.1);
    for (to, report) in [("x.y4m", "x.y4m"), ("x.y4m", "./self/../x.y4m"), ("x.mkv", "x.mkv")] {
        home.sh(&format!("stream self --to {to} --report {report}")).failed(2, &["writes to it, too"]);
    }
    fs::write(home.path("file"), "").unwrap();
    home.sh(&format!("stream self {BLUR} --to x.y4m --report file/r.json")).failed(1, &["file"]);
    assert!(!home.path("x.y4m").exists(), "it is known before the run");
    // Its folder is made, as that of other outputs.
    assert_eq!(home.sh(&format!("stream self {BLUR} --to x.y4m --report new/folder/r.json -q")).code, 0);
    assert!(home.path("new/folder/r.json").is_file());
}

#[test]
fn a_report_never_lies_among_the_pictures_of_an_output() {
    let home = Home::new();
    home.record("self", 3, 0.1);
    fs::create_dir_all(home.path("out/sub")).unwrap();
    symlink(home.path("out/sub"), home.path("link")).unwrap();
    let before = tree(home.0.path());
    for report in
        ["out/000001.png", "out/.bokehcam", "out/r.json", "out/sub/new/r.json", "link/r.json", "link/../r.json"]
    {
        for force in ["", "--force"] {
            let ran = home.sh(&format!("stream self {BLUR} --to null --to out/ --report {report} {force}"));
            ran.failed(2, &["that folder is for the pictures of --to out/"]);
            assert!(tree(home.0.path()) == before, "{report}");
        }
    }
    let ran = home.sh(&format!("stream self {BLUR} --to null --to out/sub/ --report out/r.json -q"));
    assert_eq!(ran.code, 0, "beside them is no harm: {ran:?}");
}

#[test]
fn a_report_replaces_no_other_file_whatever_is_forced() {
    let home = Home::new();
    home.record("self", 3, 0.1);
    home.sh(&format!("stream self {BLUR} --to old/ -q")).done();
    fs::create_dir(home.path("folder.json")).unwrap();
    symlink(home.path("self/rgb.txt"), home.path("list.txt")).unwrap();
    let before = tree(home.0.path());
    for report in ["self/rgb.txt", "self", "old/000001.png", "old/.bokehcam", "folder.json", "list.txt", "/dev/null"] {
        let is_file = home.path(report).is_file();
        let (forced, plain) = if is_file {
            (
                "is not a \
                                             report",
                "exists",
            )
        } else {
            ("is not replaced", "is not replaced")
        };
        home.sh(&format!("stream self {BLUR} --to null --report {report} --force")).failed(2, &[forced]);
        let plainly = home.sh(&format!("stream self {BLUR} --to null --report {report}"));
        plainly.failed(if is_file { 1 } else { 2 }, &[plain]);
        assert!(tree(home.0.path()) == before, "{report}");
    }
    for force in ["", "--force"] {
        home.sh(&format!("stream self {BLUR} --to null --report r.json -q {force}")).done();
        assert_eq!(json(home.path("r.json"))["frames"]["delivered"], 3);
    }
}

#[test]
fn what_came_to_the_name_of_a_report_during_the_run_stays() {
    let home = Home::new();
    home.record("self", 4, 0.05);
    for (force, to) in [("", "out/"), ("--force", "other/")] {
        let args = format!("stream self {BLUR} --loop --pace realtime --to {to} --report r.json {force}");
        let run = home.start("", &args);
        until("a picture", || home.path(to).join("000001.png").exists());
        fs::write(home.path("r.json"), "precious").unwrap();
        let ran = terminate(run);
        if force.is_empty() {
            ran.failed(1, &["r.json exists: choose another name, or give --force to overwrite it; the report is kept as r.incomplete.json"]);
            assert_eq!(fs::read(home.path("r.json")).unwrap(), b"precious");
            assert!(json(home.path("r.incomplete.json"))["frames"]["delivered"].as_u64() > Some(1));
        } else {
            ran.done();
            assert!(json(home.path("r.json"))["frames"]["delivered"].as_u64() > Some(1));
        }
    }
}

#[test]
fn a_report_that_fails_is_printed_and_does_not_hide_why_the_run_ended() {
    let home = Home::new();
    home.record("self", 4, 0.5);
    home.damage("self/rgb/000003.png");
    fs::create_dir(home.path("reports")).unwrap();
    let args = format!("stream self {BLUR} --pace realtime --to out/ --report reports/r.json");
    let run = home.start("", &args);
    until("a picture", || home.path("out/000000.png").exists());
    fs::remove_dir_all(home.path("reports")).unwrap();
    let ran = run.end(LONG);
    ran.failed(1, &["000003.png"]);
    assert!(ran.stderr.contains("the report was not written"), "{}", ran.stderr);
    let (_, printed) = ran.stderr.split_once("the report could not be saved; here it is:\n").expect("the report");
    let printed = serde_json::Deserializer::from_str(printed).into_iter::<serde_json::Value>().next();
    assert!(printed.unwrap().unwrap()["frames"]["delivered"].is_u64());
}
