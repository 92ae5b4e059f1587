//! Control of the window by `bokehcam ctl`: changes are synchronised in both directions.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::Path;

use bokehcam_media::recording::snapshot;
use bokehcam_media::recording::still::read_color;
use serde_json::Value;

use super::picture::{distance, is_photograph};
use super::preview::Program;
use super::program::{Home, PORTRAIT};
use super::screen::{Screen, until};
use super::window::PATIENCE;

fn status(program: &Program) -> Value {
    let ran = program.ctl(&["status", "--json"]);
    ran.done();
    ran.json()
}

const LUMA: usize = 640 * 360;
const FRAME: usize = "FRAME\n".len() + LUMA * 3 / 2;

/// Whether the last complete frame of a video is the still card, judged by its luma at the top and at the bottom.
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

    program.ctl(&["set", "effect=none"]).done();
    let sharp = window.until("no blur", |image| distance(image, &before) > 1.0);
    program.ctl(&["preset", "dreamy"]).done();
    window.until("another look", |image| distance(image, &sharp) > 1.0 && distance(image, &before) > 0.5);
    program.ctl(&["set", "rim=0.7", "highlights=-1"]).failed(2, &["--highlights"]);
    assert_eq!(status(&program)["look"]["rim"], "0.5");
    // The user turns the wheel in the window, which overrides the strength set by `ctl`.
    window.wheel((0.5, 0.5), -3);
    until("the wheel shows outside", PATIENCE, || status(&program)["look"]["coc-at-infinity"] != "4.5%");

    program.ctl(&["snapshot", "--to", "me.png"]).done();
    assert_eq!(read_color(&program.home().join("me.png")).unwrap().size(), (640, 360));
    let settings = snapshot::read_settings(&program.home().join("me.png")).unwrap();
    let has = |name: &str, value: &str| settings.contains(&(name.to_owned(), value.to_owned()));
    assert!(has("rim", "0.5") && has("quality", "balanced"), "{settings:?}");

    program.ctl(&["off"]).done();
    window.until("nothing of the person", |image| !is_photograph(image));
    assert_eq!(status(&program)["on"], false);
    program.ctl(&["snapshot", "--to", "no.png"]).failed(1, &["it is off"]);
    std::thread::sleep(std::time::Duration::from_secs(1));
    window.until("still nothing", |image| !is_photograph(image));
    program.ctl(&["toggle"]).done();
    window.until("the person again", is_photograph);
    program.ctl(&["off"]).done();
    let is_part = |file: &fs::DirEntry| file.file_name().to_string_lossy().starts_with(".out.y4m.");
    let part = fs::read_dir(program.home()).unwrap().flatten().find(is_part).expect("it is being written").path();
    until("the card is recorded", PATIENCE, || ends_with_the_card(&part));
    program.interrupt();
    let ended = program.end();
    ended.succeeded();
    assert!(ends_with_the_card(&ended.home.path("out.y4m")), "what was recorded ends with the card");
    assert!(!ended.home.path("run/bokehcam/preview.sock").exists());
}

#[test]
#[ignore = "needs an X server"]
fn what_others_change_is_judged_as_in_a_stream_and_is_not_remembered() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT, "--depth", "none", "--panel=false"]);
    program.window().until("the first picture", is_photograph);
    let set = program.ctl(&["set", "focus=1.0", "rim=0.7"]);
    let warning = "warning: without effect here: --focus 1 (there is no depth)";
    assert!(set.done().contains(warning), "{}", set.stderr);
    program.ctl(&["set", "effect=dof"]).failed(2, &["--effect dof needs depth: leave --depth none out"]);
    assert_eq!(status(&program)["look"]["rim"], "0.7");
    program.interrupt();
    let ended = program.end();
    ended.succeeded();
    let remembered = fs::read_to_string(ended.home.path("state/bokehcam/window.toml")).unwrap();
    assert!(remembered.contains("rim = \"0.2\""), "{remembered}");
}

#[test]
#[ignore = "needs an X server and the network for persons, as `scripts/setup models` brings it"]
fn where_depth_comes_from_is_changed_from_outside() {
    let home = Home::new();
    let models = home.path("data/bokehcam/models");
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
    program.ctl(&["depth", "matte"]).done();
    until("by the mask", PATIENCE, || status(&program)["depth"] == "matte");
    window.until("another blur", |image| is_photograph(image) && distance(image, &measured) > 1.0);
    program.ctl(&["depth", "stereo"]).failed(2, &["use recorded, matte"]);
    program.ctl(&["depth", "sonar"]).failed(2, &["'sonar'", "matte,mono"]);
    program.ctl(&["depth", "recorded"]).done();
    until("measured again", PATIENCE, || status(&program)["depth"] == "recorded");
}
