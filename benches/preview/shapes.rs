//! How soon another aperture is seen: from a preset's key to the first picture with it, measured on the screen.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use x11rb::protocol::xproto::{ConnectionExt, ImageFormat};

use super::Result;
use super::screen::{Beside, Screen, until};
use super::window::{PATIENCE, Window};

/// Own presets get the keys after the five that come with the program.
const FIRST_KEY: u8 = b'6';
/// Apertures that are not remembered yet.
const SHAPES: [&str; 4] = ["heart", "star:5", "polygon:6", "polygon:7:10"];
const DISC: &str = "aperture = \"disc\"\ncoc-at-infinity = \"6%\"\nmax-coc = 60\nhighlights = 20\n";
/// Times that each key is pressed.
const ROUNDS: usize = 5;
/// Nothing changes by itself for this long before a key is pressed.
const REST: Duration = Duration::from_millis(400);

/// Measures and prints, with each of `programs` in turn; `recording` has depth.
pub fn measure(recording: &Path, scratch: &Path, programs: &[PathBuf]) -> Result<()> {
    let config = scratch.join("bokehcam");
    fs::create_dir_all(&config)?;
    let preset = |(k, shape): (usize, &&str)| format!("[presets.own{k}]\n{}", DISC.replace("disc", shape));
    let text: String = SHAPES.iter().enumerate().map(preset).collect();
    fs::write(config.join("config.toml"), DISC.to_owned() + &text)?;
    let mut took_ms = vec![vec![Vec::new(); SHAPES.len()]; programs.len()];
    for round in 0..ROUNDS {
        for (program, took_ms) in programs.iter().zip(&mut took_ms) {
            eprintln!("round {} of {ROUNDS}: {}", round + 1, program.display());
            for (took_ms, took) in took_ms.iter_mut().zip(shapes(program, recording, scratch)?) {
                took_ms.push(took);
            }
        }
    }
    for (program, took_ms) in programs.iter().zip(took_ms) {
        for (shape, took_ms) in SHAPES.iter().zip(took_ms) {
            println!("{}: disc to {shape}: median {:.0} ms of {ROUNDS}", program.display(), super::median(took_ms));
        }
    }
    Ok(())
}

/// The time to each shape, in milliseconds, in a program that was started anew: nothing is remembered of it.
fn shapes(program: &Path, recording: &Path, scratch: &Path) -> Result<Vec<f64>> {
    let screen = Screen::new();
    let mut command = Command::new(program);
    command.arg("--quiet").arg("preview").arg(recording).args(["--start", "0", "--end", "0.02"]);
    command.args(["--backend", "cpu", "--panel=false", "--quality", "draft"]);
    command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY").stderr(Stdio::null());
    command.env("XDG_STATE_HOME", scratch).env("XDG_CONFIG_HOME", scratch);
    let program = Beside::start(&mut command);
    let mut window = None;
    until("the window", PATIENCE, || {
        window = Window::of(&screen, program.0.id());
        window.is_some()
    });
    let window = window.ok_or("no window")?;
    let mut took_ms = Vec::new();
    for key in 0..SHAPES.len() {
        let before = at_rest(&window)?;
        let began = Instant::now();
        window.key(&[], u32::from(FIRST_KEY) + key as u32);
        while look(&window)? == before {
            if began.elapsed() > PATIENCE {
                return Err(format!("no other picture after the key of {}", SHAPES[key]).into());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        took_ms.push(began.elapsed().as_secs_f64() * 1e3);
        at_rest(&window)?;
        window.key(&[], u32::from('r'));
    }
    Ok(took_ms)
}

/// What is shown once that has not changed for a while.
fn at_rest(window: &Window) -> Result<Vec<u8>> {
    let (mut shown, mut since) = (look(window)?, Instant::now());
    while since.elapsed() < REST {
        let now = look(window)?;
        if now != shown {
            (shown, since) = (now, Instant::now());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(shown)
}

/// A strip of the picture with lights in it.
fn look(window: &Window) -> Result<Vec<u8>> {
    let (width, height) = window.size();
    let (at, size) = ((0, height as i16 / 4), (width as u16, 48));
    let asked = window.screen.x.get_image(ImageFormat::Z_PIXMAP, window.id, at.0, at.1, size.0, size.1, u32::MAX)?;
    Ok(asked.reply()?.data)
}
