//! Events of a device (V4L2's event interface): subscribing to them and taking them.

use std::ffi::c_ulong;
use std::io;

use v4l::v4l_sys as sys;

use super::device::{Device, Request, zeroed};

/// Send an event with the present state at once, not only when it changes (`V4L2_EVENT_SUB_FL_SEND_INITIAL`).
pub const SEND_INITIAL: u32 = sys::V4L2_EVENT_SUB_FL_SEND_INITIAL;
/// The first number that a driver may give an event of its own.
pub const PRIVATE_START: u32 = sys::V4L2_EVENT_PRIVATE_START;

/// `_IOW('V', 90, struct v4l2_event_subscription)`
const SUBSCRIBE: Request = number::<sys::v4l2_event_subscription>(1, 90);
/// `_IOR('V', 89, struct v4l2_event)`
const DEQUEUE: Request = number::<sys::v4l2_event>(2, 89);

/// The number of an ioctl of Video4Linux: direction (1 to the driver, 2 from it), size of its argument, group, place.
const fn number<T>(direction: c_ulong, place: c_ulong) -> Request {
    direction << 30 | (size_of::<T>() as c_ulong) << 16 | (b'V' as c_ulong) << 8 | place
}

/// An event of a device (`struct v4l2_event`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    pub kind: u32,
    /// What comes with it; how it is read depends on the event.
    pub data: [u8; 64],
}

impl Device {
    /// Asks to be told of an event; waiting for priority data then ends when there is one.
    ///
    /// # Errors
    /// What the driver says: EINVAL or ENOTTY where it knows no such event.
    pub fn subscribe(&self, kind: u32, flags: u32) -> io::Result<()> {
        let mut wish = sys::v4l2_event_subscription { type_: kind, flags, ..zeroed() };
        // SAFETY: the type is the one that the number was made of, and it holds no pointer.
        #[allow(unsafe_code)]
        unsafe {
            self.ioctl(SUBSCRIBE, &mut wish)
        }
    }

    /// The oldest event that was not taken yet.
    ///
    /// # Errors
    /// What the driver says; ENOENT when there is none.
    pub fn dequeue_event(&self) -> io::Result<Event> {
        let mut event: sys::v4l2_event = zeroed();
        // SAFETY: the type is the one that the number was made of, and it holds no pointer.
        #[allow(unsafe_code)]
        unsafe {
            self.ioctl(DEQUEUE, &mut event)?;
        }
        // SAFETY: these bytes are as long as the union, and any value of theirs is one.
        #[allow(unsafe_code)]
        let data = unsafe { event.u.data };
        Ok(Event { kind: event.type_, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(all(target_arch = "x86_64", target_pointer_width = "64"))]
    fn numbers_are_those_of_the_kernel() {
        assert_eq!((SUBSCRIBE, DEQUEUE), (0x4020_565a, 0x8088_5659));
    }
}
