//! The PipeWire session, its graph, and the program in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use bokehcam::frame::ColorImage;
use rustix::process::Signal;
use serde_json::Value;

use super::program::{Beside, assert_accounted, bokehcam, found, json};

/// Timeout against hangs; far longer than needed even on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(120);
pub const SIZE: (u32, u32) = (320, 180);
pub const FPS: u32 = 30;
/// Number of pictures in the looped recording.
pub const PICTURES: usize = 40;

/// Returns the folder of the session created by `crates/cli/tests/pipewire/session`.
pub fn folder() -> PathBuf {
    assert!(
        std::env::var_os("PIPEWIRE_TEST_SESSION").is_some(),
        "not in a session of crates/cli/tests/pipewire/session"
    );
    PathBuf::from(std::env::var_os("XDG_RUNTIME_DIR").unwrap())
}

/// Waits until `is` returns a value.
#[track_caller]
pub fn until<T>(what: &str, is: impl FnMut() -> Option<T>) -> T {
    found(what, PATIENCE, is)
}

/// Returns all objects of the graph, by `pw-dump`.
pub fn graph() -> Vec<Value> {
    let told = Command::new("pw-dump").output().unwrap();
    // Without the daemon, the output is empty or incomplete.
    serde_json::from_slice(&told.stdout).unwrap_or_default()
}

/// Finds a node by name.
pub fn node(name: &str) -> Option<Value> {
    graph()
        .into_iter()
        .find(|object| object["info"]["props"]["node.name"] == name && object["info"]["state"].is_string())
}

/// Returns the state of a node, such as `suspended`.
pub fn state(name: &str) -> Option<String> {
    node(name)?["info"]["state"].as_str().map(str::to_owned)
}

/// Draws picture `number` of the recording; all are different.
pub fn picture(number: usize) -> ColorImage {
    let mut picture = ColorImage::new(SIZE.0, SIZE.1);
    for (at, pixel) in picture.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let (x, y) = (at % SIZE.0 as usize, at / SIZE.0 as usize);
        *pixel = [(x + 5 * number) as u8, (2 * y) as u8, (6 * number) as u8];
    }
    picture
}

/// Returns the picture that readers should get: 8-bit YUYV, limited-range BT.601.
pub fn yuyv(picture: &ColorImage) -> Vec<u8> {
    let codes = |pair: &[u8; 6]| {
        let [left, right] = [[pair[0], pair[1], pair[2]], [pair[3], pair[4], pair[5]]].map(|rgb| rgb.map(i32::from));
        let luma = |[r, g, b]: [i32; 3]| (((66 * r + 129 * g + 25 * b + 128) >> 8) + 16) as u8;
        let [r, g, b] = [0, 1, 2].map(|channel| left[channel] + right[channel]);
        let cb = (((56 * b - 19 * r - 37 * g + 128) >> 8) + 128) as u8;
        let cr = (((56 * r - 47 * g - 9 * b + 128) >> 8) + 128) as u8;
        [luma(left), cb, luma(right), cr]
    };
    picture.rgb.as_chunks::<6>().0.iter().flat_map(codes).collect()
}

/// Creates a recording of [`PICTURES`] pictures at 30 per second.
pub fn recording(folder: &Path) -> PathBuf {
    let folder = folder.join("recording");
    fs::create_dir_all(folder.join("rgb")).unwrap();
    let mut list = String::new();
    for number in 0..PICTURES {
        let file = fs::File::create(folder.join(format!("rgb/{number}.png"))).unwrap();
        let mut encoder = png::Encoder::new(file, SIZE.0, SIZE.1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(&picture(number).rgb).unwrap();
        list += &format!("{:.6} rgb/{number}.png\n", number as f64 / f64::from(FPS));
    }
    fs::write(folder.join("rgb.txt"), list).unwrap();
    folder
}

/// A running `bokehcam`.
pub struct Run {
    program: Beside,
    folder: tempfile::TempDir,
}

impl Run {
    pub fn start(arguments: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), arguments)
    }

    fn start_in(folder: tempfile::TempDir, arguments: &[&str]) -> Self {
        let mut command = bokehcam(arguments);
        command.args(["--quiet", "--report"]).arg(folder.path().join("report.json")).stdout(Stdio::null());
        let said = fs::File::create(folder.path().join("said")).unwrap();
        Self { program: Beside::start(command.stderr(said)), folder }
    }

    fn said(&self) -> String {
        fs::read_to_string(self.folder.path().join("said")).unwrap()
    }

    /// Whether the program has ended.
    pub fn is_over(&mut self) -> bool {
        !self.program.runs()
    }

    /// Whether the program has given up on a camera that gave no pictures, or was away.
    pub fn has_given_up(&mut self) -> bool {
        let said = if self.is_over() { self.said() } else { return false };
        ["no pictures come", "there is no camera"].iter().any(|why| said.contains(why))
    }

    /// Waits for a failure, of usage or at run time; returns its message.
    pub fn refused(mut self) -> String {
        let ended = until("the refusal", || self.program.0.try_wait().unwrap());
        assert!(matches!(ended.code(), Some(1 | 2)), "{ended}");
        self.said()
    }

    /// Waits for the program to end by itself; returns its report.
    pub fn ended(mut self) -> Value {
        let ended = until("the end of the run", || self.program.0.try_wait().unwrap());
        assert!(ended.success(), "{ended}: {}", self.said());
        let report = json(self.folder.path().join("report.json"));
        assert_accounted(&report);
        let (frames, number) = (&report["frames"], |value: &Value| value.as_u64().unwrap());
        for node in report["pipewire"].as_array().into_iter().flatten() {
            let put: u64 = ["shown", "unwatched", "overtaken", "no_buffer"].iter().map(|key| number(&node[key])).sum();
            // The last frame may be in flight.
            assert!(put.abs_diff(number(&frames["delivered"])) <= 1, "{node} of {frames}");
        }
        report
    }

    /// Sends SIGINT, as Ctrl-C does; returns the report.
    pub fn end(self) -> Value {
        self.program.signal(Signal::INT);
        self.ended()
    }
}

/// A run that plays the recording into an output.
pub struct Player(Run);

impl Player {
    /// Starts a run with more arguments, and waits for the node `name`.
    pub fn start(name: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recording = recording(folder.path());
        let all = ["stream", recording.to_str().unwrap(), "--loop", "--effect", "none", "--pace", "realtime"];
        let player = Self(Run::start_in(folder, &[&all, arguments].concat()));
        until("the node", || node(name));
        player
    }

    /// Returns the process id of its child.
    pub fn child(&self) -> String {
        self.0.program.children()[0].as_raw_nonzero().to_string()
    }

    /// Returns the folder of the recording's pictures.
    pub fn pictures(&self) -> PathBuf {
        self.0.folder.path().join("recording/rgb")
    }

    /// Sends SIGINT, as Ctrl-C does; returns the report.
    pub fn end(self) -> Value {
        self.0.end()
    }
}

/// Kills a daemon of the session, which restarts after a second.
pub fn kill(daemon: &str) {
    let process = fs::read_to_string(folder().join(format!("{daemon}.pid"))).unwrap();
    assert!(Command::new("kill").args(["-KILL", process.trim()]).status().unwrap().success());
}
