//! The user's files after failures and interruptions.

mod home;
mod removed;
mod reports;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::Duration;

use rustix::process::Signal;
use serde_json::Value;

use crate::program::assert_accounted;
use home::*;

#[test]
fn a_source_is_never_a_target() {
    let home = Home::new();
    home.record("self", 3, 0.1);
    std::os::unix::fs::symlink(home.path("self"), home.path("link")).unwrap();
    fs::create_dir(home.path("other")).unwrap();
    let before = tree(home.0.path());
    for args in [
        "stream self --to self/rgb/ --force",
        "stream self --to self/ --force",
        "stream link --to self/rgb/ --force",
        "stream self --to link/rgb/ --force",
        "stream self --to ./ --force",
        "stream self --to self/new/",
        "stream self --to self/clip.y4m",
        "stream self --to null --to other/../link/clip.mkv",
        "render self/rgb/000000.png --effect blur --out self/rgb/000000.png --force",
        "render self/rgb/000000.png --effect blur --out link/rgb/000000.png --force",
        "render self/rgb/000000.png --depth-map self/depth/000000.png --out self/depth/000000.png --force",
        "depth self/rgb/000000.png self/rgb/000001.png --out self/rgb/000001.png --force",
        "depth self/rgb/000000.png self/rgb/000001.png --out d.pfm --preview link/rgb/000000.png --force",
    ] {
        home.sh(args).failed(2, &["which is the input; choose another place"]);
        assert!(tree(home.0.path()) == before, "{args}: something was touched");
    }
    let report = home.sh(&format!("stream self {BLUR} --to other/new/ --report self/report.json -q"));
    assert_eq!(report.code, 0, "a report may lie beside what it is about: {report:?}");
}

#[test]
fn what_was_good_before_a_fault_is_there() {
    let home = Home::new();
    home.record("self", 9, 0.1);
    home.damage("self/rgb/000005.png");
    home.sh(&format!("stream self {BLUR} --to x.y4m --to out/ --report r.json")).failed(1, &["000005.png"]);
    assert_eq!((frames(&home.path("x.y4m")), pngs(&home.path("out"))), (5, 5));
    assert_eq!(json(home.path("r.json"))["frames"]["delivered"], 5);
    // Existing files are unchanged.
    let before = tree(&home.path("out"));
    home.sh(&format!("stream self {BLUR} --to x.y4m --to out/ --force -q")).failed(1, &["000005.png"]);
    assert!(tree(&home.path("out")) == before);
    assert_eq!((frames(&home.path("x.incomplete.y4m")), pngs(&home.path("out.incomplete"))), (5, 5));
}

#[test]
fn on_a_full_disk_the_whole_frames_are_kept_and_other_sinks_go_on() {
    let home = Home::new();
    home.record("self", 60, 0.1);
    let frame_bytes = 6 + 64 * 48 * 3 / 2;
    home.sh_on_full_disk(100, &format!("stream self {BLUR} --to x.y4m --to out/")).failed(1, &["x.incomplete.y4m"]);
    let kept = fs::read(home.path("x.incomplete.y4m")).unwrap();
    let header = kept.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    assert!((kept.len() - header).is_multiple_of(frame_bytes), "no half picture");
    assert_eq!((kept.len() - header) / frame_bytes, (102_400 - header) / frame_bytes);
    assert_eq!(pngs(&home.path("out")), 60);
    assert!(!home.path("x.y4m").exists());
}

#[test]
fn pictures_of_an_earlier_run_stay_until_the_new_are_whole() {
    let home = Home::new();
    home.record("self", 4, 0.1);
    home.sh(&format!("stream self {BLUR} --to out/ -q")).done();
    let before = tree(&home.path("out"));

    let again = home.start("", &format!("stream self {BLUR} --loop --frames 100000 --to out/ --force"));
    until("a new picture", || home.path("out.incomplete/000003.png").exists());
    let ran = terminate(again);
    assert!(ran.code == 0 && ran.stderr.contains("out.incomplete"), "{ran:?}");
    assert!(tree(&home.path("out")) == before, "{:?}", fs::read_dir(home.path("out")).unwrap().collect::<Vec<_>>());
    assert!(pngs(&home.path("out.incomplete")) >= 4);

    let ran = home.sh(&format!("stream self {BLUR} --frames 2 --to out/ --force"));
    assert!(ran.code == 0 && ran.stderr.contains("4 files of an earlier run are replaced by 2"), "{ran:?}");
    assert_eq!(pngs(&home.path("out")), 2);
    fs::write(home.path("out/000003.png"), "mine").unwrap();
    home.sh(&format!("stream self {BLUR} --to out/ --force")).failed(1, &["000003.png was not written by bokehcam"]);
    assert_eq!(fs::read(home.path("out/000003.png")).unwrap(), b"mine");
}

