//! What the user sees while a command runs, and how it is ended.

use std::cell::Cell;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::error::CliError;
use super::log;
pub use super::log::say;
use super::options::Global;
use super::screen::{Count, Screen};
use bokehcam::depth::plate::{Guide, Step};
use bokehcam::stats::Report;

/// The first Ctrl-C (or a termination signal) sets the flag, so that the file in hand is finished; the second ends
/// the program at once.
///
/// # Errors
/// The system has no place for a signal handler.
pub fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    /// Signals that come within so long of the first are no second ones.
    const TOGETHER: Duration = Duration::from_millis(100);
    /// What shells expect of a program that SIGINT ended.
    const INTERRUPTED: i32 = 130;
    let stop = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stop);
    let mut first: Option<Instant> = None;
    let handler = move || {
        match first {
            // `timeout`, for one, signals a program and then its group: that is one wish.
            Some(first) if first.elapsed() < TOGETHER => return,
            Some(_) => std::process::exit(INTERRUPTED),
            None => first = Some(Instant::now()),
        }
        is_stopping.store(true, Ordering::Relaxed);
        // Nobody waits for a network that hangs.
        #[cfg(feature = "networks")]
        bokehcam::network::apart::hurry();
        #[cfg(feature = "gpu")]
        bokehcam::compute::device::end_soon();
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
            Some(_) => "{wide_bar} {pos}/{len} frames, {rate} a second, {eta} left",
            None => "{spinner} {pos} frames, {rate} a second, {elapsed}",
        };
        let bar = ProgressBar::with_draw_target(frames, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let rate = |state: &ProgressState, to: &mut dyn fmt::Write| {
            // Writing into memory cannot fail.
            let _ = write!(to, "{:.1}", state.per_sec());
        };
        bar.set_style(style.with_key("rate", rate));
        let screen = log::screen();
        Self(Some((screen, screen.begin(bar))))
    }

    /// None.
    #[cfg(feature = "camera")]
    pub fn silent() -> Self {
        Self(None)
    }

    /// Sets how many frames are delivered.
    pub fn delivered(&self, frames: u64) {
        self.0.iter().for_each(|(_, count)| count.set(frames));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.iter().for_each(|(screen, count)| screen.end(count));
    }
}

/// Tells a person who takes a plate what to do, once each.
pub struct Guidance {
    guide: Option<Arc<Guide>>,
    is_quiet: bool,
    told: Cell<Option<Step>>,
}

impl Guidance {
    /// Tells of the plate that is taken or used, if there is one.
    pub fn new(guide: Option<Arc<Guide>>, global: &Global) -> Self {
        Self { guide, is_quiet: global.quiet, told: Cell::new(None) }
    }

    /// How far the plate is.
    pub fn step(&self) -> Option<Step> {
        self.guide.as_ref().map(|guide| guide.step())
    }

    /// Says what is new.
    pub fn tell(&self) {
        let Some(step) = self.step() else { return };
        // How much of it is taken is no news, nor is a plate that was there from the start.
        let news = if matches!(step, Step::Taking(_)) { Step::Taking(0) } else { step };
        let told = self.told.replace(Some(news));
        if !self.is_quiet && told != Some(news) && (told.is_some() || news != Step::Ready) {
            say(&step.to_string());
        }
    }
}

/// Says how a run went, and what its stages took where more is to be told.
pub fn say_report(report: &Report, global: &Global) {
    let is_shown = |line: &&str| global.verbose > 0 || !line.contains(" ms: ");
    if !global.quiet {
        say(&report.to_string().lines().filter(is_shown).collect::<Vec<_>>().join("\n"));
    }
}

/// Prints to standard output, with what a terminal would obey escaped.
///
/// # Errors
/// Nobody reads, or it is full.
pub fn print(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    let text = String::from_utf8_lossy(bytes);
    stdout
        .write_all(log::printable(&text, &['\n', '\t']).as_bytes())
        .and_then(|()| stdout.flush())
        .map_err(CliError::io("standard output".as_ref()))
}
