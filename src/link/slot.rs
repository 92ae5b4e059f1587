//! A place for one item, where the newest wins: a triple buffer of items.
//!
//! Of three cells, the writer owns one, the reader owns one, and the third, the middle one, belongs to whoever swaps
//! its own for it. One atomic byte says which cell is in the middle, and whether the writer put an item there that was
//! not read. Both ends are wait-free: a fixed number of steps, whatever the other end does or however long it is
//! suspended. Nothing is allocated but the slot itself.
//!
//! # Memory orders
//! Every change of the byte is a swap, and a swap takes effect on the value right before it. So the swaps of both ends
//! form one chain, in which each cell is handed from one end to the other: the end that gives a cell away is done with
//! it before its swap (*release*), and the end that gets it begins after its own (*acquire*). That holds in both
//! directions, hence `AcqRel` on both: an item must be whole before it is read, and a cell empty before it is refilled.

use super::sync::{Arc, AtomicU8, Ordering, UnsafeCell};

/// The bits of the byte that number the middle cell.
const CELL: u8 = 0b011;
/// Set where the middle cell holds an item.
const FRESH: u8 = 0b100;

struct Slot<T> {
    cells: [UnsafeCell<Option<T>>; 3],
    middle: AtomicU8,
}

// SAFETY: the cells are the only part that is not `Sync` by itself. A cell is accessed by the one end that owns it, and
// ownership moves by the swaps of `middle`, which order the accesses of both ends (see above). Items are moved from
// one thread to another, never shared, so `T: Send` suffices.
#[allow(unsafe_code)]
unsafe impl<T: Send> Sync for Slot<T> {}

/// The two ends of a new, empty slot.
pub(super) fn slot<T>() -> (Writer<T>, Reader<T>) {
    let slot = Slot { cells: [(); 3].map(|()| UnsafeCell::new(None)), middle: AtomicU8::new(1) };
    let slot = Arc::new(slot);
    (Writer { end: End { slot: slot.clone(), own: 0 } }, Reader { end: End { slot, own: 2 } })
}

/// What puts items in. There is one.
pub(super) struct Writer<T> {
    end: End<T>,
}

impl<T> Writer<T> {
    /// Puts `item` in; gives back the older one if that was not read. Wait-free.
    pub(super) fn put(&mut self, item: T) -> Option<T> {
        let before = self.end.own_cell(|cell| cell.replace(item));
        debug_assert!(before.is_none(), "an end keeps no item");
        self.end.swap(FRESH);
        // What the reader left is empty; what it never took is the older item.
        self.end.own_cell(Option::take)
    }
}

/// What takes items out. There is one.
pub(super) struct Reader<T> {
    end: End<T>,
}

impl<T> Reader<T> {
    /// Takes the newest item out, unless it was taken before. Wait-free.
    pub(super) fn take(&mut self) -> Option<T> {
        // Relaxed: only a hint; the swap orders. Nobody but this end unmakes freshness, so it still holds at the swap,
        // and an item that happened before this call (the doorbell, the end of the writer) is never overlooked.
        if self.end.slot.middle.load(Ordering::Relaxed) & FRESH == 0 {
            return None;
        }
        self.end.swap(0);
        self.end.own_cell(Option::take)
    }
}

/// What both ends are.
struct End<T> {
    slot: Arc<Slot<T>>,
    /// The number of the cell that this end owns: 0, 1 or 2, and never that of the other end or of the middle.
    own: u8,
}

impl<T> End<T> {
    /// Exchanges the end's own cell, marked with `fresh`, for the middle one.
    fn swap(&mut self, fresh: u8) {
        // Release what was done to the cell given away, acquire what was done to the one that comes.
        self.own = self.slot.middle.swap(self.own | fresh, Ordering::AcqRel) & CELL;
    }

    fn own_cell<R>(&mut self, access: impl FnOnce(&mut Option<T>) -> R) -> R {
        self.slot.cells[usize::from(self.own)].with_mut(|cell| {
            // SAFETY: the three numbers, one with each end and one in the byte, begin different and are only ever
            // exchanged, so no other end has this one; `&mut self` keeps this end from using it twice at once. The
            // swap that brought the cell here acquired all that its former owner did to it.
            #[allow(unsafe_code)]
            access(unsafe { &mut *cell })
        })
    }
}
