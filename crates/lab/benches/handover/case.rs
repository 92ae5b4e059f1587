//! The cases of the bench, and one turn of each.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use bokehcam::link::live;

use super::locked::Locked;

/// How the link is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Case {
    /// Items at the rate of a camera; the reader sleeps in between
    Paced,
    /// Items one after another; the reader takes what it can
    FullSpeed,
    /// 1000 items a second; the reader, of the lowest priority, looks again and again and never sleeps
    Polled,
}

const POLLED_RATE: u32 = 1000;
/// At full speed, one send and one hand-over in this number is recorded.
const SAMPLING_INTERVAL: u64 = 64;
/// Niceness of the reader in [`Case::Polled`].
const LOWEST_PRIORITY: i32 = 19;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// This project's link.
    LockFree,
    /// The link with a mutex.
    Locked,
}

/// Times in nanoseconds.
#[derive(Default)]
pub struct Times {
    pub sent: u64,
    pub hand_over_ns: Vec<u64>,
    pub send_ns: Vec<u64>,
}

/// The item handed over: about as large as a frame's handles.
struct Item {
    sent: Instant,
    last: bool,
    _handles: [u64; 12],
}

/// Measures for `time`, and adds to `times`.
pub fn measure_turn(case: Case, link: Link, rate: u32, time: Duration, times: &mut Times) {
    match link {
        Link::LockFree => {
            let (mut to, mut from) = live();
            let send = move |item| _ = to.send(item);
            if case == Case::Polled {
                run(case, rate, time, times, send, move || poll_until_some(|| from.try_recv()));
            } else {
                run(case, rate, time, times, send, move || from.recv().expect("an item, until the last"));
            }
        }
        Link::Locked => {
            let (to, from) = Locked::pair();
            let send = move |item| _ = to.send(item);
            if case == Case::Polled {
                run(case, rate, time, times, send, move || poll_until_some(|| from.try_recv()));
            } else {
                run(case, rate, time, times, send, move || from.recv());
            }
        }
    }
}

fn poll_until_some(mut look: impl FnMut() -> Option<Item>) -> Item {
    loop {
        if let Some(item) = look() {
            return item;
        }
    }
}

fn run(
    case: Case,
    rate: u32,
    time: Duration,
    times: &mut Times,
    mut send: impl FnMut(Item),
    mut receive: impl FnMut() -> Item + Send,
) {
    let (period, interval) = match case {
        Case::Paced => (Some(Duration::from_secs(1) / rate), 1),
        Case::FullSpeed => (None, SAMPLING_INTERVAL),
        Case::Polled => (Some(Duration::from_secs(1) / POLLED_RATE), 1),
    };
    let Times { sent, hand_over_ns, send_ns } = times;
    thread::scope(|scope| {
        scope.spawn(move || {
            if case == Case::Polled {
                yield_to_all();
            }
            let mut received = 0;
            loop {
                let item = receive();
                let took = item.sent.elapsed();
                if received % interval == 0 {
                    hand_over_ns.push(took.as_nanos() as u64);
                }
                received += 1;
                if item.last {
                    break;
                }
            }
        });
        let began = Instant::now();
        let mut due = began;
        let mut slowest = Duration::ZERO;
        for number in 0.. {
            if let Some(period) = period {
                due += period;
                thread::sleep(due.saturating_duration_since(Instant::now()));
            }
            let sent_at = Instant::now();
            let last = sent_at - began >= time;
            send(Item { sent: sent_at, last, _handles: [number; 12] });
            let took = sent_at.elapsed();
            slowest = slowest.max(took);
            if number % interval == 0 {
                send_ns.push(took.as_nanos() as u64);
            }
            if last {
                *sent += number + 1;
                break;
            }
        }
        // The slowest send is always recorded.
        send_ns.push(slowest.as_nanos() as u64);
    });
}

/// Gives this thread the lowest priority, so that it is suspended wherever it happens to be.
fn yield_to_all() {
    let thread = Some(rustix::thread::gettid());
    if let Err(error) = rustix::process::setpriority_process(thread, LOWEST_PRIORITY) {
        eprintln!("handover: the reader keeps its priority: {error}");
    }
}

/// Threads that keep cores busy until this is dropped.
pub struct Load {
    over: std::sync::Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<u64>>,
}

impl Load {
    pub fn new(threads: usize) -> Self {
        let over = std::sync::Arc::new(AtomicBool::new(false));
        let busy = |over: std::sync::Arc<AtomicBool>| {
            move || {
                let mut sum = 1_u64;
                while !over.load(Ordering::Relaxed) {
                    (0..1000).for_each(|i| sum = sum.wrapping_mul(31).rotate_left(7) ^ i);
                }
                std::hint::black_box(sum)
            }
        };
        Self { threads: (0..threads).map(|_| thread::spawn(busy(over.clone()))).collect(), over }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}
