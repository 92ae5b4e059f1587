//! The commands of README.md and docs/, those in blocks and those within sentences, one after the other as somebody
//! follows them, each page in a fresh folder.
#![allow(missing_docs)]

#[allow(dead_code)] // Of the networks that it makes, one is wanted here.
#[path = "common/onnx.rs"]
mod onnx;

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// What is another program's, or builds: a part of the command, and why it is left out.
const LEFT_OUT: [(&str, &str); 16] = [
    ("sudo ", "needs root"),
    ("systemctl ", "needs a session, and starts something in it"),
    ("journalctl ", "needs a session"),
    ("gst-", "needs GStreamer: gst/test follows it"),
    ("GST_PLUGIN_PATH", "needs GStreamer"),
    ("cargo ", "builds"),
    ("pip install", "needs a network"),
    ("scripts/", "builds everything, or needs pictures of a chessboard"),
    ("python/", "builds everything, and needs a network"),
    ("bokehcam.farm", "needs Ray"),
    ("parallel --joblog", "needs GNU parallel"),
    ("sbatch ", "needs Slurm"),
    ("UNIX-CONNECT", "needs socat"),
    ("gsettings", "needs GNOME"),
    ("org.gnome", "needs GNOME"),
    ("git clone", "needs a network"),
];

/// What of this program a test cannot run: a part of the command, and why. Its arguments are checked all the same.
const ONLY_CHECKED: [(&str, &str); 8] = [
    ("bokehcam models add", "needs a file from elsewhere"),
    ("bokehcam plate", "needs a camera"),
    ("bokehcam preview", "needs a screen"),
    ("/dev/video", "needs a camera"),
    ("pipewire", "needs PipeWire's daemons"),
    ("bokehcam devices", "says what this machine has"),
    ("bokehcam doctor", "judges this machine"),
    ("bokehcam bench", "measures this machine, for minutes"),
];

/// What a sentence leaves open, and what stands there when it is tried.
const OPEN: [(&str, &str); 14] = [
    ("bokehcam COMMAND", "bokehcam render"),
    ("bokehcam stream ...", "bokehcam stream demo --frames 1 --to null"),
    ("bokehcam render ...", "bokehcam render photo.jpg --depth-map depth.png --out any.png"),
    ("IMAGE", "photo.jpg"),
    ("DEPTH", "depth.png"),
    ("METRES", "1.2"),
    ("WxH", "64x36"),
    ("--coc PX", "--coc 4"),
    ("--threads N", "--threads 1"),
    ("[SOURCE]", "demo"),
    ("--like FILE.png", "--like NAME.png"),
    ("--out FILE.png", "--out sentence.png"),
    ("--out DIR", "--out dir/"),
    ("--debug-dir DIR", "--debug-dir steps/"),
];

/// A file of settings that is not there: who names it has all other arguments read, and is then refused.
const NO_SETTINGS: &str = "no-settings.toml";

/// The commands of a page, without their comments, in its order; one that goes on in the next line is whole.
fn commands(page: &str) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let (mut block, mut goes_on, mut sentences) = (None, false, String::new());
    for line in page.lines().map(str::trim_end).chain(["```"]) {
        match (block, line.strip_prefix("```")) {
            (None, Some(language)) => {
                commands.extend(within_sentences(&sentences));
                sentences.clear();
                block = Some(language);
            }
            (None, None) => sentences.extend([line, " "]),
            (Some(_), Some(_)) => block = None,
            (Some("sh"), None) => {
                let code = line.split_once(" # ").map_or(line, |(code, _)| code).trim_end();
                match commands.last_mut().filter(|_| goes_on) {
                    Some(last) => *last += code,
                    None => commands.push(code.to_owned()),
                }
                goes_on = code.ends_with(['\\', '|']);
                if let Some(last) = commands.last_mut().filter(|_| goes_on) {
                    *last = format!("{} ", last.trim_end_matches('\\').trim_end());
                }
            }
            // What the session's unit runs.
            (Some(_), None) => {
                let stream = line.strip_prefix("STREAM=\"").and_then(|line| line.strip_suffix('"'));
                commands.extend(stream.map(|stream| format!("bokehcam stream {stream}")));
            }
        }
    }
    commands
}

/// The commands that sentences name. One without any argument is only meant: that there is help of it is all there is to try.
fn within_sentences(text: &str) -> Vec<String> {
    let code = text.split('`').skip(1).step_by(2).filter(|code| code.starts_with("bokehcam "));
    let tried = code.map(|code| {
        let whole = OPEN.iter().fold(code.to_owned(), |code, (open, with)| code.replace(open, with));
        let is_meant = ["stream", "preview", "record", "render", "depth", "plate", "bench", "ctl"];
        match is_meant.contains(&&whole["bokehcam ".len()..]) {
            true => whole + " --help",
            false => whole,
        }
    });
    tried.collect()
}

