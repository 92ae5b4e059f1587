//! A worker thread for tasks that may take longer than a frame.

use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};

/// A worker thread that processes one task at a time: submit, process, return.
pub struct BackgroundWorker<T> {
    to: Option<SyncSender<T>>,
    from: Receiver<T>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> BackgroundWorker<T> {
    /// Starts a thread called `name` that runs `work` on each task; `None` if no thread can be created.
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

    /// Submits a task to the idle thread; returns the task if the thread has ended.
    pub fn submit(&self, task: T) -> Result<(), T> {
        match &self.to {
            Some(to) => to.try_send(task).map_err(|(TrySendError::Full(task) | TrySendError::Disconnected(task))| task),
            None => Err(task),
        }
    }

    /// Returns the processed task, or `None` if it is not done; waits for it if `wait`.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn collect(&self, wait: bool) -> Result<Option<T>, String> {
        let gone = "its thread has ended".to_owned();
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

impl<T> Drop for BackgroundWorker<T> {
    /// Waits for the current task: a runtime must not be active while the program exits.
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            // A panic in the thread is irrelevant now.
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
        let background_worker = BackgroundWorker::new("test", work).unwrap();
        background_worker.submit(()).unwrap();
        drop(background_worker);
        assert!(IS_DONE.load(Ordering::Relaxed));
    }

    #[test]
    fn tasks_come_back_done_and_a_thread_that_died_is_told() {
        let background_worker = BackgroundWorker::new("test", |task: &mut i32| {
            assert!(*task > 0, "this test's own");
            *task *= 2;
        })
        .unwrap();
        assert_eq!(background_worker.collect(false), Ok(None));
        for task in [21, 4] {
            background_worker.submit(task).unwrap();
            assert_eq!(background_worker.collect(true), Ok(Some(2 * task)));
        }
        background_worker.submit(0).unwrap();
        assert!(background_worker.collect(true).is_err());
        assert_eq!(background_worker.submit(1), Err(1));
    }
}
