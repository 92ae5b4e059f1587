//! `record` never loses a recording: neither its source, nor a replaced one, nor its own frames when interrupted.
#![allow(missing_docs)]

use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::RecordingWriter;
use bokehcam_media::recording::still::write_color;
use bokehcam_media::recording::{Options, Recording, Scratch};
use rustix::process::Signal;

use crate::common::noise;
use crate::program::{Beside, Home, Ran, until};

/// Timeout against hangs.
const HANG: Duration = Duration::from_secs(120);

/// Returns names and contents of a folder's files, without following links and without the program's own file list.
fn all(dir: &Path) -> Vec<(String, Vec<u8>)> {
    fn add(dir: &Path, below: &Path, found: &mut Vec<(String, Vec<u8>)>) {
        for entry in fs::read_dir(below).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.is_symlink() {
                add(dir, &path, found);
            } else if !path.ends_with(".bokehcam") {
                let name = path.strip_prefix(dir).unwrap().to_str().unwrap().to_owned();
                found.push((name, fs::read(&path).unwrap_or_default()));
            }
        }
    }
    let mut found = Vec::new();
    add(dir, dir, &mut found);
    found.sort();
    found
}

fn names(dir: &Path) -> Vec<String> {
    all(dir).into_iter().map(|(name, _)| name).collect()
}

/// Creates a recording of `frames` frames in `dir`, of a uniform `shade` and depth.
fn recording(dir: &Path, frames: u64, shade: u8, metres: f32) {
    let mut writer = RecordingWriter::create(dir, false).unwrap();
    let color = ColorImage { width: 24, height: 16, rgb: vec![shade; 24 * 16 * 3] };
    let depth = DepthMap { width: 24, height: 16, metres: vec![metres; 24 * 16], ..DepthMap::default() };
    (0..frames).for_each(|frame| writer.add(frame * 100_000_000, &color, Some(&depth)).unwrap());
    writer.finish().unwrap();
}

/// Returns the number of readable frames, and the first byte of the first one.
fn read(dir: &Path) -> (usize, u8) {
    let recording = Recording::open(dir, &Options::default()).unwrap();
    let (mut scratch, mut image, mut depth) = (Scratch::default(), ColorImage::default(), DepthMap::default());
    for frame in (0..recording.len()).rev() {
        recording.read_color(frame, &mut scratch, &mut image).unwrap();
        recording.read_depth(frame, &mut scratch, &mut depth).unwrap();
    }
    (recording.len(), image.rgb[0])
}

#[test]
fn a_source_is_never_the_target() {
    let home = Home::new();
    let take = home.path("take");
    recording(&take, 3, 50, 1.0);
    symlink(&take, home.path("link")).unwrap();
    let before = all(home.0.path());
    for target in ["take", "./take/", "link", "take/rgb", "take/new", "link/new", "."] {
        let ran = home.run(&["record", "take", "--to", target, "--force"]);
        ran.refused(2, &[&format!("--to {target}: this ")]);
    }
    assert_eq!(all(home.0.path()), before);
}

#[test]
fn a_source_that_fails_leaves_the_old_recording() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    recording(&at("source"), 4, 50, 1.0);
    recording(&at("old"), 2, 200, 2.0);
    let before = all(&at("old"));

    // The source fails at its first frame: nothing is recorded, and no files remain.
    let first = fs::read(at("source/rgb/000000.png")).unwrap();
    fs::write(at("source/rgb/000000.png"), &first[..first.len() - 20]).unwrap();
    let ran = home.run(&["record", "source", "--to", "old", "--force"]);
    ran.failed(1, &["000000.png: "]);
    assert_eq!((all(&at("old")), at("old.incomplete").exists()), (before.clone(), false));

    // The source fails later: the recorded frames are kept under another name.
    fs::write(at("source/rgb/000000.png"), first).unwrap();
    fs::write(at("source/rgb/000003.png"), "").unwrap();
    let ran = home.run(&["record", "source", "--to", "old", "--force"]);
    ran.failed(1, &["old: unchanged", "3 frames are in old.incomplete"]);
    assert_eq!((all(&at("old")), read(&at("old.incomplete"))), (before, (3, 50)));

    // Without an old recording, they keep the requested name.
    let ran = home.run(&["record", "source", "--to", "new"]);
    ran.failed(1, &["new: incomplete; the 3 frames until then can be read"]);
    assert_eq!(read(&at("new")), (3, 50));
}

