//! What becomes of a user's files when something goes wrong, seen from outside the program.

mod home;
mod removed;
mod reports;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Duration;

use home::*;

const BLUR: &str = "--effect none";

#[test]
fn a_source_is_never_a_target() {
    let home = Home::new();
    home.record("self", 3, 0.1);
    std::os::unix::fs::symlink(home.at("self"), home.at("link")).unwrap();
    fs::create_dir(home.at("other")).unwrap();
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
        "render self/rgb/000000.png --effect blur --out new.png --debug-dir self/rgb --force",
        "depth self/rgb/000000.png self/rgb/000001.png --out self/rgb/000001.png --force",
        "depth self/rgb/000000.png self/rgb/000001.png --out d.pfm --preview link/rgb/000000.png --force",
    ] {
        home.run(args).failed(2, "which is read; choose another place");
        assert!(tree(home.0.path()) == before, "{args}: something was touched");
    }
    let report = home.run(&format!("stream self {BLUR} --to other/new/ --report self/report.json -q"));
    assert_eq!(report.code, Some(0), "a report may lie beside what it is about: {report:?}");
}

#[test]
fn what_was_good_before_a_fault_is_there() {
    let home = Home::new();
    home.record("self", 9, 0.1);
    home.damage("self/rgb/000005.png");
    home.run(&format!("stream self {BLUR} --to x.y4m --to out/ --report r.json")).failed(1, "000005.png");
    assert_eq!((frames(&home.at("x.y4m")), pngs(&home.at("out"))), (5, 5));
    let report: serde_json::Value = serde_json::from_slice(&fs::read(home.at("r.json")).unwrap()).unwrap();
    assert_eq!(report["frames"]["delivered"], 5);
    // What is there already stays.
    let before = tree(&home.at("out"));
    home.run(&format!("stream self {BLUR} --to x.y4m --to out/ --force -q")).failed(1, "000005.png");
    assert!(tree(&home.at("out")) == before);
    assert_eq!((frames(&home.at("x.incomplete.y4m")), pngs(&home.at("out.incomplete"))), (5, 5));
}

#[test]
fn on_a_full_disk_the_whole_frames_are_kept_and_other_sinks_go_on() {
    let home = Home::new();
    home.record("self", 60, 0.1);
    let frame_bytes = 6 + 64 * 48 * 3 / 2;
    home.run_on_full_disk(100, &format!("stream self {BLUR} --to x.y4m --to out/")).failed(1, "x.incomplete.y4m");
    let kept = fs::read(home.at("x.incomplete.y4m")).unwrap();
    let header = kept.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    assert!((kept.len() - header).is_multiple_of(frame_bytes), "no half picture");
    assert_eq!((kept.len() - header) / frame_bytes, (102_400 - header) / frame_bytes);
    assert_eq!(pngs(&home.at("out")), 60);
    assert!(!home.at("x.y4m").exists());
}

#[test]
fn pictures_of_an_earlier_run_stay_until_the_new_are_whole() {
    let home = Home::new();
    home.record("self", 4, 0.1);
    assert_eq!(home.run(&format!("stream self {BLUR} --to out/ -q")).code, Some(0));
    fs::write(home.at("out/notes.txt"), "mine").unwrap();
    let before = tree(&home.at("out"));

    let again = home
        .command("", &format!("stream self {BLUR} --loop --frames 100000 --to out/ --force"))
        .stderr(Stdio::piped())
        .spawn();
    let again = again.unwrap();
    until("a new picture", || home.at("out/.bokehcam.part/000003.png").exists());
    let ran = terminate(again);
    assert!(ran.code == Some(0) && ran.said.contains("out.incomplete"), "{ran:?}");
    assert!(tree(&home.at("out")) == before, "{:?}", fs::read_dir(home.at("out")).unwrap().collect::<Vec<_>>());
    assert!(pngs(&home.at("out.incomplete")) >= 4);

    let ran = home.run(&format!("stream self {BLUR} --frames 2 --to out/ --force"));
    assert!(ran.code == Some(0) && ran.said.contains("4 files of an earlier run are replaced by 2"), "{ran:?}");
    assert_eq!((pngs(&home.at("out")), fs::read(home.at("out/notes.txt")).unwrap()), (2, b"mine".to_vec()));
    fs::write(home.at("out/000003.png"), "mine").unwrap();
    home.run(&format!("stream self {BLUR} --to out/ --force")).failed(1, "000003.png was not written by bokehcam");
    assert_eq!(fs::read(home.at("out/000003.png")).unwrap(), b"mine");
}

