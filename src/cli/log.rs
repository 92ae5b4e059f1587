//! Everything that goes to stderr: log lines, messages, errors; as text, or as one JSON object a line.
//!
//! A thread of its own writes. Nobody who has something to say waits for a terminal that is not read: lines wait, and
//! beyond [`MOST_WAITING`] of them are lost, which is said.

use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use serde_json::json;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

use super::options::Global;
use super::values::LogFormat;

/// Lines that may wait for the terminal.
const MOST_WAITING: usize = 1024;
/// So long the end of the program waits until all is written.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// What begins a line where a progress bar may stand.
const CLEAR_LINE: &str = "\r\x1b[2K";

/// How messages are written; text until [`start`] says otherwise.
static JSON: AtomicBool = AtomicBool::new(false);
static QUIET: AtomicBool = AtomicBool::new(false);
/// Whether a progress bar stands in the last line of the terminal.
static BAR: AtomicBool = AtomicBool::new(false);

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
        // What others grumble about is seldom for who uses this.
        (_, 0) => "bokehcam=warn,error",
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

/// Says whether a progress bar stands in the last line.
pub fn bar_is_shown(shown: bool) {
    BAR.store(shown, Ordering::Relaxed);
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
    if !JSON.load(Ordering::Relaxed) {
        return lines().send(format!("{}\n", printable(text, &['\n'])));
    }
    let mut timestamp = String::new();
    // Without a clock there is no time to tell.
    let _ = SystemTime.format_time(&mut Writer::new(&mut timestamp));
    // As the log's own lines are.
    let object = json!({"timestamp": timestamp, "level": level, "fields": {"message": text}, "target": "bokehcam"});
    lines().send(format!("{object}\n"));
}

/// Waits until everything that was said is written, but not for ever.
pub fn flush() {
    let began = Instant::now();
    let lines = lines();
    while lines.waiting.load(Ordering::Acquire) > 0 && began.elapsed() < LAST_WORDS {
        std::thread::sleep(Duration::from_millis(1));
    }
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

/// What waits for the terminal.
struct Lines {
    /// None where there is no thread to write.
    sender: Option<SyncSender<String>>,
    waiting: AtomicU64,
    lost: AtomicU64,
}

fn lines() -> &'static Lines {
    static LINES: OnceLock<Lines> = OnceLock::new();
    LINES.get_or_init(|| {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let thread = std::thread::Builder::new().name("log".into()).spawn(|| write_all(receiver));
        let sender = thread.is_ok().then_some(sender);
        Lines { sender, waiting: AtomicU64::new(0), lost: AtomicU64::new(0) }
    })
}

fn write_all(lines_in: Receiver<String>) {
    for line in lines_in {
        let lines = lines();
        write(&line);
        match lines.lost.swap(0, Ordering::Relaxed) {
            0 => {}
            lost => write(&format!("{lost} lines were lost here: nobody read them\n")),
        }
        lines.waiting.fetch_sub(1, Ordering::Release);
    }
}

/// In one piece. A closed stderr is no reason to fail.
fn write(line: &str) {
    let mut stderr = io::stderr();
    let _ = match BAR.load(Ordering::Relaxed) {
        true => stderr.write_all(format!("{CLEAR_LINE}{line}").as_bytes()),
        false => stderr.write_all(line.as_bytes()),
    };
}

impl Lines {
    fn send(&self, line: String) {
        let Some(sender) = &self.sender else { return write(&line) };
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if sender.try_send(line).is_err() {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
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
        lines().send(format!("{line}\n"));
    }
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
