//! The virtual machine's devices, reloaded for each test, and helpers.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use bokehcam::frame::ColorImage;
use bokehcam_live::capture::v4l2::V4l2Camera;
use bokehcam_live::capture::{Captured, MAX_WAIT};
use bokehcam_live::layout::Content;
use bokehcam_live::v4l2::live::ModeRequest;
use bokehcam_live::v4l2::node::list_nodes;
use bokehcam_live::v4l2::{Device, FourCc, controls};
use rustix::process::Signal;

use super::program::{self, Beside, Ran, assert_accounted, json};

/// The test camera (`vivid`).
pub const CAMERA: &str = "/dev/video0";
/// The virtual camera (`v4l2loopback`).
pub const VIRTUAL: &str = "/dev/video20";
/// Tested versions of v4l2loopback: without events, with events, and with the current rules.
pub const VERSIONS: [&str; 3] = ["0.12.7", "0.13.2", "0.15.0"];

/// The runtime folder with the sockets for `ctl`.
const RUNTIME: &str = "/run/bokehcam-test";

/// One camera with two inputs: 0 is a webcam, 1 is HDMI, whose signal determines the frame rate.
const VIVID: &str = "n_devs=1 node_types=0x1 num_inputs=2 input_types=0xc vid_cap_nr=0";

/// Timeout against hangs. Durations are printed but not asserted, because the machine is emulated and shared.
pub const HANG: Duration = Duration::from_secs(300);

static ALONE: Mutex<()> = Mutex::new(());

/// Exclusive access to the devices.
pub struct Machine {
    _alone: MutexGuard<'static, ()>,
}

impl Machine {
    /// Loads a camera, and a virtual camera of v4l2loopback 0.12.7.
    pub fn new() -> Self {
        Self::with(VIVID, VERSIONS[0])
    }

    /// Takes the devices as they are.
    pub fn alone() -> Self {
        assert!(std::env::var_os("BOKEHCAM_VM").is_some(), "not in the virtual machine: see tests/vm/run");
        // A failed test poisons the lock, but all state that matters is reloaded.
        let machine = Self { _alone: ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) };
        sh(&format!("mkdir -p -m 700 {RUNTIME}"));
        machine
    }

    /// Loads a camera with module arguments, and a virtual camera of a version.
    pub fn with(vivid: &str, version: &str) -> Self {
        let machine = Self::alone();
        unload("vivid");
        sh(&format!("modprobe vivid {vivid}"));
        machine.loopback(version);
        let camera = Device::open(CAMERA.as_ref()).unwrap();
        // Without the changing text, all frames are equal.
        controls::set_control(&camera, "osd_text_mode", "None").unwrap();
        machine
    }

    /// Reloads the virtual camera.
    pub fn loopback(&self, version: &str) {
        unload("v4l2loopback");
        let arguments = "devices=1 video_nr=20 exclusive_caps=1 card_label=bokehcam-test";
        sh(&format!("insmod /run/vm/v4l2loopback/{version}.ko {arguments}"));
    }

    /// Sets a control of the camera, as another program would.
    pub fn control(&self, name: &str, value: &str) {
        controls::set_control(&Device::open(CAMERA.as_ref()).unwrap(), name, value).unwrap();
    }

    /// Selects the HDMI input at 30 frames per second, for any size.
    pub fn at_30_fps(&self) {
        sh(&format!("v4l2-ctl -d {CAMERA} -i 1 && v4l2-ctl -d {CAMERA} --set-dv-bt-timings index=5"));
    }
}

fn unload(module: &str) {
    let began = Instant::now();
    while Path::new("/sys/module").join(module).exists() {
        let done = Command::new("rmmod").arg(module).output().unwrap();
        assert!(began.elapsed() < HANG, "{module} stays loaded: {}", String::from_utf8_lossy(&done.stderr));
        std::thread::sleep(Duration::from_millis(if done.status.success() { 0 } else { 100 }));
    }
}

/// Runs a shell command; asserts success, and returns stdout.
pub fn sh(line: &str) -> String {
    let ran = Ran::of(Command::new("sh").args(["-c", line]).stdin(Stdio::null()));
    assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
    ran.stdout
}

/// Returns a command that runs the program without user settings.
pub fn bokehcam(arguments: &str) -> Command {
    let mut command = program::bokehcam(&arguments.split_whitespace().collect::<Vec<_>>());
    command.env("XDG_CONFIG_HOME", "/nowhere").env("XDG_RUNTIME_DIR", RUNTIME);
    command
}

/// Runs the program to its end.
pub fn run(arguments: &str) -> Ran {
    Ran::of(&mut bokehcam(arguments))
}

/// Starts a background process with piped stdout and stderr.
pub fn beside(mut command: Command) -> Beside {
    Beside::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()))
}

/// A `bokehcam stream` in the background.
pub struct Stream(Beside);

impl Stream {
    /// Starts a stream.
    pub fn start(arguments: &str) -> Self {
        Self(beside(bokehcam(&format!("stream {arguments} --force --report {REPORT}"))))
    }

    /// Starts a stream to the virtual camera, and waits for its first picture.
    pub fn show(arguments: &str) -> Self {
        let mut stream = Self::start(&format!("{arguments} --to {VIRTUAL}"));
        until("the virtual camera shows something", || {
            assert!(stream.0.runs(), "it ended");
            list_nodes().iter().any(|node| node.path == Path::new(VIRTUAL) && node.captures)
        });
        stream
    }

