//! Terminal output while a command runs, and its interruption.

use std::cell::Cell;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::error::CliError;
use super::log;
pub use super::log::print_to_stderr;
use super::options::Global;
use super::screen::{ProgressCount, Screen};
use bokehcam::depth::plate::{Guide, Step};
use bokehcam_live::stats::Report;

/// Returns a flag that the first Ctrl-C (or termination signal) sets, so that the file in hand is finished; the second
/// ends the program at once.
///
/// # Errors
/// Fails if the signal handler cannot be set.
pub fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    stop_flag_between("frames")
}

/// Does the same as [`stop_flag`] for a command that works on `items`.
///
/// # Errors
/// Same as for [`stop_flag`].
pub fn stop_flag_between(items: &'static str) -> Result<Arc<AtomicBool>, CliError> {
    /// Signals this soon after the first count as the same one.
    const SAME_REQUEST: Duration = Duration::from_millis(100);
    /// Exit code of a program ended by SIGINT, by shell convention.
    const SIGINT_EXIT_CODE: i32 = 130;
    let stop = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stop);
    let mut first: Option<Instant> = None;
    let handler = move || {
        match first {
            // `timeout`, for one, signals a program and then its group: a single request to stop.
            Some(first) if first.elapsed() < SAME_REQUEST => return,
            Some(_) => std::process::exit(SIGINT_EXIT_CODE),
            None => first = Some(Instant::now()),
        }
        is_stopping.store(true, Ordering::Relaxed);
        // A hanging network must not delay the end.
        #[cfg(feature = "networks")]
        bokehcam_networks::network::shorten_timeouts();
        bokehcam::compute::device::begin_shutdown();
        print_to_stderr(&format!("stopping after the current {items}; press Ctrl-C again to abort"));
    };
    ctrlc::set_handler(handler).map_err(|error| CliError::Signals(error.to_string()))?;
    Ok(stop)
}

/// A progress bar of delivered frames, or other items, on stderr; silent if stderr is no terminal.
pub struct Progress(Option<(&'static Screen, Arc<ProgressCount>)>);

impl Progress {
    /// Creates a bar for `frames` frames, or a counter if their number is unknown.
    pub fn new(frames: Option<u64>, global: &Global) -> Self {
        Self::with_items("frames", frames, global)
    }

    /// Does the same as [`Progress::new`] for a count of `items`.
    pub fn with_items(items: &str, count: Option<u64>, global: &Global) -> Self {
        if global.quiet || !io::stderr().is_terminal() {
            return Self(None);
        }
        let template = match count {
            Some(_) => format!("{{wide_bar}} {{pos}}/{{len}} {items}, {{rate}} a second, {{eta}} left"),
            None => format!("{{spinner}} {{pos}} {items}, {{rate}} a second, {{elapsed}}"),
        };
        let bar = ProgressBar::with_draw_target(count, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let rate = |state: &ProgressState, to: &mut dyn fmt::Write| {
            // Writing to memory cannot fail.
            let _ = write!(to, "{:.1}", state.per_sec());
        };
        bar.set_style(style.with_key("rate", rate));
        let screen = log::screen();
        Self(Some((screen, screen.show_bar(bar))))
    }

    /// Creates a bar that shows nothing.
    pub fn silent() -> Self {
        Self(None)
    }

    /// Sets the number of delivered frames.
    pub fn set_delivered(&self, frames: u64) {
        self.0.iter().for_each(|(_, count)| count.set(frames));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.iter().for_each(|(screen, count)| screen.remove_bar(count));
    }
}

/// Prints each step of taking a plate once, as guidance for the user.
pub struct Guidance {
    guide: Option<Arc<Guide>>,
    is_quiet: bool,
    printed: Cell<Option<Step>>,
}

impl Guidance {
    /// Follows the plate that `guide` takes or uses, if any.
    pub fn new(guide: Option<Arc<Guide>>, global: &Global) -> Self {
        Self { guide, is_quiet: global.quiet, printed: Cell::new(None) }
    }

    /// Returns the current step.
    pub fn step(&self) -> Option<Step> {
        self.guide.as_ref().map(|guide| guide.step())
    }

    /// Prints the step, if it is new.
    pub fn print_step(&self) {
        let Some(step) = self.step() else { return };
        // Progress within a step is not printed, nor a plate that exists from the start.
        let news = if matches!(step, Step::Capturing(_)) { Step::Capturing(0) } else { step };
        let printed = self.printed.replace(Some(news));
        if !self.is_quiet && printed != Some(news) && (printed.is_some() || news != Step::Ready) {
            print_to_stderr(&step.to_string());
        }
    }
}

/// Prints the outcome of a run; with `--verbose`, all counts and times of its report.
pub fn print_report(report: &Report, global: &Global) {
    if !global.quiet {
        print_to_stderr(&if global.verbose > 0 { report.to_string() } else { report.outcome() });
    }
}

/// Prints to standard output, with terminal control characters escaped.
///
/// # Errors
/// Fails if the reader closed it, or the disk is full.
pub fn print_to_stdout(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    let text = String::from_utf8_lossy(bytes);
    stdout
        .write_all(log::escape_controls(&text, &['\n', '\t']).as_bytes())
        .and_then(|()| stdout.flush())
        .map_err(CliError::io("standard output".as_ref()))
}
