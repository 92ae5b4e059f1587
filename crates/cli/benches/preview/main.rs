//! `cargo bench --bench preview -- [OPTIONS] [FOLDER]`: the cost of a window over the same stream without one.
//!
//! Alternates `bokehcam stream --to null` and `bokehcam preview` on one recording, each in its own process, and
//! compares the process's processor time per delivered frame. The windows are on an X server without hardware, as in
//! `crates/cli/tests/window`.

#[path = "../../../lab/benches/common/mod.rs"]
mod common;
#[path = "../../tests/window/input.rs"]
#[allow(dead_code)]
mod input;
mod paint;
#[path = "../../tests/window/picture.rs"]
#[allow(dead_code)]
mod picture;
#[path = "../../tests/common/program.rs"]
mod program;
mod reaction;
#[path = "../../tests/window/screen.rs"]
#[allow(dead_code)]
mod screen;
mod shapes;
#[path = "../../tests/window/window.rs"]
#[allow(dead_code)]
mod window;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use clap::Parser;
use screen::Screen;
use serde_json::Value;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What a window costs beyond the same stream without one
#[derive(Parser, Debug)]
#[command(
    name = "preview",
    bin_name = "cargo bench --bench preview --",
    after_help = "\
Examples:
  cargo bench --bench preview
  cargo bench --bench preview -- --rounds 9 somewhere/rgbd
  cargo bench --bench preview -- --panel --quality draft"
)]
struct Options {
    /// A folder with a recording that has depth [default: the synthetic scene, recorded anew at --size]
    folder: Option<PathBuf>,
    /// Size of the recording that is made
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    size: String,
    /// Frames per second of the recording that is made: so few that none is dropped
    #[arg(long, value_name = "RATE", default_value = "12")]
    fps: String,
    /// Frames of each run
    #[arg(long, value_name = "N", default_value_t = 100)]
    frames: u32,
    /// Runs of each kind
    #[arg(long, value_name = "N", default_value_t = 5)]
    rounds: u32,
    /// Quality level of both: one that changes would compare unlike work
    #[arg(long, value_name = "LEVEL", default_value = "draft")]
    quality: String,
    /// With the controls shown
    #[arg(long)]
    panel: bool,
    /// Measure instead how soon the window answers a key, from outside, while the pipeline is busy or stuck
    #[arg(long)]
    reaction: bool,
    /// Measure instead how long another aperture is worked on; with each of these programs besides this one
    #[arg(long, value_name = "PROGRAM", num_args = 0..)]
    shapes: Option<Vec<PathBuf>>,
    /// Measure instead what a frame of 1280x720 costs that is painted on the CPU
    #[arg(long)]
    paint: bool,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// Length of the generated recording, in frames; it is looped.
const RECORDED_FRAMES: u32 = 16;

fn main() -> ExitCode {
    let options = match common::options::<Options>() {
        Ok(options) => options,
        Err(code) => return code,
    };
    match measure_all(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure_all(options: &Options) -> Result<()> {
    if options.paint {
        paint::measure();
        return Ok(());
    }
    let scratch = tempfile::tempdir()?;
    let folder = match &options.folder {
        Some(folder) => folder.clone(),
        None => record_scene(options, scratch.path())?,
    };
    if options.reaction {
        return reaction::measure(&folder, scratch.path());
    }
    if let Some(others) = &options.shapes {
        let own = PathBuf::from(env!("CARGO_BIN_EXE_bokehcam"));
        let programs: Vec<PathBuf> = others.iter().cloned().chain([own]).collect();
        return shapes::measure(&folder, scratch.path(), &programs);
    }
    let screen = Screen::new();
    let mut runs = [Vec::new(), Vec::new()];
    let (mut shown, mut presented) = (Vec::new(), Vec::new());
    for round in 1..=options.rounds {
        for (kind, costs) in runs.iter_mut().enumerate() {
            let report = run_program(options, &folder, kind == 1, &screen, scratch.path())?;
            let number = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64);
            let delivered = number("/frames/delivered").filter(|&frames| frames > 0.0).ok_or("no frame came out")?;
            let cost_ms = 1e3 * number("/cpu_s").ok_or("the report has no cpu_s")? / delivered;
            costs.push(cost_ms);
            if kind == 1 {
                shown.push(number("/window/presented").unwrap_or_default() / delivered);
                presented.push(number("/window/present_ms/p50").unwrap_or(f64::NAN));
            }
            let name = ["stream --to null", "preview"][kind];
            println!("round {round}: {name:16} {cost_ms:6.2} ms of processor time a frame, {delivered} frames");
        }
    }
    let differences: Vec<f64> = runs[1].iter().zip(&runs[0]).map(|(preview, stream)| preview - stream).collect();
    let [stream, preview] = runs.map(median);
    println!("median: stream {stream:.2} ms, preview {preview:.2} ms ({:.3} times)", preview / stream);
    println!("the window, by processor time: {:.2} ms a frame", median(differences));
    println!("drawing a frame, by the window's own clock: {:.2} ms", median(presented));
    println!("{:.0} % of the frames were on the screen", 100.0 * median(shown));
    Ok(())
}

fn bokehcam_command() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.arg("--quiet").stdin(Stdio::null());
    command
}

fn record_scene(options: &Options, scratch: &Path) -> Result<PathBuf> {
    let folder = scratch.join("recording");
    eprintln!("recording {RECORDED_FRAMES} frames of {}", options.size);
    let status = bokehcam_command()
        .args([
            "record",
            "synthetic",
            "--size",
            &options.size,
            "--fps",
            &options.fps,
            "--frames",
            &RECORDED_FRAMES.to_string(),
            "--to",
        ])
        .arg(&folder)
        .status()?;
    if status.success() { Ok(folder) } else { Err("the recording failed".into()) }
}

fn run_program(options: &Options, folder: &Path, window: bool, screen: &Screen, scratch: &Path) -> Result<Value> {
    let path = scratch.join("report.json");
    let mut command = bokehcam_command();
    if window {
        command.args(["preview", &format!("--panel={}", options.panel)]);
    } else {
        command.args(["stream", "--loop", "--pace", "realtime", "--to", "null"]);
    }
    command.arg(folder).args(["--backend", "cpu", "--quality", &options.quality, "--force"]);
    command.args(["--frames", &options.frames.to_string()]).arg("--report").arg(&path);
    command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY");
    command.env("XDG_STATE_HOME", scratch).env("XDG_CONFIG_HOME", scratch);
    let status = command.status()?;
    if !status.success() {
        return Err(format!("{command:?}: {status}").into());
    }
    Ok(serde_json::from_slice(&std::fs::read(&path)?)?)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
