//! Runs unknown ONNX networks in threads whose memory and time are limited.
//!
//! `rten` limits neither: a file of 150 bytes can request 40 GB, which aborts a process, or occupy a thread for hours. A
//! thread that requests too much is never answered ([`MemoryLimit`]), and one that is late is not waited for: it ends at
//! its next large request.

use std::mem;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use super::built_in::BuiltIn;
use super::{Engine, Network, PANICKED, Tensor};
use bokehcam::compute::catch_panic;
use bokehcam::compute::memory_limit::MemoryLimit;

/// Memory limit of a call: several times the need of the largest file with all its pictures.
const MAX_MEMORY_BYTES: usize = 2 << 30;
/// Time limit for loading a network; a busy machine needs less.
const LOAD_TIMEOUT: Duration = Duration::from_secs(30);
/// Time limit for an answer; a later one would be useless.
const RUN_TIMEOUT: Duration = Duration::from_secs(10);
/// Time limit once the program is about to exit.
const EXIT_TIMEOUT: Duration = Duration::from_millis(500);
/// Interval at which a wait is checked for its end.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Enough for the recursion of `rten` along a network of the most operators.
const STACK_BYTES: usize = 32 << 20;

/// Whether the program is about to exit.
static IS_EXITING: AtomicBool = AtomicBool::new(false);

/// Shortens all waits for networks, because the program is about to exit.
pub fn shorten_timeouts() {
    IS_EXITING.store(true, Ordering::Relaxed);
}

/// A network that runs within the limits.
struct Bounded {
    limit: &'static MemoryLimit,
    /// `None` after a failure, which `why` describes.
    engine: Option<Box<dyn Engine>>,
    why: String,
}

/// Loads a network. Its constants are computed when it runs, not by an optimiser, whose threads have no limits.
pub fn load(bytes: Vec<u8>) -> Result<Network, String> {
    let limit = MemoryLimit::new(MAX_MEMORY_BYTES);
    let network = call(limit, LOAD_TIMEOUT, move || BuiltIn::load(bytes, false))??;
    let engine = Bounded { limit, engine: Some(network.engine), why: String::new() };
    Ok(Network { engine: Box::new(engine), ..network })
}

impl Engine for Bounded {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let mut engine = self.engine.take().ok_or_else(|| self.why.clone())?;
        let (inputs, mut results) = (inputs.to_vec(), mem::take(outputs));
        let ran = call(self.limit, RUN_TIMEOUT, move || {
            let result = engine.run(&inputs, &mut results);
            (engine, results, result)
        });
        let (engine, results, result) = ran.inspect_err(|why| self.why.clone_from(why))?;
        self.engine = Some(engine);
        *outputs = results;
        result
    }
}

/// Does `work` in a thread of its own.
///
/// # Errors
/// The work panics, or exceeds a limit; then its thread is abandoned.
fn call<T: Send + 'static>(
    limit: &'static MemoryLimit,
    timeout: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, String> {
    let (done, result) = mpsc::channel();
    limit.restart();
    let thread = thread::Builder::new().name("network".to_owned()).stack_size(STACK_BYTES);
    let spawned = thread.spawn(move || {
        limit.apply();
        // Fails if the caller has given up.
        let _ = done.send(catch_panic(work));
    });
    spawned.map_err(|error| format!("its thread does not start: {error}"))?;
    let (mut deadline, mut is_exiting) = (Instant::now() + timeout, false);
    loop {
        match result.recv_timeout(POLL_INTERVAL) {
            Ok(done) => return done.ok_or_else(|| PANICKED.to_owned()),
            Err(RecvTimeoutError::Disconnected) => return Err(PANICKED.to_owned()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if limit.is_exceeded() {
            return Err(format!("it asks for more than {} GiB of memory", MAX_MEMORY_BYTES >> 30));
        }
        if !is_exiting && IS_EXITING.load(Ordering::Relaxed) {
            is_exiting = true;
            deadline = deadline.min(Instant::now() + EXIT_TIMEOUT);
        }
        if Instant::now() >= deadline {
            limit.stop();
            return Err(match is_exiting {
                true => "it gave no answer before the program ended".to_owned(),
                false => format!("it gave no answer in {} s", timeout.as_secs_f32()),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does what the first value of its input says.
    struct Scripted;

    impl Engine for Scripted {
        fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
            match inputs[0].values[0] {
                0.0 => Err("of this test".to_owned()),
                1.0 => panic!("of this test"),
                _ => {
                    outputs.push(inputs[0].clone());
                    Ok(())
                }
            }
        }
    }

    fn bounded() -> Bounded {
        let limit = MemoryLimit::new(MAX_MEMORY_BYTES);
        Bounded { limit, engine: Some(Box::new(Scripted)), why: String::new() }
    }

    fn input(value: f32) -> [Tensor; 1] {
        [Tensor { shape: vec![1], values: vec![value] }]
    }

    #[test]
    fn an_answer_comes_back_and_an_error_is_no_end() {
        let (mut network, mut outputs) = (bounded(), Vec::new());
        assert_eq!(network.run(&input(0.0), &mut outputs), Err("of this test".to_owned()));
        for count in 1..4 {
            network.run(&input(7.0), &mut outputs).unwrap();
            assert_eq!(outputs, vec![input(7.0)[0].clone(); count]);
        }
        assert_eq!(MemoryLimit::of_thread().map(drop), None);
    }

    #[test]
    fn after_a_panic_it_is_not_called_again() {
        let (mut network, mut outputs) = (bounded(), Vec::new());
        for value in [1.0, 7.0] {
            assert_eq!(network.run(&input(value), &mut outputs), Err(PANICKED.to_owned()));
        }
    }

    #[test]
    fn work_that_is_late_or_sleeps_is_not_waited_for() {
        let limit = MemoryLimit::new(1 << 20);
        let late = call(limit, Duration::from_millis(100), || thread::sleep(Duration::from_secs(3600)));
        assert_eq!(late, Err("it gave no answer in 0.1 s".to_owned()));
        let limit = MemoryLimit::new(1 << 20);
        let much = call(limit, LOAD_TIMEOUT, || MemoryLimit::of_thread().expect("a limit").add(2 << 20));
        assert_eq!(much, Err("it asks for more than 2 GiB of memory".to_owned()));
    }
}
