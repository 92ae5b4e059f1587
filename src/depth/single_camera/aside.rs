//! A thread for work that may take longer than a frame.

use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};

/// A thread that does one task at a time: given, done, and taken back.
pub struct Aside<T> {
    to: Option<SyncSender<T>>,
    from: Receiver<T>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> Aside<T> {
    /// Starts a thread of this name that does `work`; `None` where there cannot be one more.
    pub fn new(name: &str, work: fn(&mut T)) -> Option<Self> {
        let ((to, tasks), (done, from)) = (sync_channel::<T>(1), sync_channel(1));
        let run = move || {
            for mut task in tasks {
                work(&mut task);
                if done.send(task).is_err() {
                    break;
                }
            }
        };
        let thread = thread::Builder::new().name(name.to_owned()).spawn(run).ok()?;
        Some(Self { to: Some(to), from, thread: Some(thread) })
    }

    /// Gives the thread a task, which has none; returns it where the thread is gone.
    pub fn give(&self, task: T) -> Result<(), T> {
        match &self.to {
            Some(to) => to.try_send(task).map_err(|(TrySendError::Full(task) | TrySendError::Disconnected(task))| task),
            None => Err(task),
        }
    }

    /// The task that was given, if it is done, or once it is with `wait`.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn take(&self, wait: bool) -> Result<Option<T>, String> {
        let gone = "its thread is gone".to_owned();
        match wait {
            true => self.from.recv().map(Some).map_err(|_| gone),
            false => match self.from.try_recv() {
                Ok(task) => Ok(Some(task)),
                Err(TryRecvError::Empty) => Ok(None),
                Err(TryRecvError::Disconnected) => Err(gone),
            },
        }
    }
}

impl<T> Drop for Aside<T> {
    /// Waits for what is under way: a runtime must not be at work while the program ends.
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            // Whatever it died of, nobody waits for its work any more.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use super::*;

    #[test]
    fn whoever_lets_go_of_it_waits_for_what_is_under_way() {
        static IS_DONE: AtomicBool = AtomicBool::new(false);
        let work = |_: &mut ()| {
            thread::sleep(Duration::from_millis(100));
            IS_DONE.store(true, Ordering::Relaxed);
        };
        let aside = Aside::new("test", work).unwrap();
        aside.give(()).unwrap();
        drop(aside);
        assert!(IS_DONE.load(Ordering::Relaxed));
    }

    #[test]
    fn tasks_come_back_done_and_a_thread_that_died_is_told() {
        let aside = Aside::new("test", |task: &mut i32| {
            assert!(*task > 0, "this test's own");
            *task *= 2;
        })
        .unwrap();
        assert_eq!(aside.take(false), Ok(None));
        for task in [21, 4] {
            aside.give(task).unwrap();
            assert_eq!(aside.take(true), Ok(Some(2 * task)));
        }
        aside.give(0).unwrap();
        assert!(aside.take(true).is_err());
        assert_eq!(aside.give(1), Err(1));
    }
}
