//! Polling with a timeout.
#![allow(dead_code, missing_docs)]

use std::thread;
use std::time::{Duration, Instant};

/// Polls until `is` returns a value.
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

/// Polls until a condition holds; returns how long that took.
#[track_caller]
pub fn until(what: &str, within: Duration, mut is: impl FnMut() -> bool) -> Duration {
    let began = Instant::now();
    found(what, within, || is().then_some(()));
    began.elapsed()
}
