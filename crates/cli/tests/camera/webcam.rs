//! An emulated USB webcam (`tests/vm/webcam`), which the kernel's driver of USB webcams (`uvcvideo`) drives.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};

use bokehcam_live::capture::v4l2::V4l2Camera;
use rustix::process::{Pid, Signal, kill_process};

use super::machine::{HANG, Lost, Machine, frame, open, sh, until, wish};

/// Width and height of its smaller pictures, in pixels.
pub const SIZE: (u32, u32) = (320, 240);
const FORMATS: &[&str] = &["--formats", "mjpeg:320x240:640x480,yuyv:320x240", "--rates", "15"];
/// A webcam with alternate settings, as most are.
pub const ISOCHRONOUS: &str = "--isochronous";
/// The product's name; the kernel reports `UVC Test Webcam: UVC Test Webca`.
pub const NAME: &str = "UVC Test Webcam";

/// A webcam that is plugged in until it is dropped.
pub struct Webcam {
    process: Child,
    commands: ChildStdin,
    lines: Receiver<String>,
    pub node: String,
    pub machine: Machine,
}

impl Webcam {
    /// Plugs one in, and waits for its node. The driver keeps back the pictures that it knows to be damaged.
    pub fn plug(options: &[&str]) -> Self {
        Self::plug_with("nodrop=0", options)
    }

    /// Plugs one in with a parameter of the driver.
    pub fn plug_with(parameter: &str, options: &[&str]) -> Self {
        let machine = Machine::alone();
        let (name, value) = parameter.split_once('=').unwrap();
        sh(&format!("modprobe -a vhci-hcd uvcvideo && echo {value} > /sys/module/uvcvideo/parameters/{name}"));
        let mut command = Command::new("/run/vm/bin/uvc_webcam");
        command.args(FORMATS).args(options).arg("--commands").stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let (commands, stdout) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let (told, lines) = mpsc::channel();
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| told.send(line)));
        let mut webcam = Self { process, commands, lines, node: String::new(), machine };
        webcam.node = webcam.line_with("is /dev/video");
        webcam
    }

    /// Waits for a line with this text; returns what follows "is ", which is the node.
    pub fn line_with(&self, text: &str) -> String {
        loop {
            let line = self.lines.recv_timeout(HANG).unwrap_or_else(|_| panic!("it never said '{text}'"));
            println!("{line}");
            if line.contains(text) {
                return line.rsplit_once("is ").map_or(line.clone(), |(_, node)| node.trim().to_owned());
            }
        }
    }

    /// Has it do something.
    pub fn say(&mut self, command: &str) {
        writeln!(self.commands, "{command}").unwrap();
    }

    /// Lines that were not waited for.
    pub fn lines_with(&self, text: &str) -> usize {
        self.lines.try_iter().inspect(|line| println!("{line}")).filter(|line| line.contains(text)).count()
    }

    /// The folder of its USB device in sysfs.
    pub fn usb(&self) -> PathBuf {
        let video = Path::new("/sys/class/video4linux").join(self.node.trim_start_matches("/dev/"));
        video.join("device/..").canonicalize().unwrap()
    }

    /// Opens it in a format, in its smaller size.
    pub fn open(&self, fourcc: &str) -> V4l2Camera {
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
pub fn read(camera: &mut V4l2Camera, frames: usize, size: (u32, u32)) -> Lost {
    let mut lost = Lost::default();
    for _ in 0..frames {
        let (image, before) = frame(camera);
        assert_eq!(image.size(), size);
        assert!(image.rgb.iter().any(|&code| code > 30), "it shows something");
        lost.add(before);
    }
    lost
}