#[test]
fn only_a_recording_of_our_own_is_replaced() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    recording(&at("source"), 2, 50, 1.0);
    recording(&at("old"), 3, 200, 2.0);
    let ran = home.run(&["record", "source", "--to", "old"]);
    assert!(ran.code == 1 && ran.stderr.contains("--force"), "{}", ran.stderr);

    // A foreign file, and one with the name of a picture.
    for foreign in ["old/groundtruth.txt", "old/rgb/000003.png"] {
        fs::write(at(foreign), "mine").unwrap();
        let before = all(home.0.path());
        let ran = home.run(&["record", "source", "--to", "old", "--force"]);
        ran.failed(1, &[&format!("{foreign} was not written by bokehcam")]);
        assert_eq!(all(home.0.path()), before);
        fs::remove_file(at(foreign)).unwrap();
    }
    // A recording by another program.
    let list = fs::read(at("old/.bokehcam")).unwrap();
    fs::remove_file(at("old/.bokehcam")).unwrap();
    home.run(&["record", "source", "--to", "old", "--force"]).failed(1, &["was not written by bokehcam"]);
    assert_eq!(read(&at("old")), (3, 200));
    fs::write(at("old/.bokehcam"), list).unwrap();

    let ran = home.run(&["record", "source", "--to", "old", "--force"]);
    ran.done();
    // The 8 files are three pictures, three depth maps and two lists.
    assert!(ran.stderr.contains("2 frames recorded") && ran.stderr.contains("in place of 8 files"), "{}", ran.stderr);
    assert_eq!(read(&at("old")), (2, 50));
    assert_eq!(names(&at("old")).len(), 6);
    assert!(!at("old.incomplete").exists() && !at("old.replaced").exists());
}

/// Starts `record`, and waits for some frames in `place`.
fn begun(home: &Home, args: &[&str], place: PathBuf) -> Beside {
    let mut run = Beside::start(home.command(args).stderr(Stdio::piped()));
    until("some frames", HANG, || {
        assert!(run.runs(), "it ends only when told to");
        fs::read_dir(&place).map_or(0, |entries| entries.count()) >= 4
    });
    run
}

#[test]
fn a_recording_that_is_cut_short_is_readable() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    recording(&at("old"), 2, 200, 2.0);
    let before = all(&at("old"));
    let endless = ["record", "synthetic", "--size", "64x48", "--to", "old", "--force"];
    let long = [&endless[..], &["--frames", "1000000"]].concat();

    let ran = begun(&home, &long, at("old.incomplete/rgb")).end_by(Signal::INT, HANG);
    ran.done();
    assert!(ran.stderr.contains("old: unchanged") && ran.stderr.contains("are in old.incomplete"), "{}", ran.stderr);
    assert_eq!(all(&at("old")), before);
    assert!(read(&at("old.incomplete")).0 >= 3);

    // After a kill, too.
    drop(begun(&home, &long, at("old.incomplete.2/rgb")));
    assert_eq!(all(&at("old")), before);
    assert!(read(&at("old.incomplete.2")).0 >= 2);
    let once = [&endless[..], &["--frames", "1"]].concat();
    home.run(&once).done();
    assert_eq!(read(&at("old")).0, 1);

    // An endless source ends by a signal.
    let ran = begun(&home, &endless, at("old.incomplete.3/rgb")).end_by(Signal::INT, HANG);
    ran.done();
    assert!(ran.stderr.contains("in place of 4 files"), "{}", ran.stderr);
    assert!(read(&at("old")).0 >= 3);
    assert!(!names(&at("old")).iter().any(|name| name.contains("part")));
}

#[test]
fn a_killed_recording_gets_its_lists() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    let args = ["record", "synthetic", "--size", "64x48", "--to", "new"];
    drop(begun(&home, &args, at("new/rgb")));
    let ran = home.run(&args);
    assert!(ran.code == 1 && ran.stderr.contains("rgb.txt: restored from an interrupted"), "{}", ran.stderr);
    assert!(read(&at("new")).0 >= 2);
    // A picture that was being written may be left, in a folder below.
    let is_list = |name: &String| name.ends_with(".part") && !name.contains('/');
    assert!(!names(&at("new")).iter().any(is_list), "{:?}", names(&at("new")));
}

#[test]
fn a_killed_recording_is_played() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    drop(begun(&home, &["record", "synthetic", "--size", "64x48", "--to", "new"], at("new/rgb")));
    // A line that was being written.
    for part in names(&at("new")).iter().filter(|name| name.ends_with(".part")) {
        let mut list = fs::File::options().append(true).open(at("new").join(part)).unwrap();
        list.write_all(b"9.0 rgb/0000").unwrap();
    }
    let before = all(&at("new"));
    let recording = Recording::open(&at("new"), &Options::default()).unwrap();
    let frames = recording.len();
    assert!(frames >= 2 && recording.has_depth());
    for arguments in [&["stream", "new", "--effect", "none", "--to", "null"][..], &["record", "new", "--to", "copy"]] {
        let said = home.run(arguments);
        assert!(said.warning().contains(&format!("new: the recording was interrupted; {frames} frames are played")));
    }
    assert_eq!(read(&at("copy")).0, frames);
    assert_eq!(all(&at("new")), before, "playing changes nothing");
}

