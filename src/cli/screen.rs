//! The one way to standard error: a thread that prints lines and draws the bar, so that nobody else waits for a terminal.
//!
//! A terminal may stop taking text for as long as it likes (Ctrl-S, a suspended remote shell, a reader of a pipe that
//! stands still). Then that thread alone waits; lines queue up, and those for which there is no room are counted.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

/// Lines that may wait.
const ROOM: usize = 1024;
/// Time from one picture of the bar to the next.
const DRAW: Duration = Duration::from_millis(100);
/// A write that takes longer than this is not waited for at the end.
const PATIENCE: Duration = Duration::from_millis(400);
/// How often is looked whether everything is printed.
const GLANCE: Duration = Duration::from_millis(2);

/// Prints lines and one bar on a thread of its own.
pub struct Screen {
    to: Option<SyncSender<Entry>>,
    shared: Arc<Shared>,
}

/// How far a command is: written by who does the work, read by who draws it.
#[derive(Debug, Default)]
pub struct Count {
    done: AtomicU64,
    over: AtomicBool,
}

impl Count {
    /// So many are done.
    pub fn set(&self, done: u64) {
        self.done.store(done, Ordering::Relaxed);
    }
}

enum Entry {
    /// Whole lines, with their ends.
    Text(Vec<u8>),
    /// Draws this from now on, until the count is over.
    Bar(ProgressBar, Arc<Count>),
    /// The bar's count is over.
    NoBar,
}

#[derive(Default)]
struct Shared {
    /// Entries that were accepted.
    sent: AtomicU64,
    /// Entries that are done with.
    done: AtomicU64,
    /// Lines for which there was no room.
    lost: AtomicU64,
    /// Odd while something is being printed, counted up at its beginning and its end.
    prints: AtomicU64,
}

impl Screen {
    /// Prints to `out`; `missing` is the line that tells how many lines found no room. Where the system has no thread for
    /// that, nothing is queued, and who prints waits.
    pub fn new(out: impl Write + Send + 'static, missing: fn(u64) -> String) -> Self {
        let shared = Arc::new(Shared::default());
        let (to, from) = sync_channel(ROOM);
        let printer = Printer { out, missing, bar: None, shared: Arc::clone(&shared) };
        let thread = thread::Builder::new().name("terminal".into()).spawn(move || printer.run(&from));
        Self { to: thread.is_ok().then_some(to), shared }
    }

    /// Prints whole lines, with their ends, unless too many wait already. Never waits.
    pub fn print(&self, lines: &[u8]) {
        match &self.to {
            Some(_) => self.send(Entry::Text(lines.to_vec())),
            // What cannot be told to anybody is no reason to fail.
            None => drop(io::stderr().write_all(lines)),
        }
    }

    /// Draws a bar from now on; gives back what it shows.
    pub fn begin(&self, bar: ProgressBar) -> Arc<Count> {
        let count = Arc::new(Count::default());
        if self.to.is_some() {
            self.send(Entry::Bar(bar, Arc::clone(&count)));
        }
        count
    }

    /// Removes the bar that shows this.
    pub fn end(&self, count: &Count) {
        count.over.store(true, Ordering::Relaxed);
        // Without room for it, it is seen with the next entry.
        if self.to.is_some() {
            self.send(Entry::NoBar);
        }
    }

    /// Waits until everything is printed, but not for a terminal that takes nothing.
    pub fn flush(&self) {
        let Shared { sent, done, prints, .. } = &*self.shared;
        let last = sent.load(Ordering::Acquire);
        let mut stands = (prints.load(Ordering::Relaxed), Instant::now());
        while done.load(Ordering::Acquire) < last {
            thread::sleep(GLANCE);
            let print = prints.load(Ordering::Relaxed);
            if print != stands.0 {
                stands = (print, Instant::now());
            } else if print % 2 == 1 && stands.1.elapsed() > PATIENCE {
                return;
            }
        }
    }

    fn send(&self, entry: Entry) {
        let is_text = matches!(entry, Entry::Text(_));
        // Counted first, so that `flush` never believes too early that everything is printed.
        self.shared.sent.fetch_add(1, Ordering::AcqRel);
        if self.to.as_ref().is_none_or(|to| to.try_send(entry).is_err()) {
            self.shared.done.fetch_add(1, Ordering::AcqRel);
            self.shared.lost.fetch_add(u64::from(is_text), Ordering::Relaxed);
        }
    }
}

/// What the thread has.
struct Printer<W> {
    out: W,
    missing: fn(u64) -> String,
    bar: Option<(ProgressBar, Arc<Count>)>,
    shared: Arc<Shared>,
}

