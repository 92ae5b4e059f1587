//! Several outputs, one of which is blocked.

use std::fs;
use std::path::Path;

use rustix::process::{Pid, Signal, kill_process};

use super::world::*;

/// Returns the total size of all files in a folder, unfinished ones included.
fn bytes_in(folder: &Path) -> u64 {
    let files = fs::read_dir(folder).unwrap().flatten();
    files.filter_map(|file| file.metadata().ok()).map(|file| file.len()).sum()
}

/// Returns the state of a process, such as `T` if stopped.
fn state(process: Pid) -> Option<char> {
    let stat = fs::read_to_string(format!("/proc/{}/stat", process.as_raw_nonzero())).ok()?;
    stat.rsplit_once(") ")?.1.chars().next()
}

#[test]
fn a_reader_that_stops_holds_up_no_file_and_off_is_off_there() {
    let world = World::new();
    // The standard output has no reader.
    let run = world.stream("stream", &["--to", "-", "--to", "call.y4m"]);
    let mut before = 0;
    for _ in 0..5 {
        until("the file grows", || bytes_in(&world.path("here")) > before);
        before = bytes_in(&world.path("here"));
    }
    let off = world.ctl(&["off"]);
    assert!(off.done().contains("standard output: busy, so the card appears there later"), "{}", off.stderr);
    let before = bytes_in(&world.path("here"));
    until("the card goes on in the file", || bytes_in(&world.path("here")) > before + 1_000_000);
    assert_eq!(run.interrupt(), 0);
    let pictures = Pictures::of(fs::File::open(world.path("here/call.y4m")).unwrap());
    until("all was read", || pictures.cards().len() as u64 * 345_606 + 100 > before);
    assert!(pictures.cards().last().unwrap().1, "it ends with the card");
}

#[test]
#[ignore = "needs ffmpeg"]
fn an_encoder_that_hangs_holds_up_no_other_output_and_off_is_off_there() {
    let world = World::new();
    let mut run = world.stream("stream", &["--to", "call.mp4", "--to", "-"]);
    let pictures = run.watch();
    pictures.wait_for("it runs", |_| true);
    let ffmpeg = run.children()[0];
    kill_process(ffmpeg, Signal::STOP).unwrap();
    // Far fewer frames than pass before the blocked output is abandoned.
    for _ in 0..8 {
        pictures.wait_for("the other output goes on", |picture| !picture.is_card());
    }
    let off = world.ctl(&["off"]);
    assert!(off.done().contains("ffmpeg to call.mp4: busy, so the card appears there later"), "{}", off.stderr);
    pictures.wait_for("the card", Picture::is_card);
    assert_eq!(state(ffmpeg), Some('T'), "it still hangs");
    kill_process(ffmpeg, Signal::CONT).unwrap();
    world.ctl(&["on"]).done();
    pictures.wait_for("pictures", |picture| !picture.is_card());
    assert_eq!(run.interrupt(), 0);
    assert!(fs::metadata(world.path("here/call.mp4")).unwrap().len() > 0);
}
