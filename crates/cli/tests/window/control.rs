//! Others ask the window from outside: what they change shows in it, and what the person changes shows to them.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Command;

use bokehcam::recording::still::read_color;
use serde_json::Value;

use super::picture::{distance, is_photograph};
use super::program::{PORTRAIT, Program};
use super::screen::{Screen, until};
use super::window::PATIENCE;

/// What `bokehcam ctl` says: its exit code, and what it prints.
fn ctl(program: &Program, args: &[&str]) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.arg("ctl").args(args).env("XDG_RUNTIME_DIR", program.home().join("run")).current_dir(program.home());
    let output = command.env("XDG_CONFIG_HOME", program.home().join("config")).output().unwrap();
    let said = if output.status.success() { output.stdout } else { output.stderr };
    (output.status.code().unwrap(), String::from_utf8(said).unwrap())
}

fn status(program: &Program) -> Value {
    let (code, said) = ctl(program, &["status", "--json"]);
    assert_eq!(code, 0, "{said}");
    serde_json::from_str(&said).unwrap()
}

const LUMA: usize = 640 * 360;
const FRAME: usize = "FRAME\n".len() + LUMA * 3 / 2;

/// Whether the last whole picture of a video is the card: dark, the same from side to side.
fn ends_with_the_card(video: &Path) -> bool {
    let file = File::open(video).unwrap();
    let mut first = [0; 200];
    let read = file.read_at(&mut first, 0).unwrap();
    let Some(header) = first[..read].iter().position(|byte| *byte == b'\n') else { return false };
    let bytes = file.metadata().unwrap().len() as usize - header - 1;
    let Some(last) = (bytes / FRAME).checked_sub(1) else { return false };
    let mut luma = vec![0; LUMA];
    let at = header + 1 + last * FRAME + "FRAME\n".len();
    file.read_exact_at(&mut luma, at as u64).unwrap();
    luma[0].abs_diff(57) <= 3 && luma[LUMA - 640].abs_diff(38) <= 3
}

#[test]
#[ignore = "needs an X server"]
fn what_is_asked_from_outside_shows_here_and_what_is_done_here_shows_there() {
    let screen = Screen::new();
    let still = ["--start", "0", "--end", "0.05", "--panel=false", "--quality", "balanced", "--to", "out.y4m"];
    let mut program = Program::start(&screen, &[&[PORTRAIT], &still[..]].concat());
    let window = program.window();
    let before = window.until("the first picture", is_photograph);
    let told = status(&program);
    assert_eq!((&told["command"], &told["on"], &told["name"]), (&"preview".into(), &true.into(), &"preview".into()));
    assert_eq!(told["sinks"][0], "window");
    assert_eq!(told["look"]["coc-at-infinity"], "auto");

    assert_eq!(ctl(&program, &["set", "effect=none"]).0, 0);
    let sharp = window.until("no blur", |image| distance(image, &before) > 1.0);
    assert_eq!(ctl(&program, &["preset", "dreamy"]).0, 0);
    window.until("another look", |image| distance(image, &sharp) > 1.0 && distance(image, &before) > 0.5);
    let (code, said) = ctl(&program, &["set", "rim=0.7", "highlights=-1"]);
    assert!(code == 2 && said.contains("--highlights"), "{said}");
    assert_eq!(status(&program)["look"]["rim"], "0.5");
    // The person turns the wheel here, and undoes what came from there.
    window.wheel((0.5, 0.5), -3);
    until("the wheel shows outside", PATIENCE, || status(&program)["look"]["coc-at-infinity"] != "4.5%");

    assert_eq!(ctl(&program, &["snapshot", "--to", "me.png"]).0, 0);
    assert_eq!(read_color(&program.home().join("me.png")).unwrap().size(), (640, 360));

    assert_eq!(ctl(&program, &["off"]).0, 0);
    window.until("nothing of the person", |image| !is_photograph(image));
    assert_eq!(status(&program)["on"], false);
    assert!(ctl(&program, &["snapshot", "--to", "no.png"]).1.contains("it is off"));
    std::thread::sleep(std::time::Duration::from_secs(1));
    window.until("still nothing", |image| !is_photograph(image));
    assert_eq!(ctl(&program, &["toggle"]).0, 0);
    window.until("the person again", is_photograph);
    assert_eq!(ctl(&program, &["off"]).0, 0);
    let is_part = |file: &fs::DirEntry| file.file_name().to_string_lossy().starts_with(".out.y4m.");
    let part = fs::read_dir(program.home()).unwrap().flatten().find(is_part).expect("it is being written").path();
    until("the card is recorded", PATIENCE, || ends_with_the_card(&part));
    program.interrupt();
    let ended = program.end();
    ended.succeeded();
    assert!(ends_with_the_card(&ended.home.path().join("out.y4m")), "what was recorded ends with the card");
    assert!(!ended.home.path().join("run/bokehcam/preview.sock").exists());
}

#[test]
#[ignore = "needs an X server"]
fn what_others_change_is_judged_as_in_a_stream_and_is_not_remembered() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT, "--depth", "none", "--panel=false"]);
    program.window().until("the first picture", is_photograph);
    let said = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
        command.arg("ctl").args(args).env("XDG_RUNTIME_DIR", program.home().join("run")).current_dir(program.home());
        let output = command.env("XDG_CONFIG_HOME", program.home().join("config")).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, line) = said(&["set", "focus=1.0", "rim=0.7"]);
    assert!(code == 0 && line.contains("warning: without effect here: --focus 1 (there is no depth)"), "{line}");
    let (code, line) = said(&["set", "effect=dof"]);
    assert!(code == 2 && line.contains("--effect dof follows depth, and this run has none"), "{line}");
    assert_eq!(status(&program)["look"]["rim"], "0.7");
    program.interrupt();
    let ended = program.end();
    ended.succeeded();
    let remembered = fs::read_to_string(ended.home.path().join("state/bokehcam/window.toml")).unwrap();
    assert!(remembered.contains("rim = \"0.2\""), "{remembered}");
}

#[test]
#[ignore = "needs an X server and the network for persons, as `scripts/setup models` brings it"]
fn where_depth_comes_from_is_changed_from_outside() {
    let home = tempfile::tempdir().unwrap();
    let models = home.path().join(".local/share/bokehcam/models");
    fs::create_dir_all(&models).unwrap();
    let built = std::env::var("TEST_MODELS").expect("TEST_MODELS names the folder of networks");
    for file in fs::read_dir(built).unwrap().flatten() {
        fs::copy(file.path(), models.join(file.file_name())).unwrap();
    }
    let screen = Screen::new();
    let mut program = Program::start_at(&screen, home, &[PORTRAIT, "--panel=false"]);
    let window = program.window();
    let measured = window.until("the first picture", is_photograph);
    assert_eq!(status(&program)["depth"], "recorded");
    assert_eq!(ctl(&program, &["depth", "matte"]).0, 0);
    until("by the mask", PATIENCE, || status(&program)["depth"] == "matte");
    window.until("another blur", |image| is_photograph(image) && distance(image, &measured) > 1.0);
    let (code, said) = ctl(&program, &["depth", "stereo"]);
    assert!(code == 2 && said.contains("use recorded, matte"), "{said}");
    let (code, said) = ctl(&program, &["depth", "sonar"]);
    assert!(code == 2 && said.contains("'sonar'") && said.contains("matte,mono"), "{said}");
    assert_eq!(ctl(&program, &["depth", "recorded"]).0, 0);
    until("measured again", PATIENCE, || status(&program)["depth"] == "recorded");
}
