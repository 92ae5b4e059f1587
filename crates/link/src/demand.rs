//! On-demand capture: sinks report whether their output is watched; without watchers, capture pauses the camera.

use std::time::Duration;

use super::event::AutoResetEvent;
use super::sync::{Arc, AtomicBool, AtomicUsize, Ordering};

/// Number of watched outputs, which a thread can wait for. Clones share it.
#[derive(Clone, Debug)]
pub struct Demand(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    /// Counts the watchers as well.
    parent: Option<Demand>,
    watched: AtomicUsize,
    withheld: AtomicBool,
    event: AutoResetEvent,
}

impl Demand {
    /// Demand without watchers.
    pub fn new() -> Self {
        Self::with_parent(None)
    }

    /// Creates a part of this demand: its watchers count in both.
    pub fn new_part(&self) -> Self {
        Self::with_parent(Some(self.clone()))
    }

    fn with_parent(parent: Option<Self>) -> Self {
        Self(Arc::new(Shared {
            parent,
            watched: AtomicUsize::new(0),
            withheld: AtomicBool::new(false),
            event: AutoResetEvent::new(),
        }))
    }

    /// Counts one more watched output, until the returned [`Watch`] is dropped.
    pub fn watch(&self) -> Watch {
        self.0.watched.fetch_add(1, Ordering::Release);
        // After the count, or the waiter could wake, see no watcher and sleep on.
        self.0.event.set();
        let parent = self.0.parent.as_ref().map(|parent| Box::new(parent.watch()));
        Watch { demand: self.clone(), _parent: parent }
    }

    /// Whether any output is watched and not withheld.
    pub fn is_watched(&self) -> bool {
        !self.0.withheld.load(Ordering::Acquire) && self.has_watchers()
    }

    /// Whether any output is watched, even if withheld.
    pub fn has_watchers(&self) -> bool {
        self.0.watched.load(Ordering::Acquire) > 0
    }

    /// Makes [`Self::is_watched`] false regardless of watchers while `withheld`.
    pub fn withhold(&self, withheld: bool) {
        self.0.withheld.store(withheld, Ordering::Release);
        // After the flag, for the same reason.
        self.0.event.set();
    }

    /// Wakes a waiting thread, even without a watcher.
    pub fn notify(&self) {
        self.0.event.set();
    }

    /// Sleeps until an output is watched, for at most `patience`; may also wake spuriously.
    pub fn wait(&self, patience: Duration) {
        if !self.is_watched() {
            // The result does not matter: the caller checks again.
            self.0.event.wait_timeout(patience);
        }
    }
}

impl Default for Demand {
    fn default() -> Self {
        Self::new()
    }
}

/// A watched output; it stops counting when dropped.
#[derive(Debug)]
pub struct Watch {
    demand: Demand,
    /// Counts in the demand that this one is a part of.
    _parent: Option<Box<Watch>>,
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.demand.0.watched.fetch_sub(1, Ordering::Release);
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use std::time::Instant;

    use super::*;

    #[test]
    fn each_watch_counts_until_it_is_dropped() {
        let demand = Demand::new();
        assert!(!demand.is_watched());
        let (first, second) = (demand.watch(), demand.watch());
        drop(first);
        assert!(demand.is_watched());
        drop(second);
        assert!(!demand.is_watched());
    }

    #[test]
    fn a_watcher_of_a_part_counts_in_the_whole_and_not_in_other_parts() {
        let whole = Demand::new();
        let (part, other) = (whole.new_part(), whole.new_part());
        let watch = part.watch();
        assert!(whole.is_watched() && part.is_watched() && !other.has_watchers());
        whole.withhold(true);
        assert!(!whole.is_watched() && part.has_watchers());
        drop(watch);
        assert!(!whole.has_watchers() && !part.has_watchers());
        let _watch = whole.watch();
        assert!(!part.has_watchers());
    }

    #[test]
    fn what_is_withheld_is_not_watched_until_it_is_given_again() {
        let demand = Demand::new();
        let watch = demand.watch();
        demand.withhold(true);
        assert!(demand.has_watchers() && !demand.is_watched());
        demand.withhold(false);
        assert!(demand.is_watched());
        drop(watch);
        assert!(!demand.has_watchers());
    }

    #[test]
    fn nobody_is_waited_for_as_long_as_said_and_somebody_not_at_all() {
        let (demand, began) = (Demand::new(), Instant::now());
        demand.wait(Duration::from_millis(20));
        assert!(began.elapsed() >= Duration::from_millis(20));
        let watch = demand.watch();
        demand.wait(Duration::ZERO);
        // The event is not set any more.
        demand.wait(Duration::from_secs(3600));
        drop(watch);
    }

    #[test]
    fn a_waiter_wakes_when_somebody_watches() {
        let demand = Demand::new();
        let began = Instant::now();
        let other = demand.clone();
        let watcher = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(20));
            other.watch()
        });
        while !demand.is_watched() {
            demand.wait(Duration::from_secs(60));
        }
        assert!(began.elapsed() < Duration::from_secs(30));
        drop(watcher.join());
    }
}
