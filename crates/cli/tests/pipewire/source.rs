//! PipeWire sources, with GStreamer as the camera.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bokehcam_live::source::devices::{CameraWatch, list_pipewire_cameras};
use serde_json::Value;

use super::program::{Beside, Ran, bokehcam};
use super::session::{Player, Run, folder, kill, node, until};

/// A camera provided by GStreamer.
struct Camera {
    program: Beside,
    caps: String,
    color: u32,
}

impl Camera {
    /// Starts the camera `cam` with pictures of one colour.
    fn start(caps: &str, color: u32) -> Self {
        let camera = Self { program: Self::program(caps, color), caps: caps.to_owned(), color };
        until("the camera", || node("cam"));
        camera
    }

    fn program(caps: &str, color: u32) -> Beside {
        let mut command = Command::new("gst-launch-1.0");
        command
            .args(["-q", "videotestsrc", "is-live=true", "pattern=solid-color"])
            .arg(format!("foreground-color={color}"))
            .args(["!", caps, "!", "pipewiresink", "mode=provide"])
            .arg(
                "stream-properties=p,media.class=Video/Source,media.role=Camera,node.name=cam,node.description=Front-camera",
            )
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        Beside::start(&mut command)
    }

    /// Waits until `is` returns a value. GStreamer's camera may stall for good on a busy machine, so it is restarted
    /// after a while without a result, like a camera that is plugged in again.
    fn until<T>(&mut self, what: &str, mut is: impl FnMut() -> Option<T>) -> T {
        let mut began = Instant::now();
        until(what, || {
            if began.elapsed() > Duration::from_secs(20) {
                self.program.0.kill().unwrap();
                self.program.0.wait().unwrap();
                self.program = Self::program(&self.caps, self.color);
                began = Instant::now();
            }
            is()
        })
    }

    /// Runs the program until it has read what it is asked for, as often as it gives up on a camera that stalls from
    /// the start; returns the report, and the time that it took.
    fn read(&mut self, arguments: &[&str]) -> (Value, Duration) {
        let (mut began, mut run) = (Instant::now(), Run::start(arguments));
        let took = self.until("the pictures", || {
            if run.has_given_up() {
                (began, run) = (Instant::now(), Run::start(arguments));
            }
            run.is_over().then(|| began.elapsed())
        });
        (run.ended(), took)
    }
}

const RAW: &str = "video/x-raw,format=YUY2,width=320,height=180,framerate=30/1";
const ORANGE: u32 = 0xffff_8020;
const BLUE: u32 = 0xff20_40ff;

fn count(report: &Value, key: &str) -> u64 {
    report["frames"][key].as_u64().unwrap()
}

/// Reads the colour in the middle of a written picture.
fn middle(path: &std::path::Path) -> [u8; 3] {
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let at = 3 * (info.width as usize * (info.height as usize / 2) + info.width as usize / 2);
    [bytes[at], bytes[at + 1], bytes[at + 2]]
}