#[test]
fn a_reader_that_never_reads_does_not_keep_the_program() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    for pace in ["asap", "realtime"] {
        let args = format!("stream self {BLUR} --loop --pace {pace} --to - --report {pace}.json");
        let mut run = Beside::start(home.shell("", &args).stdout(Stdio::piped()).stderr(Stdio::piped()));
        let mut stdout = BufReader::new(run.0.stdout.take().unwrap());
        // The first line shows that the run has started; then the pipe fills up.
        stdout.read_line(&mut String::new()).unwrap_or_default();
        std::thread::sleep(Duration::from_millis(300));
        terminate(run).done();
        assert_accounted(&json(home.path(format!("{pace}.json"))));
    }
}

#[test]
fn an_encoder_that_says_all_is_well_is_not_believed() {
    let home = Home::new();
    home.record("self", 9, 0.1);
    for (script, what) in [
        ("cat > /dev/null", "it wrote nothing"),
        ("head -c 20000 > /dev/null; echo half > \"$out\"; exit 3", "exit status: 3"),
        (
            "cat > /dev/null; echo half > \"$out\"; echo 'Error writing trailer: No space left on device' >&2",
            "No space",
        ),
    ] {
        let path = home.fake_ffmpeg(script);
        let ran = Ran::of(&mut home.shell(&path, &format!("stream self {BLUR} --to x.mp4")));
        ran.failed(1, &[what]);
        assert!(!home.path("x.mp4").exists(), "{script}");
        assert!(
            ran.stderr.contains("captured") || ran.stderr.contains("delivered"),
            "the account is there: {}",
            ran.stderr
        );
    }
}

#[test]
fn an_encoder_that_is_slow_to_begin_costs_no_frames() {
    let home = Home::new();
    home.record("self", 75, 0.02);
    // The fake encoder records the other output's files at its own start.
    let path = home.fake_ffmpeg(
        "[ \"$1\" = -version ] && exit\nsleep 0.5; [ -e before ] || ls out > before\ncat > /dev/null; \
         echo video > \"$out\"",
    );
    let args = format!("stream self {BLUR} --pace realtime --to out/ --to x.mp4 --report report.json --force");
    // The program waits 2 s for the encoder, which may be too short on a busy machine, and a folder on a busy disk may
    // lose a frame; then the test repeats.
    until("no frame comes before it begins", || {
        let _ = fs::remove_file(home.path("before"));
        let _ = fs::remove_dir_all(home.path("out"));
        Ran::of(&mut home.shell(&path, &args)).done();
        let report = json(home.path("report.json"));
        assert_eq!(report["frames"]["captured"], 75, "{}", report["frames"]);
        let is_folder = |output: &&Value| output["output"].as_str().unwrap().starts_with("PNG files");
        let folder = report["outputs"].as_array().unwrap().iter().find(is_folder).unwrap();
        let (delivered, lost) = (report["frames"]["delivered"].as_u64().unwrap(), folder["lost"].as_u64().unwrap());
        assert_eq!(delivered - lost, pngs(&home.path("out")) as u64, "{report}");
        lost == 0 && fs::read_to_string(home.path("before")).unwrap().is_empty()
    });
}

#[test]
fn each_output_that_fails_says_what_is_kept_of_it() {
    let home = Home::new();
    home.record("self", 60, 0.1);
    let ran = home.sh_on_full_disk(100, &format!("stream self {BLUR} --to x.y4m --to z.y4m"));
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(["x.incomplete.y4m", "z.incomplete.y4m"].iter().all(|kept| ran.stderr.contains(kept)), "{}", ran.stderr);
}

/// `timeout` signals a program and then its process group.
#[test]
fn two_signals_at_once_are_one_wish() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    let args = format!("stream self {BLUR} --loop --to x.y4m");
    let run = home.start("", &args);
    let is_begun = |file: fs::DirEntry| {
        file.file_name().to_string_lossy().contains("x.y4m") && file.metadata().is_ok_and(|file| file.len() > 0)
    };
    until("a picture", || fs::read_dir(home.0.path()).unwrap().flatten().any(is_begun));
    // A stopped program gets both when it goes on, however busy the machine is; it runs again after the last of them.
    for signal in [Signal::STOP, Signal::TERM, Signal::INT] {
        run.signal(signal);
    }
    run.end_by(Signal::CONT, LONG).done();
    assert!(home.path("x.y4m").exists());
}