#[test]
fn a_killed_file_has_the_frames_from_its_first_moment() {
    let home = Home::new();
    let args = ["record", "synthetic", "--size", "64x48", "--to", "new.mcap"];
    // The name decides how a file is read, and the part has another one.
    let has_frames = || {
        let part = names(home.0.path()).into_iter().find(|name| name.starts_with(".new.mcap."));
        let look = home.path("look.mcap");
        part.is_some_and(|part| fs::copy(home.path(&part), &look).is_ok())
            && Recording::open(&look, &Options::default()).is_ok_and(|recording| !recording.is_empty())
    };
    let run = Beside::start(home.command(&args).stderr(Stdio::null()));
    until("a frame", HANG, has_frames);
    fs::remove_file(home.path("look.mcap")).unwrap();
    drop(run);
    let once = [&args[..], &["--frames", "1"]].concat();
    let ran = home.run(&once);
    assert!(ran.done().contains("kept as new.incomplete.mcap"), "{}", ran.stderr);
    assert!(!Recording::open(&home.path("new.incomplete.mcap"), &Options::default()).unwrap().is_empty());
    // Killed before its first frame: there is nothing to keep.
    fs::write(home.path(".new.mcap.1-0.part"), "").unwrap();
    home.run(&[&once[..], &["--force"]].concat()).done();
    assert_eq!(names(home.0.path()).iter().filter(|name| name.contains("mcap")).count(), 2);
}

/// A file size limit acts like a full disk.
#[test]
fn a_full_disk_leaves_no_half_picture() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    recording(&at("source"), 3, 50, 1.0);
    // A picture that is hard to compress exceeds the limit.
    write_color(&at("source/rgb/000002.png"), &noise(24, 16), true).unwrap();
    for (target, kept) in [("new", "new"), ("old", "old.incomplete")] {
        if target != kept {
            recording(&at(target), 1, 200, 2.0);
        }
        let limit = "trap '' XFSZ; ulimit -f 1;";
        let ran = Ran::of(&mut home.shell(limit, &format!("record source --to {target} --force")));
        ran.failed(1, &["rgb/000002.png", "large"]);
        assert_eq!(read(&at(kept)), (2, 50), "{}", ran.stderr);
        assert!(
            !names(&at(kept)).iter().any(|name| name.contains("part") || name == "rgb/000002.png"),
            "{:?}",
            names(&at(kept))
        );
    }
    assert_eq!(read(&at("old")), (1, 200));
}

#[test]
fn depth_that_a_wrong_scale_makes_is_doubted() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    recording(&at("source"), 2, 50, 1.5);
    let ran = home.run(&["record", "source", "--depth-scale", "5", "--to", "new"]);
    assert!(ran.warning().contains("100.0 % of the depth lies beyond 13.1 m"), "{}", ran.stderr);
    assert_eq!(ran.stderr.matches("--depth-scale").count(), 1, "{}", ran.stderr);
    let ran = home.run(&["record", "source", "--to", "new", "--force", "-v"]);
    assert!(ran.code == 0 && !ran.stderr.contains("depth-scale"), "{}", ran.stderr);
}

#[test]
fn what_is_assumed_about_a_source_is_said() {
    let home = Home::new();
    write_color(&home.path("photo.png"), &noise(64, 48), false).unwrap();
    image::GrayImage::from_fn(64, 48, |x, _| [(4 * x) as u8].into()).save(home.path("photo-depth.png")).unwrap();
    let ran = home.run(&["record", "photo.png", "--depth-unit", "inverse", "--to", "new"]);
    for said in ["warning: this depth is relative", "note: photo-depth.png: the largest values are taken as near"] {
        assert!(ran.done().contains(said), "{}", ran.stderr);
    }
    assert_eq!(read(&home.path("new")).0, 1);
}

#[test]
fn a_recording_of_a_kinect_is_recorded_played_and_taken_for_depth() {
    const TAKE: &[u8] = include_bytes!("../../../../fuzz/seeds/recording_file/kinect.mkv");
    let home = Home::new();
    fs::write(home.path("take.mkv"), TAKE).unwrap();
    let recorded = home.run(&["record", "take.mkv", "--to", "other"]);
    assert!(recorded.warning().contains("take.mkv has no calibration"), "{}", recorded.stderr);
    assert_eq!(read(&home.path("other")).0, 3);
    fs::rename(home.path("other/rgb"), home.path("film")).unwrap();
    home.run(&["stream", "film", "--depth", "take.mkv", "--focus", "1", "--to", "null"]).done();
    fs::write(home.path("cut.mkv"), &TAKE[..1700]).unwrap();
    let played = home.run(&["stream", "cut.mkv", "--effect", "none", "--to", "null"]);
    assert!(played.done().contains("2 of 2 frames") && played.stderr.matches("cut.mkv: damaged: ").count() == 1);
    fs::write(home.path("head.mkv"), &TAKE[..700]).unwrap();
    home.run(&["stream", "head.mkv", "--to", "null"]).refused(1, &["head.mkv: no colour picture in it is whole"]);
    home.run(&["record", "take.mkv", "--force", "--to", "take.mkv"]).refused(2, &["take.mkv"]);
    assert!(fs::read(home.path("take.mkv")).unwrap() == TAKE);
}
