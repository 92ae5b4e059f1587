//! The only writer to standard error: a thread that prints lines and draws the progress bar, so that no other thread
//! waits.
//!
//! A terminal may stall for any time (Ctrl-S, a suspended remote shell, a stopped reader of a pipe). Then only that
//! thread waits; lines queue up, and those that find the queue full are dropped and counted.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

/// Capacity of the queue, in entries.
const QUEUE_CAPACITY: usize = 1024;
/// Time between two redraws of the bar.
const REDRAW_INTERVAL: Duration = Duration::from_millis(100);
/// Maximum time that [`Screen::flush`] waits for one write.
const STALL_TIMEOUT: Duration = Duration::from_millis(400);
/// Time between two checks in [`Screen::flush`].
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Prints lines and one bar on a thread of its own.
pub struct Screen {
    /// `None` if the thread could not be started: then callers write (and wait) themselves.
    queue: Option<SyncSender<Entry>>,
    shared: Arc<Shared>,
}

/// Progress of a command, shared by the worker thread and the thread that draws the bar.
#[derive(Debug, Default)]
pub struct ProgressCount {
    done: AtomicU64,
    /// Set to remove the bar.
    is_over: AtomicBool,
}

impl ProgressCount {
    /// Sets the number of completed items.
    pub fn set(&self, done: u64) {
        self.done.store(done, Ordering::Relaxed);
    }
}

/// Message to the printing thread.
enum Entry {
    /// Complete lines, with their line ends.
    Text(Vec<u8>),
    /// Starts drawing the bar, until its count is over.
    ShowBar(ProgressBar, Arc<ProgressCount>),
    /// Removes the bar.
    RemoveBar,
}

#[derive(Default)]
struct Shared {
    /// Number of entries offered to the queue.
    sent: AtomicU64,
    /// Number of entries printed or dropped: [`Screen::flush`] waits until it reaches `sent`.
    done: AtomicU64,
    /// Number of texts dropped because the queue was full.
    lost: AtomicU64,
    /// Incremented at the start and at the end of every write: odd during a write.
    prints: AtomicU64,
}

impl Screen {
    /// Starts a thread that prints to `out`; `lost_notice` formats the line that reports the number of dropped lines.
    pub fn new(out: impl Write + Send + 'static, lost_notice: fn(u64) -> String) -> Self {
        let shared = Arc::new(Shared::default());
        let (queue, entries) = sync_channel(QUEUE_CAPACITY);
        let printer = Printer { out, lost_notice, bar: None, shared: Arc::clone(&shared) };
        let thread = thread::Builder::new().name("terminal".into()).spawn(move || printer.run(&entries));
        Self { queue: thread.is_ok().then_some(queue), shared }
    }

    /// Queues complete lines, with their line ends, or drops them if the queue is full. Never blocks.
    pub fn print(&self, lines: &[u8]) {
        match &self.queue {
            Some(_) => self.send(Entry::Text(lines.to_vec())),
            // A closed standard error is no failure.
            None => drop(io::stderr().write_all(lines)),
        }
    }

    /// Starts drawing `bar`; returns the count that it shows.
    pub fn show_bar(&self, bar: ProgressBar) -> Arc<ProgressCount> {
        let count = Arc::new(ProgressCount::default());
        if self.queue.is_some() {
            self.send(Entry::ShowBar(bar, Arc::clone(&count)));
        }
        count
    }

    /// Removes the bar that shows `count`.
    pub fn remove_bar(&self, count: &ProgressCount) {
        count.is_over.store(true, Ordering::Relaxed);
        // If the queue is full, the bar is removed with the next printed entry.
        if self.queue.is_some() {
            self.send(Entry::RemoveBar);
        }
    }

    /// Waits until everything sent so far is printed; gives up on a terminal that stalls for [`STALL_TIMEOUT`].
    pub fn flush(&self) {
        let Shared { sent, done, prints, .. } = &*self.shared;
        let last = sent.load(Ordering::Acquire);
        let mut last_change = (prints.load(Ordering::Relaxed), Instant::now());
        while done.load(Ordering::Acquire) < last {
            thread::sleep(POLL_INTERVAL);
            let now = prints.load(Ordering::Relaxed);
            if now != last_change.0 {
                last_change = (now, Instant::now());
            } else if now % 2 == 1 && last_change.1.elapsed() > STALL_TIMEOUT {
                return;
            }
        }
    }

    fn send(&self, entry: Entry) {
        let is_text = matches!(entry, Entry::Text(_));
        // Counted first, so that `flush` never returns early.
        self.shared.sent.fetch_add(1, Ordering::AcqRel);
        if self.queue.as_ref().is_none_or(|queue| queue.try_send(entry).is_err()) {
            // Dropped entries count as done, or `flush` would wait for them.
            self.shared.done.fetch_add(1, Ordering::AcqRel);
            self.shared.lost.fetch_add(u64::from(is_text), Ordering::Relaxed);
        }
    }
}

/// State of the printing thread.
struct Printer<W> {
    out: W,
    lost_notice: fn(u64) -> String,
    bar: Option<(ProgressBar, Arc<ProgressCount>)>,
    shared: Arc<Shared>,
}