#[test]
fn a_reader_that_never_reads_does_not_keep_the_program() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    for pace in ["asap", "realtime"] {
        let args = format!("stream self {BLUR} --loop --pace {pace} --to - --report {pace}.json");
        let mut child = home.command("", &args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        // The first line says that it runs; what follows fills the pipe.
        stdout.read_line(&mut String::new()).unwrap_or_default();
        std::thread::sleep(Duration::from_millis(300));
        let ran = terminate(child);
        assert_eq!(ran.code, Some(0), "{}", ran.said);
        let report: serde_json::Value =
            serde_json::from_slice(&fs::read(home.at(&format!("{pace}.json"))).unwrap()).unwrap();
        let count = |name: &str| report["frames"][name].as_u64().unwrap();
        let dropped: u64 = report["frames"]["dropped"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
        assert_eq!(count("captured"), count("delivered") + dropped + count("in_flight"), "{report}");
    }
}

#[test]
fn an_encoder_that_says_all_is_well_is_not_believed() {
    let home = Home::new();
    home.record("self", 9, 0.1);
    for (script, what) in [
        ("cat > /dev/null; head -c 500 /dev/zero > \"$out\"", "x.incomplete.mp4"),
        ("cat > /dev/null", "is missing"),
        ("head -c 20000 > /dev/null; echo half > \"$out\"; exit 3", "exit status: 3"),
        (
            "cat > /dev/null; echo half > \"$out\"; echo 'Error writing trailer: No space left on device' >&2",
            "No space",
        ),
    ] {
        let path = home.fake_ffmpeg(script);
        let ran = Ran::from(home.command(&path, &format!("stream self {BLUR} --to x.mp4")).output().unwrap());
        ran.failed(1, what);
        assert!(!home.at("x.mp4").exists(), "{script}");
        assert!(ran.said.contains("captured") || ran.said.contains("delivered"), "the account is there: {}", ran.said);
    }
}

#[test]
fn an_encoder_that_is_slow_to_begin_costs_no_frames() {
    let home = Home::new();
    home.record("self", 75, 0.02);
    // It keeps what there was of the other output when it began. What it leaves passes for an mp4.
    let path = home.fake_ffmpeg(
        "[ \"$1\" = -version ] && exit\nsleep 0.5; [ -e before ] || ls out > before\ncat > /dev/null; \
         printf '\\000\\000\\000\\010moov' > \"$out\"",
    );
    let args = format!("stream self {BLUR} --pace realtime --to out/ --to x.mp4 --report report.json --force");
    // Two seconds are waited for it, which a busy machine may take to start it.
    until("no frame comes before it begins", || {
        let _ = fs::remove_file(home.at("before"));
        let _ = fs::remove_dir_all(home.at("out"));
        let ran = Ran::from(home.command(&path, &args).output().unwrap());
        assert_eq!(ran.code, Some(0), "{}", ran.said);
        let report: serde_json::Value = serde_json::from_slice(&fs::read(home.at("report.json")).unwrap()).unwrap();
        assert_eq!(report["frames"]["captured"], 75, "{}", report["frames"]);
        assert_eq!(report["frames"]["delivered"].as_u64(), Some(pngs(&home.at("out")) as u64));
        fs::read_to_string(home.at("before")).unwrap().is_empty()
    });
}

#[test]
fn each_output_that_fails_says_what_is_kept_of_it() {
    let home = Home::new();
    home.record("self", 60, 0.1);
    let ran = home.run_on_full_disk(100, &format!("stream self {BLUR} --to x.y4m --to z.y4m"));
    assert_eq!(ran.code, Some(1), "{}", ran.said);
    assert!(["x.incomplete.y4m", "z.incomplete.y4m"].iter().all(|kept| ran.said.contains(kept)), "{}", ran.said);
}

/// As `timeout` sends them, to a program and then to its group.
#[test]
fn two_signals_at_once_are_one_wish() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    let args = format!("stream self {BLUR} --loop --to x.y4m");
    let child = home.command("", &args).stderr(Stdio::piped()).spawn().unwrap();
    let is_begun = |file: fs::DirEntry| {
        file.file_name().to_string_lossy().contains("x.y4m") && file.metadata().is_ok_and(|file| file.len() > 0)
    };
    until("a picture", || fs::read_dir(home.0.path()).unwrap().flatten().any(is_begun));
    let pid = rustix::process::Pid::from_child(&child);
    for signal in [rustix::process::Signal::TERM, rustix::process::Signal::INT] {
        rustix::process::kill_process(pid, signal).unwrap();
    }
    let ended = child.wait_with_output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(home.at("x.y4m").exists());
}