/// A page that is being followed: a folder as its owner has it, with the repository's recordings, and pictures by the
/// names that the pages use.
struct Follower {
    folder: tempfile::TempDir,
    /// What `bokehcam ctl` speaks to.
    running: Option<Child>,
}

impl Drop for Follower {
    fn drop(&mut self) {
        if let Some(mut running) = self.running.take() {
            let _ = running.kill();
            let _ = running.wait();
        }
    }
}

impl Follower {
    fn new() -> Self {
        let follower = Self { folder: tempfile::tempdir().unwrap(), running: None };
        let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
        symlink(repository.join("recordings"), follower.path("recordings")).unwrap();
        let copy = |from: &str, to: &str| {
            fs::copy(repository.join("recordings").join(from), follower.path(to)).unwrap();
        };
        for left in ["left.png", "im0.png"] {
            copy("stereo/image_2/000000.png", left);
        }
        for right in ["right.png", "im1.png"] {
            copy("stereo/image_3/000000.png", right);
        }
        let calibration = "cam0=[640 0 319.5; 0 640 179.5; 0 0 1]\ncam1=[640 0 319.5; 0 640 179.5; 0 0 1]\ndoffs=0\n\
                           baseline=60\nwidth=640\nheight=360\nndisp=96\n";
        fs::write(follower.path("calib.txt"), calibration).unwrap();
        for color in ["photo.jpg", "NAME-color.png"] {
            copy("portrait/rgb/000000.png", color);
        }
        copy("portrait/depth/000000.png", "depth.png");
        let mut snapshot = png::Encoder::new(fs::File::create(follower.path("NAME.png")).unwrap(), 1, 1);
        snapshot.add_itxt_chunk("bokehcam".to_string(), "--effect=blur\n--rim=0.5\n".to_string()).unwrap();
        snapshot.write_header().unwrap().write_image_data(&[0]).unwrap();
        // What is light is the person, or near.
        fs::write(follower.path("small.onnx"), onnx::matte(64, 36, [4.0, 4.0, 4.0], -6.0)).unwrap();

        for folder in ["programs", "home", "session"] {
            fs::create_dir(follower.path(folder)).unwrap();
        }
        fs::set_permissions(follower.path("session"), PermissionsExt::from_mode(0o700)).unwrap();
        symlink(env!("CARGO_BIN_EXE_bokehcam"), follower.path("programs/bokehcam")).unwrap();
        fs::write(follower.path("programs/ffplay"), "#!/bin/sh\nexec cat >/dev/null\n").unwrap();
        fs::set_permissions(follower.path("programs/ffplay"), PermissionsExt::from_mode(0o755)).unwrap();
        follower
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn shell(&self, command: &str) -> Command {
        let mut shell = Command::new("bash");
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            if ["BOKEHCAM_", "XDG_", "RUST_LOG"].iter().any(|begin| text.starts_with(begin)) {
                shell.env_remove(name);
            }
        }
        shell.args(["-o", "pipefail", "-c", command]).current_dir(&self.folder).stdin(Stdio::null());
        let path = format!("{}:{}", self.path("programs").display(), std::env::var("PATH").unwrap());
        shell.env("PATH", path).env("HOME", self.path("home")).env("XDG_RUNTIME_DIR", self.path("session"));
        shell
    }

    fn output(&self, command: &str) -> Output {
        self.shell(command).output().unwrap()
    }

