//! What the user sees while a command runs: log lines, one-line messages, progress. All of it goes to standard error
//! through [`print`].

mod screen;

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracing_subscriber::EnvFilter;

use super::error::CliError;
use super::options::Global;
use super::values::LogFormat;
use screen::{Count, Screen};

static SCREEN: OnceLock<Screen> = OnceLock::new();

fn screen() -> &'static Screen {
    SCREEN.get_or_init(|| Screen::new(io::stderr()))
}

/// Prints whole lines, with their ends: never waits for the terminal.
fn print(lines: &[u8]) {
    screen().print(lines);
}

/// Waits until everything is printed, but not for a terminal that takes nothing.
pub fn flush() {
    SCREEN.get().into_iter().for_each(Screen::flush);
}

/// Where log lines are written to, each at once.
struct Log;

impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        print(line);
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Sends log lines to stderr: warnings, or as `-v`, `-q` and `RUST_LOG` say.
pub fn start_log(global: &Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        // What others grumble about is seldom for who uses this.
        (_, 0) => "bokehcam=warn,error",
        (_, 1) => "bokehcam=info,warn",
        (_, _) => "bokehcam=debug,info",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(|| Log);
    let log = log.with_ansi(io::stderr().is_terminal());
    // A second log in one process changes nothing.
    let _ = match global.log_format {
        LogFormat::Text => log.try_init(),
        LogFormat::Json => log.json().try_init(),
    };
}

/// One line on stderr.
pub fn say(line: &str) {
    print(format!("{line}\n").as_bytes());
}

/// Tells of a panic as of anything else: a thread that panics must not wait for the terminal, and its neighbours for it.
pub fn tell_of_panics() {
    std::panic::set_hook(Box::new(|panic| {
        if crate::compute::catches() {
            return;
        }
        let thread = std::thread::current();
        let backtrace = std::backtrace::Backtrace::capture();
        let told = format!("thread '{}' {panic}", thread.name().unwrap_or("unnamed"));
        match backtrace.status() {
            std::backtrace::BacktraceStatus::Captured => say(&format!("{told}\n{backtrace}")),
            _ => say(&told),
        }
    }));
}

/// The first Ctrl-C (or a termination signal) sets the flag, so that the file in hand is finished; the second ends
/// the program at once.
///
/// # Errors
/// The system has no place for a signal handler.
pub fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    /// What shells expect of a program that SIGINT ended.
    const INTERRUPTED: i32 = 130;
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    let handler = move || {
        if asked.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
        say("stopping after the frames in hand; Ctrl-C again aborts");
    };
    ctrlc::set_handler(handler).map_err(|error| CliError::Signals(error.to_string()))?;
    Ok(stop)
}

/// A bar of delivered frames on stderr; silent when that is no terminal.
pub struct Progress(Option<(&'static Screen, Arc<Count>)>);

impl Progress {
    /// A bar for `frames` frames, or a counter when their number is not known.
    pub fn new(frames: Option<u64>, global: &Global) -> Self {
        if global.quiet || !io::stderr().is_terminal() {
            return Self(None);
        }
        let template = match frames {
            Some(_) => "{wide_bar} {pos}/{len} frames, {per_sec}, {eta} left",
            None => "{spinner} {pos} frames, {per_sec}, {elapsed}",
        };
        let bar = ProgressBar::with_draw_target(frames, ProgressDrawTarget::stderr());
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        let screen = screen();
        Self(Some((screen, screen.begin(bar))))
    }

    /// So many frames are delivered.
    pub fn delivered(&self, frames: u64) {
        self.0.iter().for_each(|(_, count)| count.set(frames));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.iter().for_each(|(screen, count)| screen.end(count));
    }
}