    /// Receives the frames on its standard output, of this size; each is read on demand, without a queue.
    pub fn frames(&mut self, (width, height): (usize, usize)) -> Receiver<()> {
        let mut stdout = BufReader::new(self.0.0.stdout.take().unwrap());
        let (told, frames) = mpsc::sync_channel(0);
        std::thread::spawn(move || {
            stdout.read_until(b'\n', &mut Vec::new()).unwrap();
            let mut frame = vec![0; "FRAME\n".len() + width * height + 2 * width.div_ceil(2) * height.div_ceil(2)];
            // Without a receiver, the output is still drained, so that the program can end.
            let mut asked = true;
            while stdout.read_exact(&mut frame).is_ok() {
                asked = asked && told.send(()).is_ok();
            }
        });
        frames
    }

    /// Waits for its end, or interrupts it; asserts success, and returns the report.
    pub fn report(self, interrupted: bool) -> serde_json::Value {
        let ended = if interrupted { self.0.end_by(Signal::INT, HANG) } else { self.0.end(HANG) };
        ended.done();
        let report = json(REPORT);
        assert_accounted(&report);
        report
    }
}

const REPORT: &str = "/tmp/report.json";

/// Waits until a condition holds, and prints the duration.
pub fn until(what: &str, is: impl FnMut() -> bool) {
    println!("{what}: after {:?}", program::until(what, HANG, is));
}

/// Creates a mode request for a colour camera.
pub fn wish(size_px: (u32, u32), fps: f64, fourcc: Option<FourCc>) -> ModeRequest {
    ModeRequest { size_px: Some(size_px), fps: Some(fps), fourcc, ..ModeRequest::for_content(Content::Color) }
}

/// Opens a camera in a mode that it must have.
pub fn open(node: &str, wish: ModeRequest) -> V4l2Camera {
    V4l2Camera::open(node, wish, Vec::new(), None).unwrap()
}

/// Returns the next frame, and the losses before it.
pub fn frame(camera: &mut V4l2Camera) -> (ColorImage, Lost) {
    let (image, _, lost) = stamped(camera);
    (image, lost)
}

/// Returns the next frame, its capture time in nanoseconds, and the losses before it.
pub fn stamped(camera: &mut V4l2Camera) -> (ColorImage, u64, Lost) {
    let (mut color, mut lost) = (ColorImage::default(), Lost::default());
    let began = Instant::now();
    while began.elapsed() < HANG {
        match camera.next_within(MAX_WAIT, &mut color) {
            Captured::Frame(stamp) => return (color, stamp.captured_ns.expect("a camera stamps"), lost),
            Captured::Lost(count, cause) => *lost.by(&format!("{cause:?}")) += count,
            Captured::Waiting => lost.waits += 1,
            other => panic!("{other:?}"),
        }
    }
    panic!("no frame for {HANG:?}");
}

/// Returns the next frame if it arrives within `MAX_WAIT`.
pub fn frame_now(camera: &mut V4l2Camera) -> Option<ColorImage> {
    let mut color = ColorImage::default();
    match camera.next_within(MAX_WAIT, &mut color) {
        Captured::Frame(_) => Some(color),
        _ => None,
    }
}

/// Lost frames by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    /// Frames dropped by the driver for lack of a buffer.
    pub driver: u64,
    /// Frames replaced by a newer one.
    pub evicted: u64,
    /// Damaged frames.
    pub corrupt: u64,
    /// Number of timeouts without a frame.
    pub waits: u64,
}

impl Lost {
    fn by(&mut self, cause: &str) -> &mut u64 {
        match cause {
            "Driver" => &mut self.driver,
            "Evicted" => &mut self.evicted,
            "Corrupt" => &mut self.corrupt,
            other => panic!("lost by {other}"),
        }
    }

    /// Adds another count.
    pub fn add(&mut self, other: Self) {
        self.driver += other.driver;
        self.evicted += other.evicted;
        self.corrupt += other.corrupt;
        self.waits += other.waits;
    }
}

/// The camera's test pattern: eight bars of equal width at 75 % intensity, in RGB.
pub const BARS: [[u8; 3]; 8] =
    [[191, 191, 191], [191, 191, 0], [0, 191, 191], [0, 191, 0], [191, 0, 191], [191, 0, 0], [0, 0, 191], [0, 0, 0]];

/// Returns the maximum difference between a picture and the bars, in codes, except `margin_px` around their edges.
pub fn distance_from(image: &ColorImage, bars: &[[u8; 3]; 8], margin_px: u32) -> u8 {
    let width = image.size().0;
    let mut most = 0;
    for (k, pixel) in image.rgb.chunks_exact(3).enumerate() {
        let x = k as u32 % width;
        let bar = (x * 8 / width) as usize;
        let (first, end) = (bar as u32 * width / 8, (bar as u32 + 1) * width / 8);
        if x >= first + margin_px && x + margin_px < end {
            for channel in 0..3 {
                most = most.max(pixel[channel].abs_diff(bars[bar][channel]));
            }
        }
    }
    most
}

/// Sets a flag when dropped, which ends the other thread even if the test fails.
pub struct Ends<'a>(pub &'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}
