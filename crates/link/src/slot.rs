//! A slot for one item, where the newest wins: a triple buffer.
//!
//! There are three cells: the writer owns one, the reader owns one, and the third, the middle one, is exchanged with an
//! end's own by a swap. One atomic byte holds the number of the middle cell, and whether it has an unread item. Both
//! ends are wait-free: a fixed number of steps, independent of the other end. Nothing is allocated but the slot itself.
//!
//! # Memory orders
//! Every change of the byte is a swap, and a swap acts on the immediately preceding value. So the swaps of both ends
//! form one chain, in which each cell is passed from one end to the other: the end that gives a cell away has finished
//! with it before its swap (*release*), and the end that gets it starts after its own (*acquire*). That holds in both
//! directions, hence `AcqRel` on both: an item must be complete before it is read, and a cell empty before it is
//! refilled.

use super::sync::{Arc, AtomicU8, Ordering, UnsafeCell};

/// Bits of the byte with the number of the middle cell.
const CELL: u8 = 0b011;
/// Set if the middle cell holds an unread item.
const FRESH: u8 = 0b100;

struct Slot<T> {
    cells: [UnsafeCell<Option<T>>; 3],
    middle: AtomicU8,
}

// SAFETY: the cells are the only part that is not `Sync` by itself. A cell is accessed by the one end that owns it, and
// ownership moves by the swaps of `middle`, which order the accesses of both ends (see above). Items are moved from one
// thread to another, never shared, so `T: Send` suffices.
#[allow(unsafe_code)]
unsafe impl<T: Send> Sync for Slot<T> {}

/// Creates the two ends of an empty slot.
pub(super) fn slot<T>() -> (Writer<T>, Reader<T>) {
    let slot = Slot { cells: [(); 3].map(|()| UnsafeCell::new(None)), middle: AtomicU8::new(1) };
    let slot = Arc::new(slot);
    (Writer { end: End { slot: slot.clone(), own: 0 } }, Reader { end: End { slot, own: 2 } })
}

/// The only writer of a slot.
pub(super) struct Writer<T> {
    end: End<T>,
}

impl<T> Writer<T> {
    /// Stores `item`; returns the older one if it was not read. Wait-free.
    pub(super) fn put(&mut self, item: T) -> Option<T> {
        let before = self.end.own_cell(|cell| cell.replace(item));
        debug_assert!(before.is_none(), "an end keeps no item");
        self.end.swap(FRESH);
        // A cell from the reader is empty; otherwise it still has the unread older item.
        self.end.own_cell(Option::take)
    }
}

/// The only reader of a slot.
pub(super) struct Reader<T> {
    end: End<T>,
}

impl<T> Reader<T> {
    /// Takes the newest item, unless it was taken before. Wait-free.
    pub(super) fn take(&mut self) -> Option<T> {
        // Relaxed: only a hint; the swap orders. Only this end clears FRESH, so it still holds at the swap, and an item
        // that happened before this call (the event, the end of the writer) is never missed.
        if self.end.slot.middle.load(Ordering::Relaxed) & FRESH == 0 {
            return None;
        }
        self.end.swap(0);
        self.end.own_cell(Option::take)
    }
}

/// State of either end.
struct End<T> {
    slot: Arc<Slot<T>>,
    /// Number of the cell that this end owns: 0, 1 or 2, different from that of the other end and of the middle.
    own: u8,
}

impl<T> End<T> {
    /// Exchanges the end's own cell, marked with `fresh`, for the middle one.
    fn swap(&mut self, fresh: u8) {
        // Releases the writes to the cell given away, acquires those to the cell received.
        self.own = self.slot.middle.swap(self.own | fresh, Ordering::AcqRel) & CELL;
    }

    fn own_cell<R>(&mut self, access: impl FnOnce(&mut Option<T>) -> R) -> R {
        self.slot.cells[usize::from(self.own)].with_mut(|cell| {
            // SAFETY: the three numbers, one with each end and one in the byte, start different and are only ever
            // exchanged, so no other end has this one; `&mut self` prevents a second use by this end. The swap that
            // brought the cell here acquired all writes of its former owner.
            #[allow(unsafe_code)]
            access(unsafe { &mut *cell })
        })
    }
}
