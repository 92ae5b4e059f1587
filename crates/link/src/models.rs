//! Model checking of the hand-over with loom: every order in which the threads can run, and every value that the memory
//! model lets them read, up to a number of preemptions. A data race, a leak, or a lost wake-up (a deadlock) fails a
//! model, as does an assertion.
//!
//! `scripts/prove-link loom` runs them; `LOOM_MAX_PREEMPTIONS` sets another bound.

use std::time::Duration;

use loom::alloc::Track;
use loom::model::Builder;
use loom::sync::atomic::{AtomicBool, Ordering};
use loom::thread;

use super::demand::Demand;
use super::event::AutoResetEvent;
use super::pool::Pool;
use super::sync::Arc;
use super::{Abandoned, Received, Receiver, live};

/// Largest number of preemptions of a thread.
const PREEMPTIONS: usize = 4;
const LONG: Duration = Duration::from_secs(1 << 30);

fn model(run: impl Fn() + Sync + Send + 'static) {
    let mut builder = Builder::new();
    builder.preemption_bound.get_or_insert(PREEMPTIONS);
    builder.check(run);
}

/// Sends 0, 1, ... from a thread of its own, and drops its end; the thread returns the displaced items.
fn spawn_sender(count: u32) -> (thread::JoinHandle<Vec<u32>>, Receiver<Track<u32>>) {
    let (mut sender, receiver) = live();
    let send = move || {
        let displaced = (0..count).filter_map(|item| sender.send(Track::new(item)).ok().flatten());
        displaced.map(Track::into_inner).collect()
    };
    (thread::spawn(send), receiver)
}

/// Asserts that each item was read or displaced once, in order, and that the last one was read.
fn assert_accounted(count: u32, read: &[u32], displaced: &[u32]) {
    assert!(read.is_sorted() && displaced.is_sorted());
    assert_eq!(read.last(), Some(&(count - 1)));
    let mut seen = [read, displaced].concat();
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..count));
}

#[test]
fn every_item_is_read_or_displaced_and_the_end_is_heard() {
    model(|| {
        let (sender, mut receiver) = spawn_sender(3);
        let mut read = Vec::new();
        while let Some(item) = receiver.recv() {
            read.push(item.into_inner());
        }
        assert_accounted(3, &read, &sender.join().unwrap());
    });
}

#[test]
fn a_receiver_that_only_looks_or_gives_up_loses_nothing() {
    model(|| {
        let (sender, mut receiver) = spawn_sender(2);
        let mut read: Vec<u32> = receiver.try_recv().map(Track::into_inner).into_iter().collect();
        for patience in [Duration::ZERO, LONG, LONG, LONG] {
            match receiver.recv_timeout(patience) {
                Received::Item(item) => read.push(item.into_inner()),
                Received::Nothing => assert_eq!(patience, Duration::ZERO),
                Received::Ended => break,
            }
        }
        assert!(matches!(receiver.recv_timeout(LONG), Received::Ended));
        assert_accounted(2, &read, &sender.join().unwrap());
    });
}

#[test]
fn a_receiver_is_woken_by_an_item_alone() {
    model(|| {
        let (mut sender, mut receiver) = live();
        let reader = thread::spawn(move || receiver.recv().map(Track::into_inner));
        assert!(sender.send(Track::new(5)).is_ok());
        // Joined before the end of the sender, which would wake the reader as well.
        assert_eq!(reader.join().unwrap(), Some(5));
    });
}

#[test]
fn a_receiver_may_go_at_any_time() {
    model(|| {
        let (mut sender, mut receiver) = live();
        let reader = thread::spawn(move || {
            receiver.try_recv();
        });
        let mut abandoned = false;
        for item in 0..3 {
            match sender.send(Track::new(item)) {
                Ok(_) => assert!(!abandoned, "who has gone does not come back"),
                Err(Abandoned) => abandoned = true,
            }
        }
        reader.join().unwrap();
        assert!(sender.send(Track::new(3)).is_err(), "seen at the latest by the next send");
    });
}

/// Adds one to the pool's only buffer: concurrent access would lose an increment (or be a data race).
fn count(pool: &Pool<Track<u32>>) {
    *pool.take().get_mut() += 1;
}

