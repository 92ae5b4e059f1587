//! Output to stderr: log lines, messages, errors; as text, or as one JSON object per line.
//!
//! All of it goes through one [`Screen`].

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::error::ContextKind;
use serde_json::json;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::format::{Format, Writer};
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::prelude::*;
use tracing_subscriber::registry::LookupSpan;

use super::options::{Global, LogFormat};
use super::screen::Screen;

/// Whether messages are JSON; text until [`set_format`].
static JSON: AtomicBool = AtomicBool::new(false);
static QUIET: AtomicBool = AtomicBool::new(false);

/// The only writer to stderr, shared by all threads.
pub fn screen() -> &'static Screen {
    static SCREEN: OnceLock<Screen> = OnceLock::new();
    let lost =
        |lines: u64| encode("WARN", &format!("{lines} lines are missing: the terminal accepted none for too long"));
    SCREEN.get_or_init(|| Screen::new(io::stderr(), lost))
}

/// Sets the format of messages, also for errors before the arguments are parsed.
pub fn set_format(format: LogFormat) {
    JSON.store(format == LogFormat::Json, Ordering::Relaxed);
}

/// Installs the logger. Its level comes from `RUST_LOG`, else from `-v` or `-q`, else it is `warn`.
pub fn start(global: &Global) {
    set_format(global.log_format);
    QUIET.store(global.quiet, Ordering::Relaxed);
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        // Warnings of other crates are rarely of use to the user. sctk_adwaita, which draws window frames, even logs
        // errors wherever no desktop portal answers.
        (_, 0) => "bokehcam=warn,sctk_adwaita=off,error",
        (_, 1) => "bokehcam=info,warn",
        (_, _) => "bokehcam=debug,info",
    };
    let from_env = std::env::var("RUST_LOG").ok().filter(|text| !text.is_empty());
    let filter: Targets =
        from_env.and_then(|text| text.parse().ok()).or_else(|| level.parse().ok()).unwrap_or_default();
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let log = tracing_subscriber::fmt::layer().with_writer(LogLines);
    let full = tracing_subscriber::fmt::format();
    let log = log.with_ansi(io::stderr().is_terminal() && !no_color);
    let all = tracing_subscriber::registry();
    // Fails if a logger is installed already, as in tests; that one stays.
    let _ = match global.log_format {
        LogFormat::Text => all.with(log.event_format(PlainFormat(full)).with_filter(filter)).try_init(),
        LogFormat::Json => all.with(log.json().with_filter(filter)).try_init(),
    };
    bokehcam::names::repeat_warnings();
}

/// Prints a message of one or more lines.
pub fn print_to_stderr(text: &str) {
    print_message("INFO", text);
}

/// Prints a warning, unless `--quiet` is given.
pub fn warn(what: &str) {
    print_remark(Remark::Warning, what);
}

/// Prints a note on an automatic action, unless `--quiet` is given.
pub fn note(what: &str) {
    print_remark(Remark::Note, what);
}

/// A warning or a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Remark {
    Warning,
    Note,
}

thread_local! {
    /// This thread's remarks during [`hold_remarks`].
    static HELD: RefCell<Option<Vec<(Remark, String)>>> = const { RefCell::new(None) };
}

/// Returns what `work` warns of and notes on this thread, instead of printing it.
pub fn hold_remarks<T>(work: impl FnOnce() -> T) -> (T, Vec<(Remark, String)>) {
    HELD.set(Some(Vec::new()));
    let done = work();
    (done, HELD.take().unwrap_or_default())
}

fn print_remark(remark: Remark, what: &str) {
    let is_held = HELD.with_borrow_mut(|held| held.as_mut().map(|held| held.push((remark, what.to_owned()))).is_some());
    let (level, name) = match remark {
        Remark::Warning => ("WARN", "warning"),
        Remark::Note => ("INFO", "note"),
    };
    match JSON.load(Ordering::Relaxed) {
        _ if is_held || QUIET.load(Ordering::Relaxed) => {}
        true => print_message(level, what),
        false => print_message(level, &format!("{name}: {}", escape_controls(what, &[]))),
    }
}

/// Prints an error in one line.
pub fn error(what: &str) {
    match JSON.load(Ordering::Relaxed) {
        true => print_message("ERROR", what),
        false => print_message("ERROR", &format!("error: {}", escape_controls(what, &[]))),
    }
}

fn print_message(level: &str, text: &str) {
    screen().print(encode(level, text).as_bytes());
}

/// Maximum length of a printed line, in characters: file names and values may have any length.
const MAX_CHARS: usize = 1000;
/// Characters kept at the end of a longer line.
const TAIL_CHARS: usize = 300;

/// Shortens lines longer than [`MAX_CHARS`] to their start and end, with the number of omitted characters between.
fn shorten_lines(text: &str) -> Cow<'_, str> {
    // A line has at most as many characters as bytes.
    if text.split('\n').all(|line| line.len() <= MAX_CHARS) {
        return text.into();
    }
    let shorten = |line: &str| {
        let chars = line.chars().count();
        if chars <= MAX_CHARS {
            return line.to_owned();
        }
        let place = |at: usize| line.char_indices().nth(at).map_or(line.len(), |(place, _)| place);
        let (first, last) = (MAX_CHARS - TAIL_CHARS, chars - TAIL_CHARS);
        format!("{} ... ({} characters) ... {}", &line[..place(first)], last - first, &line[place(last)..])
    };
    text.split('\n').map(shorten).collect::<Vec<_>>().join("\n").into()
}

