//! On which CPU a worker wakes up.
//!
//! Linux wakes a thread on the CPU where it went to sleep. If that one is busy, it looks for another only while the CPUs
//! that share a cache are not much in use (the scheduler's `SIS_UTIL`), and otherwise takes the CPU of the caller. There
//! the worker waits behind the caller for milliseconds, beside a CPU that is idle a moment later. So the caller excludes
//! its own CPU from those of a sleeping worker before it wakes it, and the worker allows it again once it runs.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering};
use std::thread;

use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// No CPU.
const NONE: u32 = u32::MAX;

/// The CPUs of one worker. Errors of the system are ignored: the worker then wakes up wherever Linux puts it.
pub(super) struct Placement {
    /// 0 until the worker has started.
    thread_id: AtomicI32,
    is_asleep: AtomicBool,
    /// Excluded by the caller, and to be allowed again by the worker.
    excluded: AtomicU32,
}

/// Returns the CPU of the calling thread.
pub(super) fn current_cpu() -> u32 {
    // Miri has no scheduler.
    if cfg!(miri) { NONE } else { sched_getcpu() as u32 }
}

impl Placement {
    pub(super) fn new() -> Self {
        Self { thread_id: AtomicI32::new(0), is_asleep: AtomicBool::new(false), excluded: AtomicU32::new(NONE) }
    }

    /// Called by the worker when it starts.
    pub(super) fn start(&self) {
        if !cfg!(miri) {
            self.thread_id.store(gettid().as_raw_nonzero().get(), Ordering::Relaxed);
        }
    }

    /// Sleeps until the caller wakes the thread.
    pub(super) fn sleep(&self) {
        self.is_asleep.store(true, Ordering::Relaxed);
        thread::park();
        self.is_asleep.store(false, Ordering::Relaxed);
    }

    /// Called by the caller on the CPU `own` before it wakes the worker, while no worker is in a pass.
    pub(super) fn keep_off(&self, own: u32) {
        if !self.is_asleep.load(Ordering::Relaxed) || own as usize >= CpuSet::MAX_CPU {
            return;
        }
        let Some(thread) = Pid::from_raw(self.thread_id.load(Ordering::Relaxed)) else { return };
        let Ok(mut allowed) = sched_getaffinity(Some(thread)) else { return };
        // Of an earlier pass that the worker slept through.
        let before = self.excluded.load(Ordering::Relaxed);
        if before != NONE {
            allowed.set(before as usize);
        }
        if allowed.is_set(own as usize) && allowed.count() > 1 {
            allowed.unset(own as usize);
            if sched_setaffinity(Some(thread), &allowed).is_ok() {
                self.excluded.store(own, Ordering::Relaxed);
            }
        }
    }

    /// Called by the worker when it enters a pass.
    pub(super) fn allow_again(&self) {
        let excluded = self.excluded.load(Ordering::Relaxed);
        if excluded == NONE {
            return;
        }
        self.excluded.store(NONE, Ordering::Relaxed);
        // Read again, as another program may have changed it meanwhile.
        if let Ok(mut allowed) = sched_getaffinity(None) {
            allowed.set(excluded as usize);
            let _ = sched_setaffinity(None, &allowed);
        }
    }
}

#[cfg(all(test, not(miri)))]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::super::ThreadPool;
    use super::*;

    #[test]
    fn a_worker_never_wakes_up_on_the_callers_cpu_and_may_use_all_afterwards() {
        let all = sched_getaffinity(None).unwrap();
        let mut pool = ThreadPool::new("test", 2);
        for own in (0..CpuSet::MAX_CPU).filter(|&cpu| all.is_set(cpu)).take(4) {
            let mut only = CpuSet::new();
            only.set(own);
            sched_setaffinity(None, &only).unwrap();
            while !pool.shared.placements[0].is_asleep.load(Ordering::Relaxed) {
                thread::yield_now();
            }
            let (begun, caller) = (AtomicUsize::new(0), thread::current().id());
            pool.run(2, &|_| {
                // Each part waits for the other, so that the worker has to do one.
                begun.fetch_add(1, Ordering::Relaxed);
                while begun.load(Ordering::Relaxed) < 2 {
                    thread::yield_now();
                }
                if thread::current().id() != caller {
                    assert!(current_cpu() as usize != own || all.count() == 1);
                    assert!(sched_getaffinity(None).unwrap() == all);
                }
            });
        }
        sched_setaffinity(None, &all).unwrap();
    }

    #[test]
    fn a_worker_that_sleeps_through_passes_is_kept_off_the_last_callers_cpu_alone() {
        let all = sched_getaffinity(None).unwrap();
        let cpus: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|&cpu| all.is_set(cpu)).take(2).collect();
        let (placement, is_over) = (Placement::new(), AtomicBool::new(false));
        let [allowed, afterwards] = thread::scope(|scope| {
            let worker = scope.spawn(|| {
                placement.start();
                while !is_over.load(Ordering::Relaxed) {
                    placement.sleep();
                }
                placement.allow_again();
                sched_getaffinity(None).unwrap()
            });
            while !placement.is_asleep.load(Ordering::Relaxed) {
                thread::yield_now();
            }
            cpus.iter().for_each(|&own| placement.keep_off(own as u32));
            let allowed = sched_getaffinity(Pid::from_raw(placement.thread_id.load(Ordering::Relaxed))).unwrap();
            is_over.store(true, Ordering::Relaxed);
            worker.thread().unpark();
            [allowed, worker.join().unwrap()]
        });
        assert_eq!(allowed.count(), (all.count() - 1).max(1));
        // Of two, only the last one is excluded.
        if let [earlier, last] = cpus[..] {
            assert!(allowed.is_set(earlier) && !allowed.is_set(last));
        }
        assert!(afterwards == all);
    }
}
