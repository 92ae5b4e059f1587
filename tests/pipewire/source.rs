//! This program as a reader: GStreamer stands for the camera.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::session::{Run, folder, in_a_calm_moment, node, until};

/// A camera that another program gives.
struct Camera(Child);

impl Camera {
    /// Gives pictures of one colour as the camera `cam`.
    fn start(caps: &str, color: u32) -> Self {
        let camera = Self(
            Command::new("gst-launch-1.0")
                .args(["-q", "videotestsrc", "is-live=true", "pattern=solid-color"])
                .arg(format!("foreground-color={color}"))
                .args(["!", caps, "!", "pipewiresink", "mode=provide"])
                .arg(
                    "stream-properties=p,media.class=Video/Source,media.role=Camera,node.name=cam,node.description=Front-camera",
                )
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap(),
        );
        until("the camera", || node("cam"));
        camera
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const RAW: &str = "video/x-raw,format=YUY2,width=320,height=180,framerate=30/1";
const ORANGE: u32 = 0xffff_8020;
const BLUE: u32 = 0xff20_40ff;

fn count(report: &Value, key: &str) -> u64 {
    report["frames"][key].as_u64().unwrap()
}

/// The colour in the middle of a picture that was written.
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
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn every_format_is_read_in_its_colours() {
    let pictures = folder().join("pictures");
    for (format, name) in [
        ("video/x-raw,format=YUY2", "YUYV"),
        ("video/x-raw,format=NV12", "NV12"),
        ("video/x-raw,format=I420", "YU12"),
        ("video/x-raw,format=RGB", "RGB3"),
        ("video/x-raw,format=BGR", "BGR3"),
    ] {
        let camera = Camera::start(&format!("{format},width=320,height=180,framerate=30/1,colorimetry=bt601"), ORANGE);
        let to = format!("{}/{name}/", pictures.display());
        let run = Run::start(&["stream", "pipewire:cam", "--effect", "none", "--frames", "10", "--to", &to]);
        let report = run.ended();
        assert!(report["source"].as_str().unwrap().contains(name), "{}", report["source"]);
        let told = middle(&pictures.join(name).join("000003.png"));
        assert!(is_near(told, ORANGE), "{name}: {told:?}");
        drop(camera);
        until("the camera to go", || node("cam").is_none().then_some(()));
    }
}

#[test]
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn a_camera_is_listed_and_read_at_its_rate() {
    folder();
    let _camera = Camera::start(RAW, BLUE);
    let listed = Command::new(env!("CARGO_BIN_EXE_bokehcam")).args(["devices", "--json"]).output().unwrap();
    let listed: Value = serde_json::from_slice(&listed.stdout).unwrap();
    let camera = &listed["pipewire"][0];
    assert_eq!((&camera["name"], &camera["label"]), (&"pipewire:cam".into(), &"Front-camera".into()));
    assert_eq!(camera["formats"][0]["fourcc"], "YUYV");
    // By its own name, by what people see, and by a part of that.
    for name in ["pipewire:cam", "pipewire:Front-camera", "pipewire:FRONT"] {
        in_a_calm_moment(|| {
            let report = Run::start(&["stream", name, "--effect", "none", "--frames", "60", "--to", "null"]).ended();
            assert!(
                report["source"].as_str().unwrap().starts_with("pipewire:cam (Front-camera), 320x180 YUYV at 30 fps")
            );
            let seconds = report["elapsed_s"].as_f64().unwrap();
            let is_full = count(&report, "delivered") == 60 && (1.9..3.5).contains(&seconds);
            if is_full { Ok(()) } else { Err(format!("{} in {seconds} s", report["frames"])) }
        });
    }
}

#[test]
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn a_camera_that_goes_is_taken_up_again_also_with_another_size() {
    let pictures = folder().join("again");
    let camera = Camera::start(RAW, ORANGE);
    let to = format!("{}/", pictures.display());
    let run = Run::start(&["stream", "pipewire:cam", "--effect", "none", "--to", &to]);
    let written = || std::fs::read_dir(&pictures).map_or(0, |folder| folder.count());
    until("pictures", || (written() > 20).then_some(()));
    drop(camera);
    until("the camera to go", || node("cam").is_none().then_some(()));
    std::thread::sleep(Duration::from_secs(2));
    let before = written();
    let _camera = Camera::start("video/x-raw,format=YUY2,width=640,height=360,framerate=30/1", BLUE);
    until("pictures again", || (written() > before + 20).then_some(()));
    let report = run.end();
    assert!(count(&report, "captured") > 40);
    let last = pictures.join(format!("{:06}.png", before + 15));
    assert!(is_near(middle(&last), BLUE), "{:?}", middle(&last));
}

#[test]
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn a_camera_that_is_not_there_and_our_own_cost_one_line() {
    folder();
    let run = Run::start(&["stream", "pipewire:nobody", "--to", "null"]);
    let said = run.refused();
    assert!(said.contains("there is no camera 'nobody' in PipeWire"), "{said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");
    for (arguments, told) in [(["pipewire:", "null"], "needs the name"), (["pipewire:cam", "cam"], "no camera 'cam'")] {
        let said = Run::start(&["stream", arguments[0], "--to", arguments[1]]).refused();
        assert!(said.contains(told), "{said}");
    }
}

#[test]
#[ignore = "needs PipeWire (tests/pipewire/session)"]
fn pictures_go_from_camera_to_camera_on_demand() {
    folder();
    let _camera = Camera::start(RAW, BLUE);
    let arguments = ["stream", "pipewire:cam", "--effect", "none", "--on-demand", "--to", "pipewire:Blurred"];
    let run = Run::start(&arguments);
    until("our camera", || node("blurred"));
    // Nobody watches us: the camera is let go of.
    let links = || super::session::graph().iter().filter(|object| object["type"] == "PipeWire:Interface:Link").count();
    until("the camera to be let go of", || (links() == 0).then_some(()));
    let got = super::readers::GStreamer::start("blurred", 45).end();
    let [y, u, v] = [0, 1, 3].map(|at| got.frames[40][got.frames[40].len() / 2 + at]);
    // BT.601, limited range.
    assert!(y.abs_diff(81) < 4 && u.abs_diff(216) < 4 && v.abs_diff(101) < 4, "{y} {u} {v}");
    until("the camera to be let go of again", || (links() == 0).then_some(()));
    let report = run.end();
    assert!(count(&report, "captured") < 120, "{}", report["frames"]);
}
