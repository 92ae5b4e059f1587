//! Waiting for something, with an end against a hang.
#![allow(dead_code, missing_docs)]

use std::thread;
use std::time::{Duration, Instant};

/// Waits until `is` gives something.
#[track_caller]
pub fn found<T>(what: &str, within: Duration, mut is: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = is() {
            return found;
        }
        assert!(began.elapsed() < within, "not within {within:?}: {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until something is so; gives back for how long.
#[track_caller]
pub fn until(what: &str, within: Duration, mut is: impl FnMut() -> bool) -> Duration {
    let began = Instant::now();
    found(what, within, || is().then_some(()));
    began.elapsed()
}
