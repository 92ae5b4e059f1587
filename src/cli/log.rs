//! Everything that goes to stderr: log lines, messages, errors; as text, or as one JSON object a line.
//!
//! All of it goes through one [`Screen`].

use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::json;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

use super::options::{Global, LogFormat};
use super::screen::Screen;
/// How messages are written; text until [`start`] says otherwise.
static JSON: AtomicBool = AtomicBool::new(false);
static QUIET: AtomicBool = AtomicBool::new(false);

/// The way to stderr.
pub fn screen() -> &'static Screen {
    static SCREEN: OnceLock<Screen> = OnceLock::new();
    let missing = |lines: u64| line("WARN", &format!("{lines} lines are missing: the terminal took none for too long"));
    SCREEN.get_or_init(|| Screen::new(io::stderr(), missing))
}

/// Chooses how messages are written: also for what is wrong before the arguments are understood.
pub fn write_as(format: LogFormat) {
    JSON.store(format == LogFormat::Json, Ordering::Relaxed);
}

/// Starts log lines: warnings, or as `-v`, `-q` and `RUST_LOG` say.
pub fn start(global: &Global) {
    write_as(global.log_format);
    QUIET.store(global.quiet, Ordering::Relaxed);
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        // What others grumble about is seldom for who uses this; the window's frame does where no desktop answers.
        (_, 0) => "bokehcam=warn,sctk_adwaita=off,error",
        (_, 1) => "bokehcam=info,warn",
        (_, _) => "bokehcam=debug,info",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(LogLines);
    let log = log.with_ansi(io::stderr().is_terminal() && !no_color);
    // A second log in one process changes nothing.
    let _ = match global.log_format {
        LogFormat::Text => log.try_init(),
        LogFormat::Json => log.json().try_init(),
    };
}

/// A message of one or more lines.
pub fn say(text: &str) {
    message("INFO", text);
}

/// A warning, unless only what went wrong is to be told.
pub fn warn(what: &str) {
    if QUIET.load(Ordering::Relaxed) {
        return;
    }
    match JSON.load(Ordering::Relaxed) {
        true => message("WARN", what),
        false => message("WARN", &format!("warning: {}", printable(what, &[]))),
    }
}

/// What went wrong, in one line.
pub fn error(what: &str) {
    match JSON.load(Ordering::Relaxed) {
        true => message("ERROR", what),
        false => message("ERROR", &format!("error: {}", printable(what, &[]))),
    }
}

fn message(level: &str, text: &str) {
    screen().print(line(level, text).as_bytes());
}

/// A message with its end, as text or JSON.
fn line(level: &str, text: &str) -> String {
    if !JSON.load(Ordering::Relaxed) {
        return format!("{}\n", printable(text, &['\n']));
    }
    let mut timestamp = String::new();
    // Without a clock there is no time to tell.
    let _ = SystemTime.format_time(&mut Writer::new(&mut timestamp));
    // As the log's own lines are.
    let object = json!({"timestamp": timestamp, "level": level, "fields": {"message": text}, "target": "bokehcam"});
    format!("{object}\n")
}

/// Waits until everything that was said is written, but not for a terminal that takes nothing.
pub fn flush() {
    screen().flush();
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
            std::backtrace::BacktraceStatus::Captured => message("ERROR", &format!("{told}\n{backtrace}")),
            _ => message("ERROR", &told),
        }
    }));
}

/// `text` with control characters, and those that turn the direction of writing, as a program would spell them; but
/// `keep`. Names of files and devices are others' texts, and a terminal obeys what it is sent.
pub fn printable<'a>(text: &'a str, keep: &[char]) -> Cow<'a, str> {
    let turns = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let acts = |c: char| (c.is_control() || turns(c) || matches!(c, '\u{2028}' | '\u{2029}')) && !keep.contains(&c);
    if !text.contains(acts) {
        return text.into();
    }
    let mut spelt = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if acts(c) { spelt.extend(c.escape_default()) } else { spelt.push(c) }
    }
    spelt.into()
}

/// Makes a line of each event of the log.
struct LogLines;

/// One event; sent when it is whole.
struct LogLine(Vec<u8>);

impl MakeWriter<'_> for LogLines {
    type Writer = LogLine;

    fn make_writer(&self) -> LogLine {
        LogLine(Vec::new())
    }
}

impl Write for LogLine {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for LogLine {
    fn drop(&mut self) {
        let text = String::from_utf8_lossy(&self.0);
        // The log's own colours begin with an escape; those of others' texts it spells itself.
        let line = printable(text.trim_end_matches('\n'), &['\x1b']);
        screen().print(format!("{line}\n").as_bytes());
    }
}

/// What clap says in paragraphs, in one line and without the usage.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let told = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with("Usage:") && !line.starts_with("For more information"));
    let mut sentence = String::new();
    for line in told {
        let joint = match sentence.chars().last() {
            None => "",
            Some(':') => " ",
            Some(_) if line.starts_with('[') => " ",
            Some(_) => "; ",
        };
        sentence.push_str(joint);
        sentence.push_str(line.strip_prefix("error: ").unwrap_or(line));
    }
    sentence
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_spelt_out() {
        assert_eq!(printable("a\x1b[2Jb\u{9b}31m\r\u{202e}\n", &['\n']), "a\\u{1b}[2Jb\\u{9b}31m\\r\\u{202e}\n");
        assert_eq!(printable("ä 木\n", &[]), "ä 木\\n");
        assert!(matches!(printable("plain ünïcode", &[]), Cow::Borrowed(_)));
    }
}