/// Formats a message with its line end: as text, or as a JSON object in the logger's own form.
fn encode(level: &str, text: &str) -> String {
    let text = &*shorten_lines(text);
    if !JSON.load(Ordering::Relaxed) {
        return format!("{}\n", escape_controls(text, &['\n']));
    }
    let mut timestamp = String::new();
    // Fails only without a clock: then the time stays empty.
    let _ = SystemTime.format_time(&mut Writer::new(&mut timestamp));
    let object = json!({"timestamp": timestamp, "level": level, "fields": {"message": text}, "target": "bokehcam"});
    format!("{object}\n")
}

/// Waits until all messages are written, but not for a stalled terminal.
pub fn flush() {
    screen().flush();
}

/// Installs a panic hook that prints through [`screen`]: a panicking thread must neither wait for the terminal nor
/// block others.
pub fn install_panic_hook() {
    std::panic::set_hook(Box::new(|panic| {
        // The panic is caught and reported as an error elsewhere.
        if bokehcam::compute::is_catching_panics() {
            return;
        }
        let thread = std::thread::current();
        let backtrace = std::backtrace::Backtrace::capture();
        let text = format!("thread '{}' {panic}", thread.name().unwrap_or("unnamed"));
        match backtrace.status() {
            std::backtrace::BacktraceStatus::Captured => print_message("ERROR", &format!("{text}\n{backtrace}")),
            _ => print_message("ERROR", &text),
        }
    }));
}

/// Escapes, as in Rust source, control and bidirectional formatting characters, except `keep`: names of files and
/// devices may contain any character, and a terminal would execute them.
pub fn escape_controls<'a>(text: &'a str, keep: &[char]) -> Cow<'a, str> {
    let is_bidi = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let is_separator = |c: char| matches!(c, '\u{2028}' | '\u{2029}');
    let is_risky = |c: char| (c.is_control() || is_bidi(c) || is_separator(c)) && !keep.contains(&c);
    if !text.contains(is_risky) {
        return text.into();
    }
    let mut escaped = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_risky(c) { escaped.extend(c.escape_default()) } else { escaped.push(c) }
    }
    escaped.into()
}

/// Formats this program's warnings and errors like messages, and all other events with time and target.
struct PlainFormat(Format);

impl<S, N> FormatEvent<S, N> for PlainFormat
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut to: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let metadata = event.metadata();
        let is_ours = metadata.target().starts_with("bokehcam");
        let name = match *metadata.level() {
            Level::ERROR if is_ours => "error",
            Level::WARN if is_ours => "warning",
            _ => return self.0.format_event(context, to, event),
        };
        write!(to, "{name}: ")?;
        context.field_format().format_fields(to.by_ref(), event)?;
        writeln!(to)
    }
}

/// Creates one [`LogLine`] per event of the logger.
struct LogLines;

/// Text of one event, printed as a whole on drop.
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
        if JSON.load(Ordering::Relaxed)
            && let Ok(mut object) = serde_json::from_str::<serde_json::Value>(&text)
        {
            let fields = object["fields"].as_object_mut().into_iter().flat_map(|fields| fields.values_mut());
            for value in fields {
                if let Some(text) = value.as_str().map(|text| shorten_lines(text).into_owned()) {
                    *value = text.into();
                }
            }
            return screen().print(format!("{object}\n").as_bytes());
        }
        let text = shorten_lines(text.trim_end_matches('\n'));
        // The logger's colours need the escape character; it has already escaped those in its field values.
        let line = escape_controls(&text, &['\x1b']);
        screen().print(format!("{line}\n").as_bytes());
    }
}

/// Joins clap's message of several paragraphs to one line, without usage and help hints, and without a tip if all
/// values are listed.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let is_hint = |line: &&str| {
        let is_tip = line.starts_with("tip:") && error.get(ContextKind::ValidValue).is_some();
        is_tip || line.starts_with("Usage:") || line.starts_with("For more information")
    };
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !is_hint(line));
    let mut sentence = String::new();
    for line in lines {
        let separator = match sentence.chars().last() {
            None => "",
            Some(':' | '.') => " ",
            // A list of possible values continues the previous line.
            Some(_) if line.starts_with('[') => " ",
            Some(_) => "; ",
        };
        sentence.push_str(separator);
        sentence.push_str(line.strip_prefix("error: ").unwrap_or(line));
    }
    sentence
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_long_line_its_start_and_its_end_are_printed() {
        assert!(matches!(shorten_lines(&"x".repeat(MAX_CHARS)), Cow::Borrowed(_)));
        let name = "ä".repeat(50_000);
        let text = format!("short\nrgb.txt:7: {name}.png is missing\n");
        let lines: Vec<String> = shorten_lines(&text).lines().map(str::to_owned).collect();
        assert_eq!((lines.len(), lines[0].as_str()), (2, "short"));
        assert!(lines[1].starts_with("rgb.txt:7: ää") && lines[1].ends_with("ä.png is missing"), "{}", lines[1]);
        assert!(lines[1].contains("ä ... (49026 characters) ... ä"), "{}", lines[1]);
        assert!(lines[1].chars().count() < MAX_CHARS + 40);
        assert!(text.ends_with('\n') && shorten_lines(&text).ends_with('\n'));
    }

    #[test]
    fn what_a_terminal_would_obey_is_spelt_out() {
        assert_eq!(escape_controls("a\x1b[2Jb\u{9b}31m\r\u{202e}\n", &['\n']), "a\\u{1b}[2Jb\\u{9b}31m\\r\\u{202e}\n");
        assert_eq!(escape_controls("ä 木\n", &[]), "ä 木\\n");
        assert!(matches!(escape_controls("plain ünïcode", &[]), Cow::Borrowed(_)));
    }
}
