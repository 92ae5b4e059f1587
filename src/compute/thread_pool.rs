//! The thread pool: a fixed number of threads that share the parts of one pass at a time.
//!
//! A pass is over when every part is done; sleeping workers are not waited for. Nothing is allocated and no lock is
//! taken. It needs `unsafe` because the threads outlive the borrow of the work they run; `run_workers` guarantees that
//! they never use it afterwards, even after a panic.
#![allow(unsafe_code)]

mod placement;
pub mod wavefront;

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle, Thread};

use placement::{Placement, current_cpu};

/// One part of a pass: called with the numbers of the worker and of the part.
type Work<'a> = &'a (dyn Fn(usize, usize) + Sync + 'a);

/// The threads of the pool. The thread that calls [`ThreadPool::run`] is worker 0.
pub struct ThreadPool {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
}

struct Shared {
    /// `epoch << 16 | open << 15 | caller sleeps << 14 | workers at work`. Opening a pass increments the epoch.
    gate: AtomicU64,
    /// Valid from the opening of the gate until it is closed and no worker is at work.
    work: UnsafeCell<Option<Pass>>,
    next: AtomicUsize,
    panicked: AtomicBool,
    stop: AtomicBool,
    started: AtomicUsize,
    /// Of each worker but the caller.
    placements: Box<[Placement]>,
}

#[derive(Clone)]
struct Pass {
    work: Work<'static>,
    parts: usize,
    /// Woken by the last worker if it sleeps.
    caller: Thread,
}

/// Start of an array of scratch memory or items.
struct BasePtr<S>(*mut S);

// SAFETY: only returns addresses; each dereference has its own argument. `S: Send` as workers are other threads.
unsafe impl<S: Send> Sync for BasePtr<S> {}

impl<S> BasePtr<S> {
    fn at(&self, place: usize) -> *mut S {
        self.0.wrapping_add(place)
    }
}

/// Largest number of items of a pass: they are kept on the stack.
pub const MAX_ITEMS: usize = 32;
const OPEN: u64 = 1 << 15;
const CALLER_SLEEPS: u64 = 1 << 14;
const WORKERS_MASK: u64 = CALLER_SLEEPS - 1;
const EPOCH: u64 = 1 << 16;
/// Spins before a worker sleeps: about the time between two passes of a frame.
const SPINS: u32 = 4_000;
/// Spins before the caller sleeps until the last worker leaves a pass: about as long as it takes to sleep and wake up.
const CALLER_SPINS: u32 = 200;

// SAFETY: `work` is written only by the thread in `run_workers` (`&mut self`: there is only one) while the gate is
// closed and no worker is at work, and read only by workers that entered through the open gate; its release/acquire
// pairs order the two.
unsafe impl Sync for Shared {}

/// Returns the number of hardware threads, at least 1.
pub fn core_count() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

impl ThreadPool {
    /// Creates a pool of `threads` (at least 1), including the caller; the others are named `name` plus a number.
    pub fn new(name: &str, threads: usize) -> Self {
        let shared = Arc::new(Shared {
            gate: AtomicU64::new(0),
            work: UnsafeCell::new(None),
            next: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            started: AtomicUsize::new(0),
            placements: (1..threads.max(1)).map(|_| Placement::new()).collect(),
        });
        let workers = (1..threads.max(1))
            .map_while(|k| {
                let shared = Arc::clone(&shared);
                // If a thread cannot be created, the others do its share.
                thread::Builder::new().name(format!("{name}-{k}")).spawn(move || shared.run_worker(k)).ok()
            })
            .collect::<Vec<_>>();
        // A starting thread allocates; afterwards nothing does.
        while shared.started.load(Ordering::Relaxed) < workers.len() {
            thread::yield_now();
        }
        Self { shared, workers }
    }

    /// Returns the number of threads, including the caller: fewer than requested if the system refused some.
    pub fn thread_count(&self) -> usize {
        self.workers.len() + 1
    }

    /// Calls `work` once with each of `0..parts`, spread over the threads, and returns when all are done.
    ///
    /// # Panics
    /// Panics if a part panicked, after the others are done.
    pub fn run(&mut self, parts: usize, work: &(dyn Fn(usize) + Sync)) {
        self.run_workers(parts, &|_, part| work(part));
    }

    /// Same as [`ThreadPool::run`], with one element of `scratch` for each thread.
    ///
    /// # Panics
    /// Panics like [`ThreadPool::run`], and if `scratch` is too short.
    pub fn run_with<S: Send>(&mut self, scratch: &mut [S], parts: usize, work: &(dyn Fn(&mut S, usize) + Sync)) {
        assert!(scratch.len() >= self.thread_count(), "every thread needs its scratch");
        let base = BasePtr(scratch.as_mut_ptr());
        self.run_workers(parts, &|worker, part| {
            // SAFETY: `worker` is below the pool's size, which `scratch` covers, and each worker is one thread that
            // does one part at a time; so no other thread uses this element, and `scratch` is borrowed throughout.
            work(unsafe { &mut *base.at(worker) }, part);
        });
    }

    /// Calls `work` once with each of at most [`MAX_ITEMS`] items, spread over the threads.
    ///
    /// # Panics
    /// Panics like [`ThreadPool::run`], and if there are more items.
    pub fn run_each<T: Send>(&mut self, items: impl Iterator<Item = T>, work: &(dyn Fn(T) + Sync)) {
        self.run_each_with(&mut [(); WORKERS_MASK as usize], items, &|(), item| work(item));
    }

    /// Same as [`Self::run_each`], with one element of `scratch` for each thread ([`ThreadPool::run_with`]).
    ///
    /// # Panics
    /// Panics like [`ThreadPool::run_with`], and if there are more items.
    pub fn run_each_with<S: Send, T: Send>(
        &mut self,
        scratch: &mut [S],
        mut items: impl Iterator<Item = T>,
        work: &(dyn Fn(&mut S, T) + Sync),
    ) {
        let mut waiting: [Option<T>; MAX_ITEMS] = std::array::from_fn(|_| items.next());
        assert!(items.next().is_none(), "more items than places");
        let count = waiting.iter().flatten().count();
        let base = BasePtr(waiting.as_mut_ptr());
        self.run_with(scratch, count, &|scratch, part| {
            // SAFETY: `part` is below `count`, the length of `waiting`, and runs once: no other thread uses this
            // element.
            if let Some(item) = unsafe { &mut *base.at(part) }.take() {
                work(scratch, item);
            }
        });
    }

    /// Opens the gate for a pass, runs parts like a worker, and returns once all are done and no worker is at work.
    fn run_workers(&mut self, parts: usize, work: Work<'_>) {
        if self.workers.is_empty() || parts < 2 {
            return (0..parts).for_each(|part| work(0, part));
        }
        let shared = &*self.shared;
        // SAFETY: only the lifetime changes. The reference is removed from `shared.work` below, before `run_workers`
        // returns and only once no worker is at work; no worker can enter after the gate is closed.
        let work: Work<'static> = unsafe { std::mem::transmute::<Work<'_>, Work<'static>>(work) };
        shared.next.store(0, Ordering::Relaxed);
        let pass = Pass { work, parts, caller: thread::current() };
        // SAFETY: the gate is closed and no worker is at work (see the wait below), so no other thread touches the
        // cell.
        unsafe { *shared.work.get() = Some(pass.clone()) };
        let own = current_cpu();
        shared.placements.iter().take(parts - 1).for_each(|placement| placement.keep_off(own));
        // Release: workers that see the gate open also see the pass.
        let closed = shared.gate.load(Ordering::Relaxed);
        shared.gate.store((closed & !(EPOCH - 1)).wrapping_add(EPOCH) | OPEN, Ordering::Release);
        self.workers.iter().take(parts - 1).for_each(|worker| worker.thread().unpark());

        shared.run_parts(0, &pass);
        shared.gate.fetch_and(!OPEN, Ordering::Relaxed);
        let mut turns = 0;
        // Acquire: the workers' writes are visible once their leaving is.
        while shared.gate.load(Ordering::Acquire) & WORKERS_MASK != 0 {
            turns += 1;
            if turns < CALLER_SPINS {
                std::hint::spin_loop();
            } else if shared.gate.fetch_or(CALLER_SLEEPS, Ordering::Relaxed) & WORKERS_MASK != 0 {
                // The last worker to leave sees the bit.
                thread::park();
            }
        }
        // SAFETY: the gate is closed and no worker is at work.
        unsafe { *shared.work.get() = None };
        if shared.panicked.swap(false, Ordering::Relaxed) {
            resume_unwind(Box::new("a part of a pass panicked"));
        }
    }
}

impl Shared {
    /// Runs a worker's thread: enters each pass once, if it is awake in time, until the pool is dropped.
    fn run_worker(&self, worker: usize) {
        let placement = &self.placements[worker - 1];
        placement.start();
        self.started.fetch_add(1, Ordering::Relaxed);
        let mut last_epoch = 0;
        loop {
            let mut turns = 0;
            let gate = loop {
                if self.stop.load(Ordering::Relaxed) {
                    return;
                }
                let gate = self.gate.load(Ordering::Relaxed);
                if gate & OPEN != 0 && gate / EPOCH != last_epoch {
                    break gate;
                }
                turns += 1;
                if turns < SPINS { std::hint::spin_loop() } else { placement.sleep() }
            };
            // Acquire pairs with the release in `run_workers`. A failure means that the gate changed: try again.
            if self.gate.compare_exchange(gate, gate + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
                continue;
            }
            last_epoch = gate / EPOCH;
            placement.allow_again();
            // SAFETY: entered through the open gate, so `run_workers` neither writes the cell nor returns until this
            // worker leaves.
            let pass = unsafe { (*self.work.get()).clone() };
            let caller = pass.map(|pass| {
                self.run_parts(worker, &pass);
                pass.caller
            });
            // Release: `run_workers` sees this worker's writes once it sees the worker leave.
            let before = self.gate.fetch_sub(1, Ordering::Release);
            if before & (CALLER_SLEEPS | WORKERS_MASK) == CALLER_SLEEPS | 1 {
                caller.iter().for_each(Thread::unpark);
            }
        }
    }

    /// Runs parts of a pass until none is left; records a panic instead of propagating it. The parts after one that
    /// panicked are run, too: the other workers may be asleep.
    fn run_parts(&self, worker: usize, pass: &Pass) {
        loop {
            let part = self.next.fetch_add(1, Ordering::Relaxed);
            if part >= pass.parts {
                break;
            }
            let Err(thrown) = catch_unwind(AssertUnwindSafe(|| (pass.work)(worker, part))) else { continue };
            // Dropping the payload may panic: a worker would then never leave, or `run_workers` would return with
            // workers at work.
            if let Err(again) = catch_unwind(AssertUnwindSafe(|| drop(thrown))) {
                std::mem::forget(again);
            }
            self.panicked.store(true, Ordering::Relaxed);
        }
    }
}

impl Drop for ThreadPool {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        for worker in self.workers.drain(..) {
            worker.thread().unpark();
            // A worker catches its panics, and there is no caller left to report one to.
            let _ = worker.join();
        }
    }
}

