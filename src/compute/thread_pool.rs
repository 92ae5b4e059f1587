//! The thread pool: a fixed number of threads that share the parts of one pass at a time.
//!
//! A pass is over when every part is done; sleeping members are not waited for. Nothing is allocated and no lock is
//! taken. It needs `unsafe` because the threads outlive the borrow of the work they run; `run_members` guarantees that
//! they never use it afterwards, even after a panic.
#![allow(unsafe_code)]

pub mod relay;

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle, Thread};

/// One part of a pass: called with the numbers of the member and of the part.
type Work<'a> = &'a (dyn Fn(usize, usize) + Sync + 'a);

/// The threads of the pool. The thread that calls [`ThreadPool::run`] is member 0.
pub struct ThreadPool {
    shared: Arc<Shared>,
    members: Vec<JoinHandle<()>>,
}

struct Shared {
    /// `epoch << 16 | open << 15 | members at work`. Opening a pass increments the epoch.
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

/// Start of an array of scratch memory or items.
struct Base<S>(*mut S);

// SAFETY: only returns addresses; each dereference has its own argument. `S: Send` as members are other threads.
unsafe impl<S: Send> Sync for Base<S> {}

impl<S> Base<S> {
    fn at(&self, place: usize) -> *mut S {
        self.0.wrapping_add(place)
    }
}

/// Largest number of items of a pass: they are kept on the stack.
pub const MAX_ITEMS: usize = 32;
const OPEN: u64 = 1 << 15;
const AT_WORK: u64 = OPEN - 1;
const EPOCH: u64 = 1 << 16;
/// Spins before a member sleeps: about the time between two passes of a frame.
const SPINS: u32 = 4_000;

// SAFETY: `work` is written only by the thread in `run_members` (`&mut self`: there is only one) while the gate is
// closed and no member is at work, and read only by members that entered through the open gate; its release/acquire
// pairs order the two.
unsafe impl Sync for Shared {}

/// Returns the number of hardware threads, at least 1.
pub fn cores() -> usize {
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
        });
        let members = (1..threads.max(1))
            .map_while(|k| {
                let shared = Arc::clone(&shared);
                // If a thread cannot be created, the others do its share.
                thread::Builder::new().name(format!("{name}-{k}")).spawn(move || shared.run_member(k)).ok()
            })
            .collect::<Vec<_>>();
        // A starting thread allocates; afterwards nothing does.
        while shared.started.load(Ordering::Relaxed) < members.len() {
            thread::yield_now();
        }
        Self { shared, members }
    }

    /// Returns the number of threads, including the caller: fewer than requested if the system refused some.
    pub fn thread_count(&self) -> usize {
        self.members.len() + 1
    }

    /// Calls `work` once with each of `0..parts`, spread over the threads, and returns when all are done.
    ///
    /// # Panics
    /// Panics if a part panicked, after the others are done.
    pub fn run(&mut self, parts: usize, work: &(dyn Fn(usize) + Sync)) {
        self.run_members(parts, &|_, part| work(part));
    }

    /// Same as [`ThreadPool::run`], with one element of `scratch` for each thread.
    ///
    /// # Panics
    /// Panics like [`ThreadPool::run`], and if `scratch` is too short.
    pub fn run_with<S: Send>(&mut self, scratch: &mut [S], parts: usize, work: &(dyn Fn(&mut S, usize) + Sync)) {
        assert!(scratch.len() >= self.thread_count(), "every thread needs its scratch");
        let base = Base(scratch.as_mut_ptr());
        self.run_members(parts, &|member, part| {
            // SAFETY: `member` is below the pool's size, which `scratch` covers, and each member is one thread that
            // does one part at a time; so no other thread uses this element, and `scratch` is borrowed throughout.
            work(unsafe { &mut *base.at(member) }, part);
        });
    }

    /// Calls `work` once with each of at most [`MAX_ITEMS`] items, spread over the threads.
    ///
    /// # Panics
    /// Panics like [`ThreadPool::run`], and if there are more items.
    pub fn run_each<T: Send>(&mut self, items: impl Iterator<Item = T>, work: &(dyn Fn(T) + Sync)) {
        self.run_each_with(&mut [(); AT_WORK as usize], items, &|(), item| work(item));
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
        let base = Base(waiting.as_mut_ptr());
        self.run_with(scratch, count, &|scratch, part| {
            // SAFETY: `part` is below `count`, the length of `waiting`, and runs once: no other thread uses this
            // element.
            if let Some(item) = unsafe { &mut *base.at(part) }.take() {
                work(scratch, item);
            }
        });
    }

    /// Opens the gate for a pass, runs parts like a member, and returns once all are done and no member is at work.
    fn run_members(&mut self, parts: usize, work: Work<'_>) {
        if self.members.is_empty() || parts < 2 {
            return (0..parts).for_each(|part| work(0, part));
        }
        let shared = &*self.shared;
        // SAFETY: only the lifetime changes. The reference is removed from `shared.work` below, before `run_members`
        // returns and only once no member is at work; no member can enter after the gate is closed.
        let work: Work<'static> = unsafe { std::mem::transmute::<Work<'_>, Work<'static>>(work) };
        shared.next.store(0, Ordering::Relaxed);
        // SAFETY: the gate is closed and no member is at work (see the wait below), so no other thread touches the
        // cell.
        unsafe { *shared.work.get() = Some(Pass { work, parts }) };
        // Release: members that see the gate open also see the pass.
        let closed = shared.gate.load(Ordering::Relaxed);
        shared.gate.store((closed & !(EPOCH - 1)).wrapping_add(EPOCH) | OPEN, Ordering::Release);
        let helpers = self.members.iter().take(parts - 1);
        helpers.map(JoinHandle::thread).for_each(Thread::unpark);

        shared.run_parts(0, Pass { work, parts });
        shared.gate.fetch_and(!OPEN, Ordering::Relaxed);
        let mut turns = 0u32;
        // Acquire: the members' writes are visible once their leaving is.
        while shared.gate.load(Ordering::Acquire) & AT_WORK != 0 {
            turns += 1;
            if turns.is_multiple_of(64) { thread::yield_now() } else { std::hint::spin_loop() }
        }
        // SAFETY: the gate is closed and no member is at work.
        unsafe { *shared.work.get() = None };
        if shared.panicked.swap(false, Ordering::Relaxed) {
            resume_unwind(Box::new("a part of a pass panicked"));
        }
    }
}