impl<W: Write> Printer<W> {
    /// Prints entries until the [`Screen`] is dropped, and redraws the bar, if any, every [`REDRAW_INTERVAL`].
    fn run(mut self, entries: &Receiver<Entry>) {
        loop {
            let next = match &self.bar {
                Some(_) => entries.recv_timeout(REDRAW_INTERVAL),
                None => entries.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            if matches!(next, Err(RecvTimeoutError::Disconnected)) {
                return;
            }
            self.shared.prints.fetch_add(1, Ordering::Relaxed);
            self.handle_entry(next.ok());
            // Only after catching up, so that one notice covers all lost lines.
            if self.shared.done.load(Ordering::Acquire) == self.shared.sent.load(Ordering::Acquire) {
                self.report_lost();
            }
            self.shared.prints.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Prints an entry; `None`, after the redraw interval, redraws the bar.
    fn handle_entry(&mut self, entry: Option<Entry>) {
        if let Some((bar, _)) = self.bar.take_if(|(_, count)| count.is_over.load(Ordering::Relaxed)) {
            bar.finish_and_clear();
        }
        let was_sent = entry.is_some();
        match entry {
            Some(Entry::Text(lines)) => self.print(&lines),
            Some(Entry::ShowBar(bar, count)) => self.bar = Some((bar, count)),
            Some(Entry::RemoveBar) => {}
            None => {
                if let Some((bar, count)) = &self.bar {
                    bar.set_position(count.done.load(Ordering::Relaxed));
                    bar.tick();
                }
            }
        }
        if was_sent {
            self.shared.done.fetch_add(1, Ordering::AcqRel);
        }
    }

    /// Prints lines above the bar, and redraws the bar below them.
    fn print(&mut self, lines: &[u8]) {
        let Self { out, bar, .. } = self;
        // A closed standard error is no failure.
        let mut write = || drop(out.write_all(lines));
        match bar {
            Some((bar, _)) => bar.suspend(write),
            None => write(),
        }
    }

    /// Prints the number of lines dropped since the last notice.
    fn report_lost(&mut self) {
        let lost = self.shared.lost.swap(0, Ordering::Relaxed);
        if lost > 0 {
            self.print((self.lost_notice)(lost).as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Condvar, Mutex};

    use super::*;

    /// A terminal that stalls until it is resumed.
    #[derive(Clone, Default)]
    struct StalledTerminal(Arc<TerminalState>);

    #[derive(Default)]
    struct TerminalState {
        /// Whether it accepts text, and the text so far.
        state: Mutex<(bool, Vec<u8>)>,
        resumed: Condvar,
    }

    impl StalledTerminal {
        fn resume(&self) {
            self.0.state.lock().unwrap().0 = true;
            self.0.resumed.notify_all();
        }

        fn text(&self) -> String {
            String::from_utf8(self.0.state.lock().unwrap().1.clone()).unwrap()
        }
    }

    impl Write for StalledTerminal {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let TerminalState { state, resumed } = &*self.0;
            let mut state = resumed.wait_while(state.lock().unwrap(), |(accepts, _)| !*accepts).unwrap();
            state.1.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn nobody_waits_for_a_terminal_that_takes_nothing() {
        let terminal = StalledTerminal::default();
        let screen = Screen::new(terminal.clone(), |lines| format!("{lines} lines are missing\n"));
        let count = screen.show_bar(ProgressBar::hidden());
        let lines = 2 * QUEUE_CAPACITY;
        for line in 0..lines {
            screen.print(format!("{line}\n").as_bytes());
            count.set(line as u64);
        }
        screen.flush();
        screen.remove_bar(&count);
        assert_eq!(terminal.text(), "");

        terminal.resume();
        screen.flush();
        screen.print(b"the last\n");
        screen.flush();
        let text = terminal.text();
        let (printed, missing): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| !line.contains("missing"));
        let numbers: Vec<usize> = printed.iter().filter_map(|line| line.parse().ok()).collect();
        assert!(numbers.is_sorted() && numbers.first() == Some(&0) && printed.last() == Some(&"the last"), "{text}");
        let [missing] = missing[..] else { panic!("{text}") };
        let missing: usize = missing.split(' ').next().and_then(|count| count.parse().ok()).unwrap();
        assert_eq!(numbers.len() + missing, lines, "every line is printed or counted");
    }

    #[test]
    fn all_is_printed_in_order_once_it_is_flushed() {
        let terminal = StalledTerminal::default();
        terminal.resume();
        let screen = Screen::new(terminal.clone(), |lines| format!("{lines} lines are missing\n"));
        let count = screen.show_bar(ProgressBar::hidden());
        (0..500).for_each(|line| screen.print(format!("{line}\n").as_bytes()));
        screen.remove_bar(&count);
        screen.print(b"end\n");
        screen.flush();
        let expected: String = (0..500).map(|line| format!("{line}\n")).chain(["end\n".to_owned()]).collect();
        assert_eq!(terminal.text(), expected);
    }
}
