//! The thread pool: a fixed number of threads that share out the parts of one pass at a time.
//!
//! A pass is over when every part is done; a member that sleeps through it is not waited for. Nothing is allocated
//! and no lock is taken. It needs `unsafe` because the threads outlive the borrow of the work they are handed; `run` is
//! what guarantees that they never use it afterwards, whatever panics.
#![allow(unsafe_code)]

pub mod relay;

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle, Thread};

/// One part of a pass: called with the number of the member that does it, and the part's number.
type Work<'a> = &'a (dyn Fn(usize, usize) + Sync + 'a);

/// The threads. The thread that calls [`ThreadPool::run`] works as one of them.
pub struct ThreadPool {
    shared: Arc<Shared>,
    members: Vec<JoinHandle<()>>,
}

struct Shared {
    /// `epoch << 16 | open << 15 | members at work`. Opening a pass raises the epoch.
    gate: AtomicU64,
    /// Valid from the opening of the gate until it is closed and no member is at work.
    work: UnsafeCell<Option<Pass>>,
    next: AtomicUsize,
    panicked: AtomicBool,
    stop: AtomicBool,
    started: AtomicUsize,
}

#[derive(Clone, Copy)]
struct Pass {
    work: Work<'static>,
    parts: usize,
}

/// The start of the members' scratch memory, or of items.
struct Base<S>(*mut S);

// SAFETY: only hands out addresses; who takes one argues for it. `S: Send` as members are other threads.
unsafe impl<S: Send> Sync for Base<S> {}

impl<S> Base<S> {
    fn at(&self, place: usize) -> *mut S {
        self.0.wrapping_add(place)
    }
}

/// Items of one pass, at most: they are kept on the stack.
pub const MOST_ITEMS: usize = 32;
const OPEN: u64 = 1 << 15;
const AT_WORK: u64 = OPEN - 1;
const EPOCH: u64 = 1 << 16;
/// Turns of waiting before a member goes to sleep: about as long as the gap between two passes of a frame.
const SPINS: u32 = 4_000;

// SAFETY: `work` is written only by the thread in `run` (`&mut self`: there is one) with the gate closed and nobody at
// work, and read only by members that entered through the open gate; its release/acquire pairs order the two.
unsafe impl Sync for Shared {}

/// Threads that run at once on this machine, at least 1.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

impl ThreadPool {
    /// A pool of `threads` (at least 1), the caller included; `name` is what the others are called, with a number.
    pub fn new(name: &str, threads: usize) -> Self {
        let shared = Arc::new(Shared {
            gate: AtomicU64::new(0),
            work: UnsafeCell::new(None),
            next: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            started: AtomicUsize::new(0),
        });
        let members = (1..threads.max(1))
            .map_while(|k| {
                let shared = Arc::clone(&shared);
                // Without the thread the others do its share.
                thread::Builder::new().name(format!("{name}-{k}")).spawn(move || shared.serve(k)).ok()
            })
            .collect::<Vec<_>>();
        // A thread that starts allocates; from here on nothing does.
        while shared.started.load(Ordering::Relaxed) < members.len() {
            thread::yield_now();
        }
        Self { shared, members }
    }

    /// Number of threads in the pool, the caller included: fewer than asked for where the system gave no more.
    pub fn thread_count(&self) -> usize {
        self.members.len() + 1
    }

    /// Calls `work` once with each of `0..parts`, spread over the threads, and returns when all are done.
    ///
    /// # Panics
    /// When a part panicked, after the others are done.
    pub fn run(&mut self, parts: usize, work: &(dyn Fn(usize) + Sync)) {
        self.run_members(parts, &|_, part| work(part));
    }

    /// As [`ThreadPool::run`], with scratch memory of its own for every member: `scratch` has one for each thread.
    ///
    /// # Panics
    /// As [`ThreadPool::run`], and when `scratch` is too short.
    pub fn run_with<S: Send>(&mut self, scratch: &mut [S], parts: usize, work: &(dyn Fn(&mut S, usize) + Sync)) {
        assert!(scratch.len() >= self.thread_count(), "every thread needs its scratch");
        let base = Base(scratch.as_mut_ptr());
        self.run_members(parts, &|member, part| {
            // SAFETY: `member` is below the pool's size, which `scratch` covers, and each member is one thread that
            // does one part at a time; so nobody else holds this element, and `scratch` is borrowed throughout.
            work(unsafe { &mut *base.at(member) }, part);
        });
    }

    /// Calls `work` once with each of at most [`MOST_ITEMS`] items, spread over the threads.
    ///
    /// # Panics
    /// As [`ThreadPool::run`], and when there are more items.
    pub fn run_each<T: Send>(&mut self, items: impl Iterator<Item = T>, work: &(dyn Fn(T) + Sync)) {
        self.run_each_with(&mut [(); AT_WORK as usize], items, &|(), item| work(item));
    }

    /// The same with scratch memory for every thread, as for [`ThreadPool::run_with`].
    ///
    /// # Panics
    /// As [`ThreadPool::run_with`], and when there are more items.
    pub fn run_each_with<S: Send, T: Send>(
        &mut self,
        scratch: &mut [S],
        mut items: impl Iterator<Item = T>,
        work: &(dyn Fn(&mut S, T) + Sync),
    ) {
        let mut waiting: [Option<T>; MOST_ITEMS] = std::array::from_fn(|_| items.next());
        assert!(items.next().is_none(), "more items than places");
        let count = waiting.iter().flatten().count();
        let base = Base(waiting.as_mut_ptr());
        self.run_with(scratch, count, &|scratch, part| {
            // SAFETY: `part` is below `count`, which `waiting` has, and is done once: nobody else holds this place.
            if let Some(item) = unsafe { &mut *base.at(part) }.take() {
                work(scratch, item);
            }
        });
    }

    /// Opens the gate for a pass, takes parts like a member, and returns once all are done and nobody is at work.
    fn run_members(&mut self, parts: usize, work: Work<'_>) {
        if self.members.is_empty() || parts < 2 {
            return (0..parts).for_each(|part| work(0, part));
        }
        let shared = &*self.shared;
        // SAFETY: only the lifetime changes. The reference is dropped from `shared.work` below, before `run` returns
        // and only once no member is at work; nobody can enter after the gate is closed.
        let work: Work<'static> = unsafe { std::mem::transmute::<Work<'_>, Work<'static>>(work) };
        shared.next.store(0, Ordering::Relaxed);
        // SAFETY: the gate is closed and nobody is at work (see the wait below), so nobody else touches the cell.
        unsafe { *shared.work.get() = Some(Pass { work, parts }) };
        // Release: members that see the gate open also see the pass.
        let closed = shared.gate.load(Ordering::Relaxed);
        shared.gate.store((closed & !(EPOCH - 1)).wrapping_add(EPOCH) | OPEN, Ordering::Release);
        let helpers = self.members.iter().take(parts - 1);
        helpers.map(JoinHandle::thread).for_each(Thread::unpark);

        shared.take_parts(0, Pass { work, parts });
        shared.gate.fetch_and(!OPEN, Ordering::Relaxed);
        let mut turns = 0u32;
        // Acquire: what members wrote is visible once their leaving is.
        while shared.gate.load(Ordering::Acquire) & AT_WORK != 0 {
            turns += 1;
            if turns.is_multiple_of(64) { thread::yield_now() } else { std::hint::spin_loop() }
        }
        // SAFETY: closed, and nobody at work.
        unsafe { *shared.work.get() = None };
        if shared.panicked.swap(false, Ordering::Relaxed) {
            resume_unwind(Box::new("a part of a pass panicked"));
        }
    }
}

impl Shared {
    /// What a member's thread runs: enters each pass once, if it is awake in time, until the pool is dropped.
    fn serve(&self, member: usize) {
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
                if turns < SPINS { std::hint::spin_loop() } else { thread::park() }
            };
            // Acquire pairs with the release in `run`; failing means that the gate moved: look again.
            if self.gate.compare_exchange(gate, gate + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
                continue;
            }
            last_epoch = gate / EPOCH;
            // SAFETY: entered through the open gate, so `run` neither writes the cell nor returns until we leave.
            if let Some(pass) = unsafe { *self.work.get() } {
                self.take_parts(member, pass);
            }
            // Release: `run` sees what we wrote once it sees us gone.
            self.gate.fetch_sub(1, Ordering::Release);
        }
    }

    /// Does parts of a pass until none is left; notes a panic instead of passing it on.
    fn take_parts(&self, member: usize, pass: Pass) {
        let work = AssertUnwindSafe(|| {
            loop {
                let part = self.next.fetch_add(1, Ordering::Relaxed);
                if part >= pass.parts {
                    break;
                }
                (pass.work)(member, part);
            }
        });
        if let Err(thrown) = catch_unwind(work) {
            // Dropping it may panic: a member would then never leave, or `run` would with members at work.
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
        for member in self.members.drain(..) {
            member.thread().unpark();
            // A member catches its panics, and there is nobody left to tell.
            let _ = member.join();
        }
    }
}

