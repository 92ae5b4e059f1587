//! Standard error: a blocked terminal does not block the program, and messages do not mix with the progress bar.
#![allow(unsafe_code)]

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread;
use std::time::Duration;

use rustix::fs::OFlags;
use rustix::ioctl::{Getter, Setter, ioctl, opcode};
use rustix::process::Signal;

use crate::program::{Beside, Home, PORTRAIT};

/// Timeout against hangs.
const HANG: Duration = Duration::from_secs(60);

/// Opens a pseudo-terminal; returns the master side, which reads the output, and the path of the slave side.
pub fn terminal() -> (File, PathBuf) {
    const UNLOCK: u32 = opcode::write::<i32>(b'T', 0x31);
    const NUMBER: u32 = opcode::read::<u32>(b'T', 0x30);
    let screen = OpenOptions::new().read(true).write(true).open("/dev/ptmx").unwrap();
    // SAFETY: TIOCSPTLCK reads an int, and TIOCGPTN writes an unsigned one (ioctl_tty(2)).
    let number = unsafe {
        ioctl(&screen, Setter::<UNLOCK, i32>::new(0)).unwrap();
        ioctl(&screen, Getter::<NUMBER, u32>::new()).unwrap()
    };
    (screen, PathBuf::from(format!("/dev/pts/{number}")))
}

pub fn open_terminal(name: &Path) -> File {
    let no_controlling = OFlags::NOCTTY.bits() as i32;
    OpenOptions::new().read(true).write(true).custom_flags(no_controlling).open(name).unwrap()
}

/// Writes until the terminal's buffer is full.
fn fill(name: &Path) {
    let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits() as i32;
    let mut terminal = OpenOptions::new().write(true).custom_flags(flags).open(name).unwrap();
    // The kernel may free buffer space later.
    while fill_up(&mut terminal) > 0 {
        thread::sleep(Duration::from_millis(100));
    }
}

fn fill_up(mut file: impl Write) -> usize {
    let mut written = 0;
    for size in [4096, 1] {
        let blanks = vec![b' '; size];
        loop {
            match file.write(&blanks) {
                Ok(bytes) => written += bytes,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => panic!("{error}"),
            }
        }
    }
    written
}

/// Sends a message per frame of a y4m stream of 320 x 240 pixels.
fn frames(stream: impl Read + Send + 'static) -> std::sync::mpsc::Receiver<()> {
    let (told, frames) = std::sync::mpsc::channel();
    thread::spawn(move || {
        let mut stream = BufReader::new(stream);
        let mut header = String::new();
        stream.read_line(&mut header).unwrap();
        let number = |sign: char| {
            let field = header.split(' ').find_map(|field| field.strip_prefix(sign)).unwrap();
            field.trim().parse::<usize>().unwrap()
        };
        let (width, height) = (number('W'), number('H'));
        let mut frame = vec![0; "FRAME\n".len() + width * height + 2 * width.div_ceil(2) * height.div_ceil(2)];
        while stream.read_exact(&mut frame).is_ok() && told.send(()).is_ok() {}
    });
    frames
}

#[test]
fn a_terminal_that_is_not_read_stops_no_frame_and_no_end() {
    let (_screen, name) = terminal();
    let slave = open_terminal(&name);
    fill(&name);
    let home = Home::new();
    let args = ["stream", PORTRAIT, "--loop", "--effect", "none", "--pace", "realtime", "--to", "-", "-vv"];
    let mut run = Beside::start(home.command(&args).stdout(Stdio::piped()).stderr(slave));
    let frames = frames(run.0.stdout.take().unwrap());
    for frame in 0..30 {
        frames.recv_timeout(HANG).unwrap_or_else(|_| panic!("frame {frame} does not come"));
    }
    run.end_by(Signal::TERM, HANG).done();
}

#[test]
fn a_reader_of_errors_that_stands_still_stops_no_end() {
    let (_reader, writer): (OwnedFd, OwnedFd) = rustix::pipe::pipe().unwrap();
    let flags = rustix::fs::fcntl_getfl(&writer).unwrap();
    rustix::fs::fcntl_setfl(&writer, flags | OFlags::NONBLOCK).unwrap();
    fill_up(File::from(writer.try_clone().unwrap()));
    rustix::fs::fcntl_setfl(writer.as_fd(), flags).unwrap();
    let home = Home::new();
    let run = Beside::start(home.command(&["stream", "/no/such/folder", "--to", "null"]).stderr(writer));
    let code = run.end(HANG).code;
    assert!(matches!(code, 1 | 2), "{code}");
}

#[test]
fn a_warning_has_a_line_of_its_own_beside_the_bar() {
    let home = Home::new();
    let own = home.path("own");
    for part in ["rgb", "depth"] {
        fs::create_dir_all(own.join(part)).unwrap();
        for picture in fs::read_dir(Path::new(PORTRAIT).join(part)).unwrap().flatten() {
            fs::copy(picture.path(), own.join(part).join(picture.file_name())).unwrap();
        }
    }
    // Seconds, in which a bar is drawn even if the machine is busy.
    let line = |n: u32| format!("{0} rgb/{n:06}.png {0} depth/{n:06}.png\n", f64::from(n) * 0.25);
    fs::write(own.join("associations.txt"), (0..24).map(line).collect::<String>()).unwrap();
    // From a frame at which the bar is visible; all later frames are broken, as a slow machine skips some.
    for picture in fs::read_dir(own.join("rgb")).unwrap().flatten().filter(|entry| *entry.file_name() >= *"000012.png")
    {
        fs::write(picture.path(), "no picture").unwrap();
    }

    let (mut screen, name) = terminal();
    let slave = open_terminal(&name);
    let args = ["stream", "own", "--effect", "none", "--pace", "realtime", "--to", "null", "--keep-going"];
    let run = Beside::start(home.command(&args).stdout(Stdio::null()).stderr(slave));
    let reader = thread::spawn(move || {
        let mut told = Vec::new();
        // Reading fails after the program has closed the terminal.
        let _ = screen.read_to_end(&mut told);
        String::from_utf8_lossy(&told).into_owned()
    });
    run.end(HANG).done();
    let told = reader.join().unwrap();
    assert!(told.contains(" frames, "), "a bar: {told:?}");
    let warning = told.find("such frames are skipped").unwrap_or_else(|| panic!("{told:?}"));
    // The text on the warning's line before the warning.
    let line = told[..warning].rsplit('\n').next().unwrap();
    let shown = line.rsplit("\x1b[2K").next().unwrap();
    assert!(!shown.contains(" frames, "), "{line:?}");
    let shown = shown.trim_start_matches('\r');
    assert!(shown.starts_with("warning: "), "{shown:?}");
}
