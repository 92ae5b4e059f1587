//! A folder for each test, and the program in it.

use std::fs;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::recording::tum::{Writer, WriterOptions};

/// A folder of its own for each test, and the program in it, with no settings of whoever runs the tests.
pub struct Home(pub tempfile::TempDir);

impl Home {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// By way of a shell, whose limits (`ulimit`) the program has.
    pub fn command(&self, limits: &str, args: &str) -> Command {
        let mut command = Command::new("sh");
        let program = env!("CARGO_BIN_EXE_bokehcam");
        command.args(["-c", &format!("{limits} exec '{program}' {args}")]);
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("BOKEHCAM_") {
                command.env_remove(name);
            }
        }
        command.env("XDG_CONFIG_HOME", self.at("config")).env_remove("RUST_LOG").current_dir(self.0.path());
        command.stdin(Stdio::null());
        command
    }

    pub fn run(&self, args: &str) -> Ran {
        self.command("", args).output().unwrap().into()
    }

    /// As on a disk where no file has room for more than so much.
    pub fn run_on_full_disk(&self, most_kb: u32, args: &str) -> Ran {
        // A signal would end it; ignored, writing fails as on a full disk.
        self.command(&format!("trap '' XFSZ; ulimit -f {};", most_kb * 2), args).output().unwrap().into()
    }

    /// A recording of `frames` noisy pictures, `period_s` apart.
    pub fn record(&self, name: &str, frames: u64, period_s: f64) {
        let mut writer = Writer::create(&self.at(name), &WriterOptions::default()).unwrap();
        for frame in 0..frames {
            let mut color = ColorImage::new(64, 48);
            let mut state = frame as u32 + 1;
            color.rgb.iter_mut().for_each(|byte| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *byte = (state >> 24) as u8;
            });
            let depth = DepthMap { width: 64, height: 48, metres: vec![2.0; 64 * 48], ..DepthMap::default() };
            writer.add((frame as f64 * period_s * 1e9) as u64, &color, Some(&depth)).unwrap();
        }
        writer.finish().unwrap();
    }

    pub fn damage(&self, picture: &str) {
        let bytes = fs::read(self.at(picture)).unwrap();
        fs::write(self.at(picture), &bytes[..bytes.len() / 2]).unwrap();
    }

    /// Puts a program of our own in place of ffmpeg.
    pub fn fake_ffmpeg(&self, script: &str) -> String {
        fs::create_dir_all(self.at("bin")).unwrap();
        let program = self.at("bin/ffmpeg");
        // The file is its last argument, with a prefix.
        let text = format!("#!/bin/sh\nfor last; do :; done\nout=${{last#file:}}\n{script}\n");
        fs::write(&program, text).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        format!("PATH='{}':$PATH;", self.at("bin").display())
    }
}

#[derive(Debug)]
pub struct Ran {
    pub code: Option<i32>,
    pub said: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        Self { code: output.status.code(), said: String::from_utf8(output.stderr).unwrap() }
    }
}

impl Ran {
    /// It failed with one line that says so.
    #[track_caller]
    pub fn failed(&self, code: i32, what: &str) {
        assert!(self.code == Some(code) && self.said.contains(what), "{self:?}");
        assert_eq!(self.said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{}", self.said);
    }
}

/// All files and links under a folder, with what is in them.
pub fn tree(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.is_dir() && !entry.is_symlink() {
            true => all.extend(tree(&entry)),
            false => all.push((entry.clone(), fs::read(&entry).unwrap_or_default())),
        }
    }
    all.sort();
    all
}

pub fn frames(y4m: &Path) -> usize {
    fs::read(y4m).unwrap().windows(6).filter(|bytes| bytes == b"FRAME\n").count()
}

pub fn pngs(folder: &Path) -> usize {
    let is_png = |path: PathBuf| path.extension().is_some_and(|extension| extension == "png");
    fs::read_dir(folder).unwrap().filter(|entry| is_png(entry.as_ref().unwrap().path())).count()
}

pub const LONG: Duration = Duration::from_secs(120);

#[track_caller]
pub fn until(what: &str, mut is: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(began.elapsed() < LONG, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Ends a program by a signal; it must end by itself then.
pub fn terminate(mut child: Child) -> Ran {
    assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    until("the end", || child.try_wait().unwrap().is_some());
    let code = child.wait().unwrap().code();
    let mut said = String::new();
    child.stderr.take().map(|mut stderr| stderr.read_to_string(&mut said).unwrap());
    Ran { code, said }
}
