//! A user with private runtime folder and settings, running streams, and their output.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde_json::Value;

use crate::program::{self, Beside, Home, PORTRAIT, Ran};

/// Timeout against hangs; far longer than any test takes.
pub const HANG: Duration = Duration::from_secs(60);

/// Waits until a condition holds.
#[track_caller]
pub fn until(what: &str, is: impl FnMut() -> bool) {
    program::until(what, HANG, is);
}

pub struct World(Home);

impl World {
    pub fn new() -> Self {
        let home = Home::new();
        for folder in ["config/bokehcam", "pictures", "here"] {
            fs::create_dir_all(home.path(folder)).unwrap();
        }
        Self(home)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path(name)
    }

    pub fn socket(&self, name: &str) -> PathBuf {
        self.path("run/bokehcam").join(format!("{name}.sock"))
    }

    pub fn bokehcam(&self, args: &[&str]) -> Command {
        let mut command = self.0.command(args);
        command.env("XDG_PICTURES_DIR", self.path("pictures")).current_dir(self.path("here"));
        command
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::of(&mut self.bokehcam(args))
    }

    pub fn ctl(&self, args: &[&str]) -> Ran {
        self.run(&[&["ctl"], args].concat())
    }

    pub fn status(&self, args: &[&str]) -> Value {
        let ran = self.ctl(&[&["status", "--json"], args].concat());
        ran.done();
        assert_eq!(ran.stdout.lines().count(), 1, "{}", ran.stdout);
        ran.json()
    }

    /// Sends raw bytes to a run, leaving the connection open; returns its answer.
    pub fn tell(&self, name: &str, request: &[u8]) -> String {
        let mut stream = UnixStream::connect(self.socket(name)).unwrap();
        // The run may refuse the request before all of it is sent.
        let _ = stream.write_all(request);
        answer(&stream)
    }

    /// Starts a stream of the looped recording in real time, and waits until it answers.
    pub fn stream(&self, name: &str, args: &[&str]) -> Beside {
        let first = ["stream", PORTRAIT, "--loop", "--pace", "realtime", "--quiet"];
        let running = Beside::start(self.bokehcam(&[&first, args].concat()).stdout(Stdio::piped()));
        until(&format!("{name} answers"), || self.ctl(&["status", "--name", name]).code == 0);
        running
    }
}

pub fn answer(stream: &UnixStream) -> String {
    let mut line = String::new();
    stream.set_read_timeout(Some(HANG)).unwrap();
    BufReader::new(stream).read_line(&mut line).unwrap();
    line
}

impl Beside {
    /// Sends SIGINT, as Ctrl-C does, and returns the exit code; also works with an unread output.
    pub fn interrupt(mut self) -> i32 {
        self.signal(Signal::INT);
        self.0.wait().unwrap().code().unwrap()
    }

    /// Reads the pictures on its standard output.
    pub fn watch(&mut self) -> Pictures {
        Pictures::of(self.0.stdout.take().unwrap())
    }
}

/// The luma plane of a picture, 16 to 235.
#[derive(Clone)]
pub struct Picture {
    pub width: usize,
    pub luma: Vec<u8>,
    pub at: Instant,
}

impl Picture {
    /// Whether this is the still card: a dark vertical gradient, constant along the first eighth of each row.
    pub fn is_card(&self) -> bool {
        let rows: Vec<&[u8]> = self.luma.chunks_exact(self.width).collect();
        let (first, last) = (rows[0][0], rows[rows.len() - 1][0]);
        let is_even = |row: &&[u8]| row[..self.width / 8].iter().all(|&value| value.abs_diff(row[0]) <= 1);
        first.abs_diff(57) <= 3 && last.abs_diff(38) <= 3 && rows.iter().all(is_even)
    }

    /// Measures detail, which blur removes: the mean difference between adjacent pixels of a row.
    pub fn detail(&self) -> f64 {
        let pairs = self.luma.windows(2).map(|pair| f64::from(pair[0].abs_diff(pair[1])));
        pairs.sum::<f64>() / self.luma.len() as f64
    }
}

/// The pictures of a y4m stream: the last one, and for each one whether it was the card.
#[derive(Clone)]
pub struct Pictures(Arc<Mutex<Seen>>);

type Seen = (Vec<(Instant, bool)>, Option<Picture>);

impl Pictures {
    pub fn of(from: impl Read + Send + 'static) -> Self {
        let pictures = Self(Arc::default());
        let seen = pictures.clone();
        thread::spawn(move || seen.read(from));
        pictures
    }

    fn read(&self, from: impl Read) {
        let mut from = BufReader::new(from);
        let mut header = String::new();
        from.read_line(&mut header).unwrap();
        let number = |letter: char| {
            let part = header.split(' ').find(|part| part.starts_with(letter) && part.len() < 6).unwrap();
            part[1..].parse::<usize>().unwrap()
        };
        let (width, height) = (number('W'), number('H'));
        let mut frame = vec![0; width * height + 2 * width.div_ceil(2) * height.div_ceil(2)];
        let mut line = String::new();
        while from.read_line(&mut line).is_ok_and(|read| read > 0) && from.read_exact(&mut frame).is_ok() {
            assert_eq!(line, "FRAME\n");
            line.clear();
            let picture = Picture { width, luma: frame[..width * height].to_vec(), at: Instant::now() };
            let mut seen = self.0.lock().unwrap();
            seen.0.push((picture.at, picture.is_card()));
            seen.1 = Some(picture);
        }
    }

    /// Returns the arrival time of each picture so far, and whether it was the card.
    pub fn cards(&self) -> Vec<(Instant, bool)> {
        self.0.lock().unwrap().0.clone()
    }

    /// Waits for the next picture that satisfies `is_it`.
    pub fn wait_for(&self, what: &str, mut is_it: impl FnMut(&Picture) -> bool) -> Picture {
        let began = Instant::now();
        let mut last = None;
        loop {
            let picture = self.0.lock().unwrap().1.clone().filter(|picture| picture.at >= began);
            if let Some(picture) = picture.filter(|picture| last.replace(picture.at) != Some(picture.at))
                && is_it(&picture)
            {
                return picture;
            }
            assert!(began.elapsed() < HANG, "no picture: {what}");
            thread::sleep(Duration::from_millis(2));
        }
    }
}