#[test]
fn a_buffer_has_one_taker_at_a_time_and_who_waits_is_woken() {
    model(|| {
        let pool = Arc::new(Pool::new(1, || Track::new(0)));
        let others = [(); 2].map(|()| {
            let pool = pool.clone();
            thread::spawn(move || count(&pool))
        });
        count(&pool);
        others.into_iter().for_each(|other| other.join().unwrap());
        assert_eq!((pool.free(), *pool.take().get_ref()), (1, 3));
    });
}

#[test]
fn two_buffers_come_home_and_wake_two_takers() {
    model(|| {
        let pool = Arc::new(Pool::new(2, || Track::new(0)));
        let (first, second) = (pool.take(), pool.take());
        let takers = [(); 2].map(|()| {
            let pool = pool.clone();
            thread::spawn(move || pool.take())
        });
        drop(first);
        drop(second);
        // Each keeps its buffer until both have one.
        let [first, second] = takers.map(|taker| taker.join().unwrap());
        drop((first, second));
        assert_eq!(pool.free(), 2);
    });
}

#[test]
fn a_loan_goes_home_from_another_thread_or_outlives_its_pool() {
    model(|| {
        let pool = Pool::new(2, || Track::new(0));
        let mut loan = pool.take();
        let other = thread::spawn(move || {
            *loan.get_mut() = 7;
        });
        if let Some(loan) = pool.try_take() {
            assert!([0, 7].contains(loan.get_ref()));
        }
        drop(pool);
        other.join().unwrap();
    });
}

#[test]
fn frames_of_a_pool_go_through_a_link_and_come_home() {
    model(|| {
        let pool = Pool::new(2, || Track::new(0));
        let (mut sender, mut receiver) = live();
        let reader = thread::spawn(move || {
            let mut last = 0;
            while let Some(frame) = receiver.recv() {
                let frame: super::pool::Pooled<Track<u32>> = frame;
                assert!(*frame.get_ref() > last, "newer than the one before, and whole");
                last = *frame.get_ref();
            }
            last
        });
        for number in 1..=2 {
            let mut frame = pool.take();
            *frame.get_mut() = number;
            drop(sender.send(frame));
        }
        drop(sender);
        assert_eq!(reader.join().unwrap(), 2);
        assert_eq!(pool.free(), 2);
    });
}

#[test]
fn what_was_done_before_a_ring_is_seen_by_who_hears_it() {
    model(|| {
        let shared = Arc::new((AutoResetEvent::new(), AtomicBool::new(false), AtomicBool::new(false)));
        let ringer = {
            let shared = shared.clone();
            thread::spawn(move || {
                let (event, first, second) = &*shared;
                first.store(true, Ordering::Relaxed);
                event.set();
                second.store(true, Ordering::Relaxed);
                event.set();
            })
        };
        let (event, first, second) = &*shared;
        while !second.load(Ordering::Relaxed) {
            event.wait();
            assert!(first.load(Ordering::Relaxed), "the flags are ordered by the event alone");
        }
        ringer.join().unwrap();
    });
}

#[test]
fn a_patient_waiter_is_woken_although_another_gave_up() {
    model(|| {
        let shared = Arc::new((AutoResetEvent::new(), AtomicBool::new(false)));
        let patient = {
            let shared = shared.clone();
            thread::spawn(move || {
                while !shared.1.load(Ordering::Relaxed) {
                    shared.0.wait();
                }
            })
        };
        let hasty = {
            let shared = shared.clone();
            thread::spawn(move || {
                if shared.0.wait_timeout(Duration::ZERO) {
                    assert!(shared.1.load(Ordering::Relaxed));
                    // The other thread still has a wake-up to receive.
                    shared.0.set();
                }
            })
        };
        shared.1.store(true, Ordering::Relaxed);
        shared.0.set();
        hasty.join().unwrap();
        patient.join().unwrap();
    });
}

#[test]
fn who_waits_for_demand_hears_of_it() {
    model(|| {
        let demand = Demand::new();
        let watchers = [(); 2].map(|()| {
            let demand = demand.clone();
            thread::spawn(move || demand.watch())
        });
        while !demand.is_watched() {
            demand.wait(LONG);
        }
        let watches = watchers.map(|watcher| watcher.join().unwrap());
        assert!(demand.is_watched());
        drop(watches);
        assert!(!demand.is_watched());
    });
}