#[test]
fn an_encoder_that_hangs_does_not_keep_the_program() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    // The encoder either reads nothing, or reads everything and never ends.
    let hangs = ["echo half > \"$out\"; sleep 1000", "echo half > \"$out\"; cat > /dev/null; sleep 1000"];
    for (script, kept) in hangs.into_iter().zip(["x.incomplete.mkv", "x.incomplete.2.mkv"]) {
        let path = home.fake_ffmpeg(&format!("[ \"$1\" = -version ] && exit\n{script}"));
        let args = format!("stream self {BLUR} --loop --to out/ --to x.mkv");
        let run = home.start(&path, &args);
        until("a picture", || home.path("out").exists() && pngs(&home.path("out")) > 3);
        terminate(run).failed(1, &["it hung, and was killed", kept]);
        assert!(home.path(kept).exists());
        fs::remove_dir_all(home.path("out")).unwrap();
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_is_the_same_each_time_and_on_any_number_of_cores() {
    let home = Home::new();
    home.record("self", 30, 0.04);
    for (kind, threads) in [("mp4", 1), ("mp4", 2), ("mkv", 2), ("webm", 2)] {
        let of = |cores: &str, name: &str| {
            let args = format!("stream self {BLUR} --threads {threads} --to {name}");
            let ran = Ran::of(&mut home.shell(&format!("taskset -pc {cores} $$ >/dev/null;"), &args));
            assert_eq!((ran.code, ran.stderr.contains("without effect")), (0, false), "{}", ran.stderr);
            fs::read(home.path(name)).unwrap()
        };
        assert!(of("0", &format!("one.{kind}")) == of("0-999", &format!("all.{kind}")), "{kind}, {threads} threads");
        for name in ["one", "all"] {
            fs::remove_file(home.path(format!("{name}.{kind}"))).unwrap();
        }
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_on_a_full_disk_is_an_error_and_kept() {
    let home = Home::new();
    home.record("self", 200, 0.1);
    for name in ["x.mp4", "x.mkv", "x.webm"] {
        home.sh_on_full_disk(200, &format!("stream self {BLUR} --to {name}"))
            .failed(1, &[&name.replace('.', ".incomplete.")]);
        assert!(!home.path(name).exists());
        let frames = played(&home.path(name.replace('.', ".incomplete.")));
        assert!(frames >= 5, "{name}: {frames} can be played");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_of_a_loaded_machine_is_as_long_as_the_take() {
    let home = Home::new();
    // A frame rate that no machine sustains, so that frames are dropped.
    home.record("self", 50, 0.001);
    for name in ["x.mp4", "x.mkv", "x.y4m"] {
        home.sh(&format!("stream self {BLUR} --loop --frames 3000 --pace realtime --to {name} -q")).done();
        let duration_s: f64 = probed(&home.path(name), "-show_entries format=duration").parse().unwrap();
        // The first and the last frames may be dropped, too.
        assert!((2.0..=3.1).contains(&duration_s), "{name}: {duration_s} s");
    }
}

#[test]
fn what_a_killed_run_left_is_told_by_a_run_of_any_name() {
    let home = Home::new();
    home.record("self", 4, 0.05);
    fs::create_dir(home.path("takes")).unwrap();
    let parts = || {
        let names = fs::read_dir(home.path("takes")).unwrap().map(|entry| entry.unwrap());
        let parts = names.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part"));
        parts.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    // The program replaces the shell, so the kill reaches it directly.
    let args = format!("stream self {BLUR} --loop --pace realtime --to takes/a.y4m");
    let killed = Beside::start(home.shell("", &args).stderr(Stdio::null()));
    until("frames", || parts().iter().any(|part| part.metadata().is_ok_and(|part| part.len() > 10_000)));
    let alive = parts().remove(0);
    let said = |args: &str| home.sh(args).done().to_owned();
    let other = |name: &str| said(&format!("stream self {BLUR} --frames 1 --to takes/{name}"));
    assert!(!other("b.y4m").contains("hidden"), "another run is writing it");
    drop(killed);

    let left = fs::read(&alive).unwrap();
    let name = format!("takes/{}", alive.file_name().unwrap().to_str().unwrap());
    let told = format!("warning: killed runs left hidden files: {name}; rename those that you want to keep");
    assert_eq!(other("c.y4m").lines().filter(|line| line.starts_with(&told)).count(), 1);
    let render = said("render self/rgb/000000.png --effect blur --out takes/d.png");
    assert_eq!(render.lines().filter(|line| line.starts_with(&told)).count(), 1, "{render}");
    assert_eq!(fs::read(&alive).unwrap(), left, "nothing is done with it unasked");

    let same = other("a.y4m");
    assert!(same.contains("is kept as takes/a.incomplete.y4m") && !same.contains("hidden"), "{same}");
    assert_eq!((fs::read(home.path("takes/a.incomplete.y4m")).unwrap(), parts()), (left, Vec::new()));
}
