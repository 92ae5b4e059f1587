//! `ctl` beside faults that concern other commands: the camera can be switched off, whatever is broken.

use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{Beside, Ran};

use super::world::*;

/// A settings file whose third line no command accepts that reads settings.
pub const TYPO: &str = "rim = 0.1\n[presets.evening]\nhighlihts = 8\n";
/// Variables that no command accepts that reads settings, or that name a file that is not there.
pub const VARIABLES: [(&str, &str); 4] = [
    ("BOKEHCAM_BLUR", "abc"),
    ("BOKEHCAM_CONFIG", "/nowhere/x.toml"),
    ("BOKEHCAM_CONFIG", ""),
    ("BOKEHCAM_REPORT", "/"),
];

const SECOND: Duration = Duration::from_secs(1);

#[test]
fn off_takes_less_than_a_second_beside_broken_settings_and_a_broken_environment() {
    let world = World::new();
    let mut run = world.stream("stream", &["--to", "-", "--effect", "blur"]);
    let pictures = run.watch();
    fs::write(world.path("config/bokehcam/config.toml"), TYPO).unwrap();
    for (variable, value) in VARIABLES {
        let ctl = |args: &[&str]| Ran::of(world.bokehcam(&[&["ctl"], args].concat()).env(variable, value));
        // The fastest of some: other programs may need the machine just now.
        let took = (0..5).map(|_| {
            assert!(ctl(&["on"]).done().contains("stream is on"));
            pictures.wait_for("pictures", |picture| !picture.is_card());
            let began = Instant::now();
            assert!(ctl(&["off"]).done().contains("stream is off"));
            let took = began.elapsed();
            pictures.wait_for("the card", Picture::is_card);
            took
        });
        let took = took.min().unwrap();
        assert!(took < SECOND, "{variable}={value}: {took:?}");
        assert!(ctl(&["toggle"]).done().contains("stream is on"));
        assert_eq!(ctl(&["status", "--json"]).json()["on"], true);
        assert!(ctl(&["list"]).printed().starts_with("stream "));
        assert!(ctl(&["snapshot", "--to", "me.png"]).printed().ends_with("me.png\n"));
        fs::remove_file(world.path("here/me.png")).unwrap();
        // What the run knows without the file goes on; what is in the file is refused with its line.
        ctl(&["preset", "dreamy"]).done();
        ctl(&["set", "blur=2%"]).done();
        ctl(&["preset", "evening"]).refused(2, &["config.toml:3: there is no setting 'highlihts'"]);
    }
    assert_eq!(run.interrupt(), 0);
}

#[test]
fn off_is_off_within_a_second_beside_an_output_that_stalls() {
    let world = World::new();
    // The standard output has no reader.
    let run = world.stream("stream", &["--to", "-", "--to", "call.y4m"]);
    fs::write(world.path("config/bokehcam/config.toml"), TYPO).unwrap();
    let off_within = || {
        world.ctl(&["on"]).done();
        let began = Instant::now();
        // It answers once the card is shown, or the output that stalls is given up on.
        let off = Beside::start(world.bokehcam(&["ctl", "off"]).stderr(std::process::Stdio::piped()));
        until("it is off", || {
            thread::sleep(Duration::from_millis(20));
            world.status(&[])["on"] == false
        });
        let took = began.elapsed();
        assert!(off.end(HANG).done().contains("stream is off"));
        took
    };
    let took = (0..5).map(|_| off_within()).min().unwrap();
    assert!(took < SECOND, "{took:?}");
    assert_eq!(run.interrupt(), 0);
}
