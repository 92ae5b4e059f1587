//! Time to prepare another aperture until frames can be blurred with it, from the window's log.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::Result;
use super::program::Beside;
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// The key of the first user preset, after the five built-in ones.
const FIRST_KEY: u8 = b'6';
/// The apertures, measured in this order; the first one is repeated at the end, as it may be cached.
const SHAPES: [&str; 4] = ["heart", "star:5", "polygon:6", "polygon:7:10"];
const DISC: &str = "aperture = \"disc\"\ncoc-at-infinity = \"3%\"\nhighlights = 8\n";
/// Number of runs of each program; no cache survives a run.
const ROUNDS: usize = 7;
/// The log text before the duration.
const EXECUTOR_MADE: &str = "an executor was made in ";

/// Measures each of `programs` in turn, and prints the results; `recording` must have depth.
pub fn measure(recording: &Path, scratch: &Path, programs: &[PathBuf]) -> Result<()> {
    let config = scratch.join("bokehcam");
    fs::create_dir_all(&config)?;
    let preset = |(k, shape): (usize, &&str)| format!("[presets.own{k}]\n{}", DISC.replace("disc", shape));
    let text: String = SHAPES.iter().enumerate().map(preset).collect();
    fs::write(config.join("config.toml"), DISC.to_owned() + &text)?;
    let mut took_ms = vec![vec![Vec::new(); SHAPES.len() + 1]; programs.len()];
    for _ in 0..ROUNDS {
        for (program, took_ms) in programs.iter().zip(&mut took_ms) {
            for (took_ms, took) in took_ms.iter_mut().zip(measure_shapes(program, recording, scratch)?) {
                took_ms.push(took);
            }
        }
    }
    for (program, took_ms) in programs.iter().zip(took_ms) {
        for (shape, took_ms) in SHAPES.iter().chain(&["heart again"]).zip(took_ms) {
            println!("{}: {shape}: median {:.1} ms of {ROUNDS}", program.display(), super::median(took_ms));
        }
    }
    Ok(())
}

/// Measures the time for each shape, in milliseconds, in a new process.
fn measure_shapes(program: &Path, recording: &Path, scratch: &Path) -> Result<Vec<f64>> {
    let (screen, said) = (Screen::new(), scratch.join("said"));
    let mut command = Command::new(program);
    command.args(["-vv", "preview"]).arg(recording).args(["--backend", "cpu", "--panel=false"]);
    command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY");
    command.env("XDG_STATE_HOME", scratch).env("XDG_CONFIG_HOME", scratch).env_remove("RUST_LOG");
    let program = Beside::start(command.stdout(Stdio::null()).stderr(fs::File::create(&said)?));
    let mut window = None;
    until("the window", PATIENCE, || {
        window = Window::of(&screen, program.0.id());
        window.is_some()
    });
    let window = window.ok_or("no window")?;
    std::thread::sleep(Duration::from_secs(2));
    let mut took_ms = Vec::new();
    for key in (0..SHAPES.len() as u32).chain([0]) {
        window.key(&[], u32::from(FIRST_KEY) + key);
        let mut last = None;
        until("another executor", PATIENCE, || {
            let text = fs::read_to_string(&said).unwrap_or_default();
            let made: Vec<&str> = text.split(EXECUTOR_MADE).skip(1).filter_map(|rest| rest.lines().next()).collect();
            last = made.get(took_ms.len()).and_then(|took| parse_milliseconds(took));
            last.is_some()
        });
        took_ms.extend(last);
        std::thread::sleep(Duration::from_millis(500));
    }
    Ok(took_ms)
}

/// Parses a duration in Rust's `Debug` format; returns milliseconds.
fn parse_milliseconds(text: &str) -> Option<f64> {
    let (number, factor) = match text.trim() {
        text if text.ends_with("µs") => (text.trim_end_matches("µs"), 1e-3),
        text if text.ends_with("ms") => (text.trim_end_matches("ms"), 1.0),
        text => (text.trim_end_matches('s'), 1e3),
    };
    Some(number.parse::<f64>().ok()? * factor)
}