fn is_near(got: [u8; 3], rgb: u32) -> bool {
    let wanted = [rgb >> 16, rgb >> 8, rgb].map(|code| code as u8);
    got.iter().zip(wanted).all(|(got, wanted)| got.abs_diff(wanted) <= 4)
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_camera_that_comes_or_goes_is_noticed_and_the_list_is_right_then() {
    folder();
    let mut watch = CameraWatch::new();
    let mut until_listed = |what: &str, is_listed: bool| {
        until(what, || {
            let listed = || list_pipewire_cameras().iter().any(|camera| camera.name == "pipewire:desk-left");
            (watch.has_changed() && listed() == is_listed).then_some(())
        });
        // A change is reported at two checks.
        std::thread::sleep(Duration::from_secs(1));
        watch.has_changed();
        watch.has_changed();
        assert!(!watch.has_changed(), "{what}: nothing else changed");
    };
    let player = Player::start("desk-left", &["--to", "pipewire:Desk, left"]);
    until_listed("it came", true);
    player.end();
    until_listed("it went", false);
    let player = Player::start("desk-left", &["--to", "pipewire:Desk, left"]);
    until_listed("it came again", true);
    kill("pipewire");
    until_listed("it is there after the daemon's return", true);
    player.end();
    until_listed("it went for good", false);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn every_format_is_read_in_its_colours() {
    let pictures = folder().join("pictures");
    for (format, name) in [
        ("video/x-raw,format=YUY2", "YUYV"),
        ("video/x-raw,format=NV12", "NV12"),
        ("video/x-raw,format=I420", "YU12"),
        ("video/x-raw,format=RGB", "RGB3"),
        ("video/x-raw,format=BGR", "BGR3"),
    ] {
        let mut camera =
            Camera::start(&format!("{format},width=320,height=180,framerate=30/1,colorimetry=bt601"), ORANGE);
        let to = format!("{}/{name}/", pictures.display());
        let (report, _) = camera.read(&["stream", "pipewire:cam", "--effect", "none", "--frames", "10", "--to", &to]);
        assert!(report["source"].as_str().unwrap().contains(name), "{}", report["source"]);
        let told = middle(&pictures.join(name).join("000003.png"));
        assert!(is_near(told, ORANGE), "{name}: {told:?}");
        drop(camera);
        until("the camera to go", || node("cam").is_none().then_some(()));
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_camera_is_listed_and_read_at_its_rate() {
    folder();
    let mut camera = Camera::start(RAW, BLUE);
    let listed = Ran::of(&mut bokehcam(&["devices", "--json"])).json();
    let told = &listed["pipewire"][0];
    assert_eq!((&told["name"], &told["label"]), (&"pipewire:cam".into(), &"Front-camera".into()));
    assert_eq!(told["formats"][0]["fourcc"], "YUYV");
    // By node name, by description, and by a part of the description.
    for name in ["pipewire:cam", "pipewire:Front-camera", "pipewire:FRONT"] {
        let (report, took) = camera.read(&["stream", name, "--effect", "none", "--frames", "60", "--to", "null"]);
        let seconds = took.as_secs_f64();
        assert!(report["source"].as_str().unwrap().starts_with("pipewire:cam (Front-camera), 320x180 YUYV at 30 fps"));
        // At least sixty frames are read, and at most the camera's output; the number delivered depends on the machine.
        let captured = count(&report, "captured");
        assert!(captured >= 60 && captured as f64 <= 31.0 * seconds + 10.0, "{} in {seconds} s", report["frames"]);
        assert!(count(&report, "delivered") > 0, "{}", report["frames"]);
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_camera_that_goes_is_taken_up_again_also_with_another_size() {
    let pictures = folder().join("again");
    let mut camera = Camera::start(RAW, ORANGE);
    let to = format!("{}/", pictures.display());
    let run = Run::start(&["stream", "pipewire:cam", "--effect", "none", "--to", &to]);
    let written = || std::fs::read_dir(&pictures).map_or(0, |folder| folder.count());
    camera.until("pictures", || (written() > 20).then_some(()));
    drop(camera);
    until("the camera to go", || node("cam").is_none().then_some(()));
    std::thread::sleep(Duration::from_secs(2));
    let before = written();
    let mut camera = Camera::start("video/x-raw,format=YUY2,width=640,height=360,framerate=30/1", BLUE);
    camera.until("pictures again", || (written() > before + 20).then_some(()));
    let report = run.end();
    assert!(count(&report, "captured") > 40);
    let last = pictures.join(format!("{:06}.png", before + 15));
    assert!(is_near(middle(&last), BLUE), "{:?}", middle(&last));
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_camera_that_is_not_there_and_our_own_cost_one_line() {
    folder();
    let run = Run::start(&["stream", "pipewire:nobody", "--to", "null"]);
    let said = run.refused();
    assert!(said.contains("there is no camera 'nobody' in PipeWire"), "{said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");
    for (arguments, told) in [(["pipewire:", "null"], "needs the name"), (["pipewire:cam", "cam/"], "no camera 'cam'")]
    {
        let said = Run::start(&["stream", arguments[0], "--to", arguments[1]]).refused();
        assert!(said.contains(told), "{said}");
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn pictures_go_from_camera_to_camera_on_demand() {
    folder();
    let mut camera = Camera::start(RAW, BLUE);
    let arguments = ["stream", "pipewire:cam", "--effect", "none", "--on-demand", "--to", "pipewire:Blurred"];
    let began = Instant::now();
    let run = Run::start(&arguments);
    until("our camera", || node("blurred"));
    // Without viewers, the camera is released.
    let links = || super::session::graph().iter().filter(|object| object["type"] == "PipeWire:Interface:Link").count();
    until("the camera to be let go of", || (links() == 0).then_some(()));
    let start_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let reader = super::readers::GStreamer::start("blurred", 100_000);
    // Blue in limited-range BT.601. The still card precedes the first picture.
    let is_blue = |frame: &Vec<u8>| {
        let [y, u, v] = [0, 1, 3].map(|at| frame[frame.len() / 2 + at]);
        y.abs_diff(81) < 4 && u.abs_diff(216) < 4 && v.abs_diff(101) < 4
    };
    camera.until("a blue picture", || reader.frames().last().is_some_and(is_blue).then_some(()));
    drop(reader);
    until("the camera to be let go of again", || (links() == 0).then_some(()));
    let watched_s = began.elapsed().as_secs_f64();
    std::thread::sleep(Duration::from_secs(3));
    let report = run.end();
    // Frames are captured only at the start and while there is a viewer.
    assert!(count(&report, "captured") as f64 <= 31.0 * (watched_s + start_s) + 10.0, "{}", report["frames"]);
}
