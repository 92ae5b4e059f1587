//! State that persists: a frozen picture, a recording in progress, a hidden window, and the look across restarts.

use std::fs;
use std::thread;
use std::time::Duration;

use super::input::sym;
use super::picture::{distance, is_photograph};
use super::preview::Program;
use super::program::PORTRAIT;
use super::screen::{Screen, until};
use super::window::PATIENCE;

#[test]
#[ignore = "needs an X server"]
fn a_frozen_picture_follows_the_look() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT, "--panel=false", "--quality", "draft"]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    // Without controls, which come with a key and go after a while, only the blur changes the picture below.
    window.key(&[], u32::from('h'));
    window.key(&[], u32::from('z'));
    let mut last = None;
    let frozen = window.until("it stands still, without a note", |image| {
        // Longer than notes stay visible, or two consecutive pictures would both show them.
        thread::sleep(Duration::from_secs(6));
        let same = last.as_ref().is_some_and(|last| distance(last, image) < 0.01);
        last = Some(image.clone());
        same
    });
    (0..12).for_each(|_| window.key(&[], u32::from(']')));
    let more = window.until("more blur, in the same picture", |image| distance(image, &frozen) > 0.3);
    // One undo reverts all of them, because they were one stroke.
    window.key(&[sym::CONTROL], u32::from('z'));
    window.until("as before", |image| distance(image, &frozen) < 0.2 * distance(&more, &frozen));
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn closing_asks_while_it_records_and_what_is_recorded_is_whole() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    let folder = program.home().to_owned();
    let ends_with = |end: &str| {
        let files = fs::read_dir(&folder).unwrap().flatten();
        files.filter(|file| file.file_name().to_string_lossy().ends_with(end)).count()
    };
    window.key(&[], u32::from('v'));
    // The encoder writes its first bytes with the first second of pictures; without any, no video would be kept.
    let is_begun = |file: fs::DirEntry| {
        file.file_name().to_string_lossy().ends_with(".part") && file.metadata().is_ok_and(|file| file.len() > 0)
    };
    until("it is recorded", PATIENCE, || fs::read_dir(&folder).unwrap().flatten().any(is_begun));
    assert_eq!(ends_with(".part"), 1);
    window.close();
    thread::sleep(Duration::from_secs(1));
    assert!(program.runs(), "it closed without asking");
    window.close();
    let ended = program.end();
    ended.succeeded();
    assert_eq!((ends_with(".mp4"), ends_with(".part")), (1, 0));
}

#[test]
#[ignore = "needs an X server"]
fn a_window_that_nobody_sees_computes_nothing() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    let used = |program: &Program| {
        let before = program.cpu_ticks();
        thread::sleep(Duration::from_secs(3));
        program.cpu_ticks() - before
    };
    // On a busy machine, the program may get little processor time for a while.
    let mut seen = 0;
    until("it computes", PATIENCE, || {
        seen = seen.max(used(&program));
        seen > 20
    });
    window.minimise();
    // The window could return at once, so the program continues to compute for a while.
    until("it computes nothing", PATIENCE, || (0..3).all(|_| used(&program) * 5 < seen));
    let mut again = 0;
    window.bring_back();
    window.until("a picture again", is_photograph);
    until("it goes on", PATIENCE, || {
        again += used(&program);
        again * 2 > seen
    });
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_photo_that_nobody_changes_is_computed_once() {
    let screen = Screen::new();
    let photo = format!("{PORTRAIT}/rgb/000000.png");
    let mut program = Program::start(&screen, &[&photo, "--panel=false"]);
    let window = program.window();
    let first = window.until("the photo", is_photograph);
    // Wait until everything is drawn and the notes are gone.
    let mut used = 0;
    until("it computes nothing", PATIENCE, || {
        let before = program.cpu_ticks();
        thread::sleep(Duration::from_secs(4));
        used = program.cpu_ticks() - before;
        used <= 12
    });
    println!("{used} ticks in 4 s");
    // The program still reacts to input.
    (0..12).for_each(|_| window.key(&[], u32::from(']')));
    window.until("more blur", |image| distance(image, &first) > 0.3);
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_photo_gets_its_depth_once_a_look_follows_it() {
    let screen = Screen::new();
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("photo.png");
    fs::copy(format!("{PORTRAIT}/rgb/000000.png"), &photo).unwrap();
    fs::copy(format!("{PORTRAIT}/depth/000000.png"), folder.path().join("photo-depth.png")).unwrap();
    let name = photo.display().to_string();
    let mut program = Program::start(&screen, &[&name, "--effect", "blur", "--panel=false"]);
    let window = program.window();
    let first = window.until("the photo", is_photograph);
    thread::sleep(Duration::from_secs(2));
    // A preset that uses depth, and the depth view.
    window.key(&[], u32::from('1'));
    window.key(&[], u32::from('d'));
    window.until("depth in colours", |image| distance(image, &first) > 25.0);
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_look_is_there_again_unless_one_begins_afresh() {
    let screen = Screen::new();
    let remembered = |home: &std::path::Path| fs::read_to_string(home.join("state/bokehcam/window.toml")).unwrap();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    let first = program.home().to_owned();
    // The preset with a six-blade aperture.
    window.key(&[], u32::from('2'));
    until("the preset", PATIENCE, || program.ctl(&["status", "--json"]).stdout.contains("polygon:6"));
    let ended = program.close();
    assert!(remembered(&first).contains("polygon:6"), "{}", remembered(&first));
    fs::remove_file(first.join("report.json")).unwrap();
    // What the command line names is no choice for the next time, nor is the demonstration for want of a camera.
    assert!(!remembered(&first).contains("source ="), "{}", remembered(&first));
    let mut program = Program::start_at(&screen, ended.home, &[]);
    program.window().until("a picture", is_photograph);
    let ended = program.close();
    let again = remembered(&first);
    assert!(again.contains("polygon:6") && !again.contains("source ="), "{again}");
    fs::remove_file(first.join("report.json")).unwrap();
    let mut program = Program::start_at(&screen, ended.home, &[PORTRAIT, "--fresh"]);
    program.window().until("a picture", is_photograph);
    let _home = program.close().home;
    assert_eq!(remembered(&first), again, "what begins afresh leaves that alone");
}
