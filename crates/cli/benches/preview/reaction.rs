//! Latency from a key press to its effect on the screen, while the pipeline is busy or blocked.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use x11rb::protocol::xproto::{ConnectionExt, ImageFormat};

use super::Result;
use super::program::Beside;
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// Number of key presses per case.
const PRESSES: usize = 120;
/// An area that differs in brightness between the picture and its depth: left, top, width and height, in window pixels.
const CORNER: (i16, i16, u16, u16) = (60, 30, 60, 60);
/// The picture whose read blocks for ever.
const STUCK: &str = "rgb/stuck.png";

/// Runs the measurement and prints its result; `recording` must have depth.
pub fn measure(recording: &Path, scratch: &Path) -> Result<()> {
    let stuck = scratch.join("stuck");
    create_stuck_recording(recording, &stuck)?;
    let busy = ["--quality", "best", "--coc-at-infinity", "6%", "--max-coc", "60"];
    let cases: [(&str, &Path, &[&str]); 3] = [
        ("as usual", recording, &[]),
        ("both cores busy with the blur", recording, &busy),
        ("source stuck", &stuck, &[]),
    ];
    for (name, folder, more) in cases {
        let screen = Screen::new();
        let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
        command.arg("--quiet").arg("preview").arg(folder).args(more).args(["--backend", "cpu", "--panel=false"]);
        command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY").stderr(Stdio::null());
        command.env("XDG_STATE_HOME", scratch).env("XDG_CONFIG_HOME", scratch);
        let program = Beside::start(&mut command);
        let mut window = None;
        until("the window", PATIENCE, || {
            window = Window::of(&screen, program.0.id());
            window.is_some()
        });
        let window = window.ok_or("no window")?;
        until("its first picture", PATIENCE, || {
            capture_corner(&window).is_some_and(|bytes| bytes.iter().any(|byte| *byte > 40))
        });
        std::thread::sleep(Duration::from_secs(2));
        let mut took_ms: Vec<f64> = (0..PRESSES).filter_map(|press| measure_reaction(&window, press)).collect();
        took_ms.sort_by(f64::total_cmp);
        let at = |share: f64| took_ms.get(((took_ms.len() - 1) as f64 * share).round() as usize).copied();
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| at(share).unwrap_or(f64::NAN));
        if took_ms.len() < PRESSES {
            return Err(format!("{name}: {} of {PRESSES} keys were never answered", PRESSES - took_ms.len()).into());
        }
        println!("{name}: {} keys, p50 {p50:.0} ms, p99 {p99:.0} ms, longest {max:.0} ms", took_ms.len());
    }
    Ok(())
}

/// Copies a recording, with a pipe that has no writer as its third picture.
fn create_stuck_recording(recording: &Path, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder.join("rgb"))?;
    fs::create_dir_all(folder.join("depth"))?;
    for (list, name) in [("rgb.txt", "rgb"), ("depth.txt", "depth")] {
        let text = fs::read_to_string(recording.join(list))?;
        let mut lines: Vec<String> =
            text.lines().filter(|line| !line.starts_with('#')).take(4).map(str::to_owned).collect();
        for line in &lines {
            let file = line.split_whitespace().nth(1).ok_or("a list without files")?;
            fs::copy(recording.join(file), folder.join(file))?;
        }
        if name == "rgb" {
            let time = lines[2].split_whitespace().next().unwrap_or_default().to_owned();
            lines[2] = format!("{time} {STUCK}");
        }
        fs::write(folder.join(list), lines.join("\n") + "\n")?;
    }
    let made = Command::new("mkfifo").arg(folder.join(STUCK)).status()?;
    if made.success() { Ok(()) } else { Err("mkfifo failed".into()) }
}

/// Captures the corner's current pixels.
fn capture_corner(window: &Window) -> Option<Vec<u8>> {
    let (x, y, width, height) = CORNER;
    let asked = window.screen.x.get_image(ImageFormat::Z_PIXMAP, window.id, x, y, width, height, u32::MAX).ok()?;
    Some(asked.reply().ok()?.data)
}

fn mean_brightness(bytes: &[u8]) -> f64 {
    bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / bytes.len().max(1) as f64
}

/// Toggles the view of depth by key, and waits until it appears or disappears. The result includes the harness's pause
/// after a key, which is its lower bound.
fn measure_reaction(window: &Window, press: usize) -> Option<f64> {
    std::thread::sleep(Duration::from_millis(90 + 37 * (press as u64 % 7)));
    let before = mean_brightness(&capture_corner(window)?);
    let began = Instant::now();
    window.key(&[], u32::from('d'));
    while began.elapsed() < PATIENCE {
        if (mean_brightness(&capture_corner(window)?) - before).abs() > 8.0 {
            return Some(began.elapsed().as_secs_f64() * 1e3);
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    None
}