/// A slice in equal parts that several threads write at once, each its own: hands out `&mut` slices by index.
/// [`DisjointParts::part`] is safe because each index can be taken once.
pub struct DisjointParts<'a, T> {
    base: *mut T,
    length: usize,
    each: usize,
    taken: &'a [AtomicBool],
}

// SAFETY: a part goes to one taker only (`taken`), and `T: Send` may move between threads.
unsafe impl<T: Send> Sync for DisjointParts<'_, T> {}

impl<'a, T> DisjointParts<'a, T> {
    /// Splits `data` into parts of `each` values (the last may be shorter); `taken` has a flag for every part.
    pub fn new(data: &'a mut [T], each: usize, taken: &'a mut [AtomicBool]) -> Self {
        let parts = data.len().div_ceil(each.max(1));
        assert!(each > 0 && parts <= taken.len(), "a shelf needs a flag for every part");
        taken.iter_mut().for_each(|flag| *flag.get_mut() = false);
        Self { base: data.as_mut_ptr(), length: data.len(), each, taken }
    }

    /// The part `index`.
    ///
    /// # Panics
    /// When it is taken a second time, or beyond the end.
    #[allow(clippy::mut_from_ref)]
    pub fn part(&self, index: usize) -> &mut [T] {
        // A product that wraps would be the start of another part.
        let start = index.checked_mul(self.each).filter(|&start| start < self.length);
        let Some(start) = start.filter(|_| !self.taken[index].swap(true, Ordering::Relaxed)) else {
            panic!("each part is taken once");
        };
        let length = self.each.min(self.length - start);
        // SAFETY: inside the allocation, which `'a` keeps borrowed; parts do not overlap and each is handed out once.
        unsafe { std::slice::from_raw_parts_mut(self.base.add(start), length) }
    }
}

#[cfg(test)]
mod tests;
