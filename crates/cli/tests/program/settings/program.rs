//! The program in a world of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::recording::still;

pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Self {
            code: output.status.code().expect("ended by itself"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
}

impl Ran {
    /// It was refused with this exit code, in one line that has all of `said`.
    #[track_caller]
    pub fn refused(&self, code: i32, said: &[&str]) {
        assert_eq!((self.code, self.stdout.as_str(), self.stderr.lines().count()), (code, "", 1), "{}", self.stderr);
        assert!(self.stderr.starts_with("error: "), "{}", self.stderr);
        said.iter().for_each(|said| assert!(self.stderr.contains(said), "{said:?} is not in {}", self.stderr));
    }

    /// It did what it was asked for.
    #[track_caller]
    pub fn done(&self) -> &str {
        assert_eq!(self.code, 0, "{}", self.stderr);
        &self.stderr
    }

    /// The one warning, if there is any.
    #[track_caller]
    pub fn warning(&self) -> &str {
        let mut warnings = self.done().lines().filter(|line| line.starts_with("warning: "));
        let first = warnings.next().unwrap_or_default();
        assert_eq!(warnings.next(), None, "{}", self.stderr);
        first
    }
}

/// A folder that is the home, and where the program runs.
pub struct Home(pub tempfile::TempDir);

impl Home {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The settings file, where nothing else is chosen.
    pub fn settings(&self) -> PathBuf {
        self.path("bokehcam/config.toml")
    }

    pub fn with_settings(self, text: &str) -> Self {
        fs::create_dir_all(self.path("bokehcam")).unwrap();
        fs::write(self.settings(), text).unwrap();
        self
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("BOKEHCAM_") {
                command.env_remove(name);
            }
        }
        command.env("XDG_CONFIG_HOME", self.0.path()).env_remove("RUST_LOG").env_remove("NO_COLOR");
        command
            .env("XDG_RUNTIME_DIR", self.0.path())
            .env("XDG_DATA_HOME", self.0.path())
            .env("XDG_DATA_DIRS", self.0.path());
        command.current_dir(self.0.path()).args(args).stdin(Stdio::null());
        command
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        self.command(args).output().unwrap().into()
    }

    /// `photo.png` and its depth, `depth.png` and `depth.pfm`: 64 x 48 pixels, 0.5 m to 4.5 m from left to right.
    pub fn with_photo(self) -> Self {
        let (width, height) = (64, 48);
        let mut photo = ColorImage::new(width, height);
        photo.rgb.iter_mut().enumerate().for_each(|(k, value)| *value = (k * 37 % 251) as u8);
        still::write_color(&self.path("photo.png"), &photo, false).unwrap();
        let depth = depth(width, height);
        still::write_depth(&self.path("depth.png"), &depth, 5000.0, false).unwrap();
        still::write_depth(&self.path("depth.pfm"), &depth, 1.0, false).unwrap();
        self
    }

    /// `recording`: four small frames with depth.
    pub fn with_recording(self) -> Self {
        self.run(&["record", "synthetic", "--size", "64x48", "--frames", "4", "--to", "recording"]).done();
        self
    }

    /// `colours`: the same without depth.
    pub fn with_colours(self) -> Self {
        let home = self.with_recording();
        fs::rename(home.path("recording"), home.path("colours")).unwrap();
        fs::remove_file(home.path("colours/depth.txt")).unwrap();
        let _ = fs::remove_file(home.path("colours/associations.txt"));
        home
    }
}

/// Depth that grows from left to right.
pub fn depth(width: u32, height: u32) -> DepthMap {
    let mut map = DepthMap::new(width, height);
    let metres = |k: usize| 0.5 + 4.0 * (k as u32 % width) as f32 / width as f32;
    map.metres.iter_mut().enumerate().for_each(|(k, value)| *value = metres(k));
    map
}

pub fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}