/// A slice in equal parts that several threads write at once: returns `&mut` slices by index. [`DisjointParts::part`]
/// is safe because each index can be taken once.
pub struct DisjointParts<'a, T> {
    base: *mut T,
    length: usize,
    part_len: usize,
    taken: &'a [AtomicBool],
}

// SAFETY: each part is given to one caller only (`taken`), and `T: Send` may move between threads.
unsafe impl<T: Send> Sync for DisjointParts<'_, T> {}

impl<'a, T> DisjointParts<'a, T> {
    /// Splits `data` into parts of `part_len` values (the last may be shorter); `taken` has a flag for every part.
    pub fn new(data: &'a mut [T], part_len: usize, taken: &'a mut [AtomicBool]) -> Self {
        let parts = data.len().div_ceil(part_len.max(1));
        assert!(part_len > 0 && parts <= taken.len(), "a shelf needs a flag for every part");
        taken.iter_mut().for_each(|flag| *flag.get_mut() = false);
        Self { base: data.as_mut_ptr(), length: data.len(), part_len, taken }
    }

    /// Returns the part `index`.
    ///
    /// # Panics
    /// Panics if it is taken a second time, or beyond the end.
    #[allow(clippy::mut_from_ref)]
    pub fn part(&self, index: usize) -> &mut [T] {
        // An overflowing product would be the start of another part.
        let start = index.checked_mul(self.part_len).filter(|&start| start < self.length);
        let Some(start) = start.filter(|_| !self.taken[index].swap(true, Ordering::Relaxed)) else {
            panic!("each part is taken once");
        };
        let length = self.part_len.min(self.length - start);
        // SAFETY: inside the allocation, which is borrowed for `'a`; parts do not overlap and each is returned once.
        unsafe { std::slice::from_raw_parts_mut(self.base.add(start), length) }
    }
}

#[cfg(test)]
mod tests;