impl Shared {
    /// Runs a member's thread: enters each pass once, if it is awake in time, until the pool is dropped.
    fn run_member(&self, member: usize) {
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
            // Acquire pairs with the release in `run_members`. A failure means that the gate changed: try again.
            if self.gate.compare_exchange(gate, gate + 1, Ordering::Acquire, Ordering::Relaxed).is_err() {
                continue;
            }
            last_epoch = gate / EPOCH;
            // SAFETY: entered through the open gate, so `run_members` neither writes the cell nor returns until this
            // member leaves.
            if let Some(pass) = unsafe { *self.work.get() } {
                self.run_parts(member, pass);
            }
            // Release: `run_members` sees this member's writes once it sees the member leave.
            self.gate.fetch_sub(1, Ordering::Release);
        }
    }

    /// Runs parts of a pass until none is left; records a panic instead of propagating it.
    fn run_parts(&self, member: usize, pass: Pass) {
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
            // Dropping the payload may panic: a member would then never leave, or `run_members` would return with
            // members at work.
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
            // A member catches its panics, and there is no caller left to report one to.
            let _ = member.join();
        }
    }
}

/// A slice in equal parts that several threads write at once: returns `&mut` slices by index. [`DisjointParts::part`]
/// is safe because each index can be taken once.
pub struct DisjointParts<'a, T> {
    base: *mut T,
    length: usize,
    each: usize,
    taken: &'a [AtomicBool],
}

// SAFETY: each part is given to one caller only (`taken`), and `T: Send` may move between threads.
unsafe impl<T: Send> Sync for DisjointParts<'_, T> {}

impl<'a, T> DisjointParts<'a, T> {
    /// Splits `data` into parts of `each` values (the last may be shorter); `taken` has a flag for every part.
    pub fn new(data: &'a mut [T], each: usize, taken: &'a mut [AtomicBool]) -> Self {
        let parts = data.len().div_ceil(each.max(1));
        assert!(each > 0 && parts <= taken.len(), "a shelf needs a flag for every part");
        taken.iter_mut().for_each(|flag| *flag.get_mut() = false);
        Self { base: data.as_mut_ptr(), length: data.len(), each, taken }
    }

    /// Returns the part `index`.
    ///
    /// # Panics
    /// Panics if it is taken a second time, or beyond the end.
    #[allow(clippy::mut_from_ref)]
    pub fn part(&self, index: usize) -> &mut [T] {
        // An overflowing product would be the start of another part.
        let start = index.checked_mul(self.each).filter(|&start| start < self.length);
        let Some(start) = start.filter(|_| !self.taken[index].swap(true, Ordering::Relaxed)) else {
            panic!("each part is taken once");
        };
        let length = self.each.min(self.length - start);
        // SAFETY: inside the allocation, which is borrowed for `'a`; parts do not overlap and each is returned once.
        unsafe { std::slice::from_raw_parts_mut(self.base.add(start), length) }
    }
}

#[cfg(test)]
mod tests;
