//! Helpers that run the program by a shell.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use bokehcam_media::recording::RecordingWriter;
use rustix::process::Signal;

use crate::common::{Numbers, color, depth};
use crate::program;
pub use crate::program::{Beside, Home, Ran, json};

/// Arguments that disable the blur, so that the output equals the input.
pub const BLUR: &str = "--effect none";

impl Home {
    /// Runs the program with shell arguments.
    pub fn sh(&self, args: &str) -> Ran {
        Ran::of(&mut self.shell("", args))
    }

    /// Starts the program in the background, from a shell that has run `before`.
    pub fn start(&self, before: &str, args: &str) -> Beside {
        Beside::start(self.shell(before, args).stderr(Stdio::piped()))
    }

    /// Runs the program with a file size limit of `most_kb`, which acts like a full disk.
    pub fn sh_on_full_disk(&self, most_kb: u32, args: &str) -> Ran {
        // SIGXFSZ would end the program; ignored, writing fails as on a full disk.
        Ran::of(&mut self.shell(&format!("trap '' XFSZ; ulimit -f {};", most_kb * 2), args))
    }

    /// Creates a recording of `frames` noisy pictures at intervals of `period_s`.
    pub fn record(&self, name: &str, frames: u64, period_s: f64) {
        let mut writer = RecordingWriter::create(&self.path(name), false).unwrap();
        for frame in 0..frames {
            let mut numbers = Numbers(frame + 1);
            let color = color(64, 48, |_, _| std::array::from_fn(|_| (numbers.next() * 256.0) as u8));
            let depth = depth(64, 48, |_, _| 2.0);
            writer.add((frame as f64 * period_s * 1e9) as u64, &color, Some(&depth)).unwrap();
        }
        writer.finish().unwrap();
    }

    pub fn damage(&self, picture: &str) {
        let bytes = fs::read(self.path(picture)).unwrap();
        fs::write(self.path(picture), &bytes[..bytes.len() / 2]).unwrap();
    }

    /// Adds a fake ffmpeg; returns the shell code that selects it.
    pub fn fake_ffmpeg(&self, script: &str) -> String {
        // The output file is the last argument, with the prefix `file:`.
        let path = self.add_program("ffmpeg", &format!("for last; do :; done\nout=${{last#file:}}\n{script}"));
        format!("PATH='{path}';")
    }
}

/// Returns all files and links under a folder, with their content.
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
pub fn until(what: &str, is: impl FnMut() -> bool) {
    program::until(what, LONG, is);
}

/// Sends SIGTERM; the program must then end by itself.
#[track_caller]
pub fn terminate(program: Beside) -> Ran {
    program.end_by(Signal::TERM, LONG)
}

/// Returns ffprobe's output for a video with the options `how`.
pub fn probed(video: &Path, how: &str) -> String {
    let mut probe = Command::new("ffprobe");
    probe.args(["-v", "error", "-of", "csv=p=0"]).args(how.split(' ')).arg(video);
    Ran::of(&mut probe).stdout.trim().trim_end_matches(',').to_owned()
}

/// Counts the decodable frames of a video.
pub fn played(video: &Path) -> u32 {
    probed(video, "-count_frames -show_entries stream=nb_read_frames").parse().unwrap()
}