impl<W: Write> Printer<W> {
    fn run(mut self, from: &Receiver<Entry>) {
        loop {
            let next = match &self.bar {
                Some(_) => from.recv_timeout(DRAW),
                None => from.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            if matches!(next, Err(RecvTimeoutError::Disconnected)) {
                return;
            }
            self.shared.prints.fetch_add(1, Ordering::Relaxed);
            self.take(next.ok());
            if self.shared.done.load(Ordering::Acquire) == self.shared.sent.load(Ordering::Acquire) {
                self.own_up();
            }
            self.shared.prints.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Prints an entry, or where there is none, draws the bar again.
    fn take(&mut self, entry: Option<Entry>) {
        if let Some((bar, _)) = self.bar.take_if(|(_, count)| count.over.load(Ordering::Relaxed)) {
            bar.finish_and_clear();
        }
        let waited_for = entry.is_some();
        match entry {
            Some(Entry::Text(lines)) => self.print(&lines),
            Some(Entry::Bar(bar, count)) => self.bar = Some((bar, count)),
            Some(Entry::NoBar) => {}
            None => {
                if let Some((bar, count)) = &self.bar {
                    bar.set_position(count.done.load(Ordering::Relaxed));
                    bar.tick();
                }
            }
        }
        if waited_for {
            self.shared.done.fetch_add(1, Ordering::AcqRel);
        }
    }

    /// Prints lines where the bar was; it comes again below them.
    fn print(&mut self, lines: &[u8]) {
        let Self { out, bar, .. } = self;
        // A closed standard error is no reason to fail.
        let mut write = || drop(out.write_all(lines));
        match bar {
            Some((bar, _)) => bar.suspend(write),
            None => write(),
        }
    }

    /// Tells of lines for which there was no room.
    fn own_up(&mut self) {
        let lost = self.shared.lost.swap(0, Ordering::Relaxed);
        if lost > 0 {
            self.print((self.missing)(lost).as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Condvar, Mutex};

    use super::*;

    /// A terminal that takes nothing until it is told to.
    #[derive(Clone, Default)]
    struct Stopped(Arc<Taking>);

    #[derive(Default)]
    struct Taking {
        /// Whether it takes anything, and what it took.
        state: Mutex<(bool, Vec<u8>)>,
        told: Condvar,
    }

    impl Stopped {
        fn go_on(&self) {
            self.0.state.lock().unwrap().0 = true;
            self.0.told.notify_all();
        }

        fn text(&self) -> String {
            String::from_utf8(self.0.state.lock().unwrap().1.clone()).unwrap()
        }
    }

    impl Write for Stopped {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let Taking { state, told } = &*self.0;
            let mut state = told.wait_while(state.lock().unwrap(), |(goes, _)| !*goes).unwrap();
            state.1.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn nobody_waits_for_a_terminal_that_takes_nothing() {
        let terminal = Stopped::default();
        let screen = Screen::new(terminal.clone(), |lines| format!("{lines} lines are missing\n"));
        let count = screen.begin(ProgressBar::hidden());
        let lines = 2 * ROOM;
        for line in 0..lines {
            screen.print(format!("{line}\n").as_bytes());
            count.set(line as u64);
        }
        screen.flush();
        screen.end(&count);
        assert_eq!(terminal.text(), "");

        terminal.go_on();
        screen.flush();
        screen.print(b"the last\n");
        screen.flush();
        let text = terminal.text();
        let (told, missing): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| !line.contains("missing"));
        let numbers: Vec<usize> = told.iter().filter_map(|line| line.parse().ok()).collect();
        assert!(numbers.is_sorted() && numbers.first() == Some(&0) && told.last() == Some(&"the last"), "{text}");
        let [missing] = missing[..] else { panic!("{text}") };
        let missing: usize = missing.split(' ').next().and_then(|count| count.parse().ok()).unwrap();
        assert_eq!(numbers.len() + missing, lines, "every line is printed or counted");
    }

    #[test]
    fn all_is_printed_in_order_once_it_is_flushed() {
        let terminal = Stopped::default();
        terminal.go_on();
        let screen = Screen::new(terminal.clone(), |lines| format!("{lines} lines are missing\n"));
        let count = screen.begin(ProgressBar::hidden());
        (0..500).for_each(|line| screen.print(format!("{line}\n").as_bytes()));
        screen.end(&count);
        screen.print(b"end\n");
        screen.flush();
        let expected: String = (0..500).map(|line| format!("{line}\n")).chain(["end\n".to_owned()]).collect();
        assert_eq!(terminal.text(), expected);
    }
}