#[test]
fn an_encoder_that_hangs_does_not_keep_the_program() {
    let home = Home::new();
    home.record("self", 4, 0.01);
    // It takes nothing, or all and never ends.
    let hangs = ["echo half > \"$out\"; sleep 1000", "echo half > \"$out\"; cat > /dev/null; sleep 1000"];
    for (script, kept) in hangs.into_iter().zip(["x.incomplete.mkv", "x.incomplete.2.mkv"]) {
        let path = home.fake_ffmpeg(&format!("[ \"$1\" = -version ] && exit\n{script}"));
        let args = format!("stream self {BLUR} --loop --to out/ --to x.mkv");
        let child = home.command(&path, &args).stderr(Stdio::piped()).spawn().unwrap();
        until("a picture", || home.at("out").exists() && pngs(&home.at("out")) > 3);
        let ran = terminate(child);
        ran.failed(1, "it hung, and was killed");
        assert!(ran.said.contains(kept) && home.at(kept).exists(), "{}", ran.said);
        fs::remove_dir_all(home.at("out")).unwrap();
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
            let ran = Ran::from(home.command(&format!("taskset -pc {cores} $$ >/dev/null;"), &args).output().unwrap());
            assert_eq!((ran.code, ran.said.contains("without effect")), (Some(0), false), "{}", ran.said);
            fs::read(home.at(name)).unwrap()
        };
        assert!(of("0", &format!("one.{kind}")) == of("0-999", &format!("all.{kind}")), "{kind}, {threads} threads");
        for name in ["one", "all"] {
            fs::remove_file(home.at(&format!("{name}.{kind}"))).unwrap();
        }
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_on_a_full_disk_is_an_error_and_kept() {
    let home = Home::new();
    home.record("self", 200, 0.1);
    for name in ["x.mp4", "x.mkv", "x.webm"] {
        home.run_on_full_disk(200, &format!("stream self {BLUR} --to {name}"))
            .failed(1, &name.replace('.', ".incomplete."));
        assert!(!home.at(name).exists());
        let probe = Command::new("ffprobe")
            .args(["-v", "quiet", "-count_frames", "-of", "csv=p=0", "-show_entries", "stream=nb_read_frames"])
            .arg(home.at(&name.replace('.', ".incomplete.")))
            .output()
            .unwrap();
        let frames: u32 = String::from_utf8(probe.stdout).unwrap().trim().trim_end_matches(',').parse().unwrap();
        assert!(frames >= 5, "{name}: {frames} can be played");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_of_a_loaded_machine_is_as_long_as_the_take() {
    let home = Home::new();
    // So many frames a second that some are dropped anywhere.
    home.record("self", 50, 0.001);
    for name in ["x.mp4", "x.mkv", "x.y4m"] {
        assert_eq!(
            home.run(&format!("stream self {BLUR} --loop --frames 3000 --pace realtime --to {name} -q")).code,
            Some(0)
        );
        let probe = Command::new("ffprobe")
            .args(["-v", "error", "-of", "csv=p=0", "-show_entries", "format=duration"])
            .arg(home.at(name))
            .output()
            .unwrap();
        let duration_s: f64 = String::from_utf8(probe.stdout).unwrap().trim().parse().unwrap();
        // Its first and its last frames may be among those that were dropped.
        assert!((2.0..=3.1).contains(&duration_s), "{name}: {duration_s} s");
    }
}

#[test]
fn what_a_killed_run_left_is_told_by_a_run_of_any_name() {
    let home = Home::new();
    home.record("self", 4, 0.05);
    fs::create_dir(home.at("takes")).unwrap();
    let parts = || {
        let names = fs::read_dir(home.at("takes")).unwrap().map(|entry| entry.unwrap());
        let parts = names.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part"));
        parts.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    // In the place of the shell: the program itself is killed.
    let args = format!("stream self {BLUR} --loop --pace realtime --to takes/a.y4m");
    let mut killed = home.command("", &args).stderr(Stdio::null()).spawn().unwrap();
    until("frames", || parts().iter().any(|part| part.metadata().is_ok_and(|part| part.len() > 10_000)));
    let alive = parts().remove(0);
    let said = |args: &str| {
        let ran = home.run(args);
        assert_eq!(ran.code, Some(0), "{ran:?}");
        ran.said
    };
    let other = |name: &str| said(&format!("stream self {BLUR} --frames 1 --to takes/{name}"));
    assert!(!other("b.y4m").contains("hidden"), "another run is writing it");
    killed.kill().unwrap();
    killed.wait().unwrap();

    let left = fs::read(&alive).unwrap();
    let name = format!("takes/{}", alive.file_name().unwrap().to_str().unwrap());
    let told =
        format!("warning: runs that were killed left hidden files: {name}; give those that you want another name");
    assert_eq!(other("c.y4m").lines().filter(|line| line.starts_with(&told)).count(), 1);
    let render = said("render self/rgb/000000.png --effect blur --out takes/d.png");
    assert_eq!(render.lines().filter(|line| line.starts_with(&told)).count(), 1, "{render}");
    assert_eq!(fs::read(&alive).unwrap(), left, "nothing is done with it unasked");

    let same = other("a.y4m");
    assert!(same.contains("is kept as takes/a.incomplete.y4m") && !same.contains("hidden"), "{same}");
    assert_eq!((fs::read(home.at("takes/a.incomplete.y4m")).unwrap(), parts()), (left, Vec::new()));
}