    /// Has something run that `bokehcam ctl` can speak to.
    fn start_a_stream(&mut self) {
        if self.running.is_some() {
            return;
        }
        let stream = "exec bokehcam --quiet stream demo --pace realtime --to null --name desk";
        self.running = Some(self.shell(stream).spawn().unwrap());
        let began = Instant::now();
        while !self.output("bokehcam ctl status").status.success() {
            assert!(began.elapsed() < Duration::from_secs(60), "the stream does not answer");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Whether the program takes the arguments of a command that cannot be run; a camera's name is that of no camera here.
    fn check(&self, command: &str) -> Result<(), String> {
        let mut words: Vec<&str> = command.split(' ').collect();
        if let [_, "stream" | "preview" | "plate" | "record", source, ..] = &mut words[..] {
            let is_camera = source.starts_with(|first: char| first.is_ascii_digit()) || source.starts_with("pipewire:");
            if is_camera || *source == "C920" {
                *source = "demo";
            }
        }
        let ran = self.output(&format!("{} --config {NO_SETTINGS}", words.join(" ")));
        let said = String::from_utf8_lossy(&ran.stderr);
        match ran.status.code() == Some(1) && said.contains(NO_SETTINGS) {
            true => Ok(()),
            false => Err(said.into_owned()),
        }
    }

    /// Runs a command, or checks its arguments; gives whether it ran.
    fn follow(&mut self, command: &str) -> Result<bool, String> {
        // Those that are known are found by their content, which is not here.
        let command = ["matte", "mono"].iter().fold(command.to_owned(), |command, task| {
            let of_our_own = format!("{task}:small.onnx");
            command.split(' ').map(|word| named(word, task, &of_our_own)).collect::<Vec<_>>().join(" ")
        });
        let has_ffmpeg = || self.output("ffmpeg -version").status.success();
        let only_checked = match command.contains(".mp4") && !has_ffmpeg() {
            true => Some("needs ffmpeg"),
            false => ONLY_CHECKED.iter().find(|(part, _)| command.contains(part)).map(|(_, why)| *why),
        };
        if let Some(why) = only_checked.filter(|_| !command.ends_with(" --help")) {
            println!("only checked, {why}: {command}");
            return self.check(&command).map(|()| false);
        }
        if command.contains("bokehcam ctl") {
            self.start_a_stream();
        }
        let ran = self.output(&command);
        match ran.status.success() {
            true => println!("ran: {command}"),
            false => return Err(format!("{}: {}", ran.status, String::from_utf8_lossy(&ran.stderr))),
        }
        Ok(true)
    }
}

/// A word of a list such as `plate,matte`, with a file for the network of a task.
fn named(word: &str, task: &str, file: &str) -> String {
    let parts: Vec<&str> = word.split(',').map(|part| if part == task { file } else { part }).collect();
    parts.join(",")
}

/// Follows a page; at least `least` of its commands run, so that none is left out by mistake.
fn follow(page: &str, least: usize) {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(repository.join(page)).unwrap();
    let mut follower = Follower::new();
    let mut done: Vec<String> = Vec::new();
    let (mut ran, mut faults) = (0, Vec::new());
    for command in commands(&text) {
        // What is named again is not done again.
        if done.contains(&command) {
            continue;
        }
        let left_out = LEFT_OUT.iter().find(|(part, _)| command.contains(part));
        match left_out {
            Some((_, why)) => {
                println!("left out, {why}: {command}");
                let program = command.split(' ').next().unwrap_or_default();
                if program.contains('/') && !program.contains('=') && !repository.join(program).is_file() {
                    faults.push(format!("`{command}`: there is no {program}"));
                }
            }
            None => match follower.follow(&command) {
                Ok(true) => ran += 1,
                Ok(false) => {}
                Err(said) => faults.push(format!("`{command}`: {said}")),
            },
        }
        done.push(command);
    }
    assert!(faults.is_empty(), "{page}:\n{}", faults.join("\n"));
    assert!(ran >= least, "{page}: {ran} commands ran, where {least} can");
}

#[test]
fn commands_are_found_in_pages() {
    let page = "text `bokehcam\nx y` and `x`\n```sh\na b   # why\nc \\\n  d |\n    e\n```\n```toml\nx = 1\n```\n`y`, \
                `bokehcam stream`\n```ini\nSTREAM=\"0 --to z\"\n```\n";
    let found = commands(page);
    assert_eq!(found, ["bokehcam x y", "a b", "c   d |     e", "bokehcam stream --help", "bokehcam stream 0 --to z"]);
}

#[test]
fn arguments_are_checked_without_what_they_need() {
    let follower = Follower::new();
    assert_eq!(follower.check("bokehcam stream 0,2 --calib any.yml --to /dev/video10"), Ok(()));
    for (wrong, said) in [
        ("bokehcam stream 0 --on-demand", "--to"),
        ("bokehcam preview --nosuch", "--nosuch"),
        ("bokehcam bench --quality nosuch", "nosuch"),
    ] {
        assert!(follower.check(wrong).unwrap_err().contains(said), "{wrong}");
    }
}

#[test]
fn the_readme_can_be_followed_line_by_line() {
    follow("README.md", 12);
}

#[test]
fn the_pages_can_be_followed_line_by_line() {
    let least = [("algorithm.md", 1), ("settings.md", 5), ("stereo.md", 2), ("ctl.md", 6)];
    for page in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")).unwrap() {
        let name = page.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".md") {
            let least = least.iter().find(|(page, _)| *page == name).map_or(0, |(_, least)| *least);
            follow(&format!("docs/{name}"), least);
        }
    }
}
