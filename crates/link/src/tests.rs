use std::sync::Arc;
use std::thread;
use std::time::Duration;

use super::*;

/// Deterministic delays: mostly none, sometimes a yield, rarely a short sleep.
struct Stalls(u64);

impl Stalls {
    fn stall(&mut self) {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        match self.0 >> 33 & 0xfff {
            0..4 => thread::sleep(Duration::from_micros(50)),
            4..64 => thread::yield_now(),
            _ => {}
        }
    }
}

#[test]
fn every_item_of_a_live_link_is_read_or_comes_back() {
    const ITEMS: u64 = if cfg!(miri) { 300 } else { 200_000 };
    let (mut sender, mut receiver) = live();
    let reader = thread::spawn(move || {
        let mut stalls = Stalls(7);
        let mut read = Vec::new();
        while let Some(item) = receiver.recv() {
            read.push(item);
            stalls.stall();
        }
        read
    });
    let mut stalls = Stalls(3);
    let mut seen = vec![0u8; ITEMS as usize];
    for item in 0..ITEMS {
        if let Some(older) = sender.send(item).unwrap() {
            assert!(older < item, "only an older item is displaced");
            seen[older as usize] += 1;
        }
        stalls.stall();
    }
    drop(sender);
    let read = reader.join().unwrap();
    assert!(read.is_sorted_by(|a, b| a < b), "items keep their order");
    assert_eq!(read.last(), Some(&(ITEMS - 1)), "the last item is delivered although the sender is gone");
    for item in read {
        seen[item as usize] += 1;
    }
    assert!(seen.iter().all(|&count| count == 1), "each item is read or displaced, once");
}

#[test]
fn a_lossless_link_delivers_everything_in_order() {
    const ITEMS: u32 = if cfg!(miri) { 100 } else { 20_000 };
    let (mut sender, mut receiver) = lossless();
    let reader = thread::spawn(move || std::iter::from_fn(|| receiver.recv()).collect::<Vec<u32>>());
    for item in 0..ITEMS {
        assert_eq!(sender.send(item), Ok(None));
    }
    drop(sender);
    assert!(reader.join().unwrap().into_iter().eq(0..ITEMS));
}

#[test]
fn a_mailbox_holds_only_the_newest() {
    let (mut sender, mut receiver) = live();
    assert_eq!(receiver.try_recv(), None);
    assert_eq!(sender.send(1), Ok(None));
    assert_eq!(sender.send(2), Ok(Some(1)));
    assert_eq!(receiver.recv(), Some(2));
    assert_eq!(sender.send(3), Ok(None));
    drop(sender);
    assert_eq!(receiver.recv(), Some(3));
    assert_eq!(receiver.recv(), None);
    assert_eq!(receiver.recv(), None);
}

#[test]
fn what_is_there_is_taken_without_a_wait() {
    for (mut sender, mut receiver) in [live(), lossless()] {
        assert_eq!(receiver.try_recv(), None);
        sender.send(5).unwrap();
        assert_eq!((receiver.try_recv(), receiver.try_recv()), (Some(5), None));
        sender.send(6).unwrap();
        assert!(matches!(receiver.recv_timeout(Duration::from_secs(600)), Received::Item(6)));
        assert!(matches!(receiver.recv_timeout(Duration::from_millis(1)), Received::Nothing));
        drop(sender);
        assert!(matches!(receiver.recv_timeout(Duration::from_secs(600)), Received::Ended));
    }
}

#[test]
fn a_gone_receiver_is_seen_and_nothing_leaks() {
    for (mut sender, receiver) in [live(), lossless()] {
        let item = Arc::new(());
        sender.send(item.clone()).unwrap();
        drop(receiver);
        assert_eq!(sender.send(item.clone()), Err(Abandoned));
        drop(sender);
        assert_eq!(Arc::strong_count(&item), 1);
    }
}

#[test]
fn a_sender_waiting_for_room_wakes_when_the_receiver_goes() {
    let (mut sender, receiver) = lossless();
    for item in 0..LOSSLESS_ITEMS {
        sender.send(item).unwrap();
    }
    let waiting = thread::spawn(move || sender.send(99));
    drop(receiver);
    assert_eq!(waiting.join().unwrap(), Err(Abandoned));
}
