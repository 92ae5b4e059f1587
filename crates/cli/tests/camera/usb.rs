//! The kernel's driver of USB webcams (`uvcvideo`) with an emulated one (`tests/vm/webcam`): its name and formats,
//! damaged pictures, dim light, and a camera that is unplugged and comes back.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use bokehcam_live::capture::v4l2::V4l2Camera;
use rustix::process::{Pid, Signal, kill_process};

use super::machine::{HANG, Lost, Machine, frame, open, run, sh, until, wish};

const SIZE: (u32, u32) = (320, 240);
const FORMATS: &[&str] = &["--formats", "mjpeg:320x240:640x480,yuyv:320x240", "--rates", "15"];
/// The product's name; the kernel reports `UVC Test Webcam: UVC Test Webca`.
const NAME: &str = "UVC Test Webcam";

/// A webcam that is plugged in until it is dropped.
struct Webcam {
    process: Child,
    commands: ChildStdin,
    lines: Receiver<String>,
    node: String,
    _machine: Machine,
}

impl Webcam {
    /// Plugs one in, and waits for its node.
    fn plug(options: &[&str]) -> Self {
        let machine = Machine::new();
        sh("modprobe -a vhci-hcd uvcvideo");
        let mut command = Command::new("/run/vm/bin/uvc_webcam");
        command.args(FORMATS).args(options).arg("--commands").stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let (commands, stdout) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let (told, lines) = mpsc::channel();
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| told.send(line)));
        let mut webcam = Self { process, commands, lines, node: String::new(), _machine: machine };
        webcam.node = webcam.line_with("is /dev/video");
        webcam
    }

    /// Waits for a line with this text; returns what follows "is ", which is the node.
    fn line_with(&self, text: &str) -> String {
        loop {
            let line = self.lines.recv_timeout(HANG).unwrap_or_else(|_| panic!("it never said '{text}'"));
            println!("{line}");
            if line.contains(text) {
                return line.rsplit_once("is ").map_or(line.clone(), |(_, node)| node.trim().to_owned());
            }
        }
    }

    /// Has it do something.
    fn say(&mut self, command: &str) {
        writeln!(self.commands, "{command}").unwrap();
    }

    fn open(&self, fourcc: &str) -> V4l2Camera {
        open(NAME, wish(SIZE, 15.0, Some(fourcc.parse().unwrap())))
    }
}

impl Drop for Webcam {
    fn drop(&mut self) {
        let _ = kill_process(Pid::from_child(&self.process), Signal::TERM);
        let _ = self.process.wait();
        let node = self.node.clone();
        until("its node is gone", || !Path::new(&node).exists());
    }
}

/// Reads `frames` frames of this size; returns the losses.
fn read(camera: &mut V4l2Camera, frames: usize, size: (u32, u32)) -> Lost {
    let mut lost = Lost::default();
    for _ in 0..frames {
        let (image, before) = frame(camera);
        assert_eq!(image.size(), size);
        assert!(image.rgb.iter().any(|&code| code > 30), "it shows something");
        lost.add(before);
    }
    lost
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_is_listed_by_its_name_and_plays_in_each_of_its_formats() {
    let webcam = Webcam::plug(&[]);
    let listed = run("devices").printed();
    let line = listed.lines().find(|line| line.contains(&format!("{}  ", webcam.node))).expect(&listed);
    assert!(line.contains(&format!("{NAME}  (uvcvideo")) && line.contains("USB 1209:0001, 480 Mbit/s"), "{line}");
    for fourcc in ["MJPG", "YUYV"] {
        assert_eq!(read(&mut webcam.open(fourcc), 15, SIZE).corrupt, 0, "{fourcc}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn damaged_pictures_are_counted_and_never_shown() {
    // The driver keeps back what it knows to be damaged, and raw pictures that are too short: only their numbers are missing.
    for (damage, fourcc, is_told) in
        [("--cut", "MJPG", true), ("--stray", "MJPG", true), ("--cut", "YUYV", false), ("--err", "MJPG", false)]
    {
        let webcam = Webcam::plug(&[damage, "5"]);
        let lost = read(&mut webcam.open(fourcc), 20, SIZE);
        let (count, other) = if is_told { (lost.corrupt, 0) } else { (lost.driver, lost.corrupt) };
        assert!(count >= 2 && other == 0, "{damage} {fourcc}: {lost:?}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_stalls_fails_or_is_unplugged_goes_on() {
    let mut webcam = Webcam::plug(&[]);
    let mut camera = webcam.open("MJPG");
    read(&mut camera, 5, SIZE);
    for (fails, mends) in [("stall", Some("go")), ("halt", None), ("unplug", Some("plug")), ("unplug", Some("plug"))] {
        webcam.say(fails);
        // Frames that were in flight still come.
        until("there are no frames", || super::machine::frame_now(&mut camera).is_none());
        mends.into_iter().for_each(|command| webcam.say(command));
        read(&mut camera, 5, SIZE);
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_comes_back_without_the_format_is_taken_as_it_is() {
    let mut webcam = Webcam::plug(&["--replug-formats", "mjpeg:640x480"]);
    let mut camera = webcam.open("YUYV");
    read(&mut camera, 5, SIZE);
    webcam.say("unplug");
    until("there are no frames", || super::machine::frame_now(&mut camera).is_none());
    webcam.say("plug");
    // Scaled to the size that the frames had before.
    read(&mut camera, 5, SIZE);
    webcam.line_with("stream MJPEG 640x480");
}

/// The moments are spread over a picture's transfer, the pause before the next one, and the search for the camera.
#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_is_unplugged_at_any_moment_comes_back() {
    let mut webcam = Webcam::plug(&[]);
    let mut camera = webcam.open("MJPG");
    for round in 0_u64..30 {
        let began = Instant::now();
        let played = Duration::from_millis(round * 37 % 200);
        while began.elapsed() < played {
            super::machine::frame_now(&mut camera);
        }
        webcam.say("unplug");
        std::thread::sleep(Duration::from_millis(round * 61 % 300));
        webcam.say("plug");
        webcam.line_with("is /dev/video");
        read(&mut camera, 2, SIZE);
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn as_many_frames_of_a_webcam_as_were_asked_for_are_delivered_however_many_are_damaged() {
    let webcam = Webcam::plug(&["--cut", "3"]);
    let asked = format!("stream {} --size 320x240 --format MJPG --frames 20 --to /tmp/asked.y4m --force", webcam.node);
    let said = run(&asked).done().to_owned();
    let (delivered, taken) = said.split_once("20 of ").expect(&said);
    assert!(!delivered.ends_with(|c: char| c.is_ascii_digit()), "{said}");
    let taken: u64 = taken.split(' ').next().unwrap().parse().unwrap();
    assert!(taken > 20 && said.contains(" damaged"), "{said}");
    // The file keeps its rate: where the camera was late, a picture is there twice.
    let frames = std::fs::read("/tmp/asked.y4m").unwrap().windows(6).filter(|bytes| bytes == b"FRAME\n").count();
    assert!(frames >= 20, "{frames}");
}

/// Most webcams expose longer in dim light, and keep promising the rate that was agreed on.
#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_webcam_that_gives_half_its_rate_is_named_as_the_cause() {
    let webcam = Webcam::plug(&["--drop", "2"]);
    let dim = format!("stream {} --size 320x240 --format MJPG --frames 45 --effect none --to null", webcam.node);
    let said = run(&dim).done().to_owned();
    assert!(said.contains("frames a second instead of 15"), "{said}");
}
