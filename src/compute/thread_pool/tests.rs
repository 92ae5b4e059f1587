use super::*;

#[test]
fn every_part_is_done_once() {
    for threads in [1, 2, 5] {
        let mut workers = ThreadPool::new("test", threads);
        for parts in [0, 1, 2, 7, 100] {
            for _ in 0..if cfg!(miri) { 5 } else { 200 } {
                let done: Vec<AtomicUsize> = (0..parts).map(|_| AtomicUsize::new(0)).collect();
                workers.run(parts, &|part| {
                    done[part].fetch_add(1, Ordering::Relaxed);
                });
                assert!(done.iter().all(|d| d.load(Ordering::Relaxed) == 1));
            }
        }
    }
}

#[test]
fn every_item_goes_to_one_thread_with_scratch_of_its_own() {
    for threads in [1, 2, 5] {
        let mut workers = ThreadPool::new("test", threads);
        for count in [0, 1, 2, MAX_ITEMS] {
            let (mut scratch, mut data) = (vec![0; threads], vec![0; 3 * count]);
            workers.run_each_with(&mut scratch, data.chunks_mut(3).zip(1..), &|seen, (item, k)| {
                *seen += 1;
                item.fill(k);
            });
            assert_eq!(scratch.iter().sum::<usize>(), count);
            assert!(data.chunks(3).zip(1..).all(|(item, k)| item == [k; 3]));
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "Miri has no clock of a thread")]
fn the_caller_sleeps_while_a_worker_is_busy() {
    use rustix::time::{ClockId, clock_gettime};
    use std::time::Duration;

    let mut workers = ThreadPool::new("test", 2);
    let (caller, is_busy) = (thread::current().id(), AtomicBool::new(false));
    let before = clock_gettime(ClockId::ThreadCPUTime);
    workers.run(2, &|_| {
        if thread::current().id() == caller {
            while !is_busy.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(1));
            }
        } else {
            is_busy.store(true, Ordering::Relaxed);
            thread::sleep(Duration::from_millis(300));
        }
    });
    let after = clock_gettime(ClockId::ThreadCPUTime);
    let ms = (after.tv_sec - before.tv_sec) * 1000 + (after.tv_nsec - before.tv_nsec) / 1_000_000;
    assert!(ms < 100, "{ms} ms of processor time");
}

#[test]
fn a_panic_in_a_part_reaches_the_caller_and_the_pool_lives_on() {
    let mut workers = ThreadPool::new("test", 3);
    let result = catch_unwind(AssertUnwindSafe(|| workers.run(8, &|part| assert_ne!(part, 5))));
    assert!(result.is_err());
    let sum = AtomicUsize::new(0);
    workers.run(10, &|part| {
        sum.fetch_add(part, Ordering::Relaxed);
    });
    assert_eq!(sum.load(Ordering::Relaxed), 45);
}

/// A value whose drop panics again.
struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        if !thread::panicking() {
            std::panic::panic_any(());
        }
    }
}

#[test]
fn nobody_leaves_a_pass_while_members_work_whatever_is_thrown() {
    for caller_throws in [true, false] {
        let mut workers = ThreadPool::new("test", 2);
        let caller = thread::current().id();
        let (both, done) = (AtomicUsize::new(0), AtomicBool::new(false));
        let result = catch_unwind(AssertUnwindSafe(|| {
            workers.run(2, &|_| {
                // One part each.
                both.fetch_add(1, Ordering::Relaxed);
                while both.load(Ordering::Relaxed) < 2 {
                    thread::yield_now();
                }
                if (thread::current().id() == caller) == caller_throws {
                    std::panic::panic_any(Bomb);
                }
                thread::sleep(std::time::Duration::from_millis(50));
                done.store(true, Ordering::Relaxed);
            });
        }));
        assert!(done.load(Ordering::Relaxed), "the pass is over for all");
        assert!(result.is_err());
        let sum = AtomicUsize::new(0);
        workers.run(10, &|part| {
            sum.fetch_add(part, Ordering::Relaxed);
        });
        assert_eq!(sum.load(Ordering::Relaxed), 45, "the pool lives on");
    }
}

#[test]
fn parts_beyond_any_address_are_not_handed_out() {
    let mut data = [0u8; 4];
    let mut flags: Vec<AtomicBool> = (0..4).map(|_| AtomicBool::new(false)).collect();
    let parts = DisjointParts::new(&mut data, 1 << (usize::BITS - 1), &mut flags);
    assert_eq!(parts.part(0).len(), 4);
    // Twice this size wraps to 0.
    let second = catch_unwind(AssertUnwindSafe(|| parts.part(2).len())).unwrap_err();
    assert_eq!(second.downcast_ref::<&str>(), Some(&"each part is taken once"));
}

#[test]
fn a_shelf_hands_out_each_part_once() {
    let mut data = vec![0; 10];
    let mut flags: Vec<AtomicBool> = (0..4).map(|_| AtomicBool::new(false)).collect();
    let parts = DisjointParts::new(&mut data, 3, &mut flags);
    parts.part(3).fill(7);
    assert_eq!(parts.part(0).len(), 3);
    assert!(catch_unwind(AssertUnwindSafe(|| parts.part(0).len())).is_err());
    assert_eq!(data[9], 7);
}
