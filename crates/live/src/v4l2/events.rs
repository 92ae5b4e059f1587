//! V4L2 events of a device: subscribing and dequeuing.

use std::ffi::c_ulong;
use std::io;

use v4l::v4l_sys as sys;

use super::device::{Device, Request, zeroed};

/// Sends an event with the current state at once, not only on changes (`V4L2_EVENT_SUB_FL_SEND_INITIAL`).
pub const SEND_INITIAL: u32 = sys::V4L2_EVENT_SUB_FL_SEND_INITIAL;
/// The first event number for driver-specific events.
pub const PRIVATE_START: u32 = sys::V4L2_EVENT_PRIVATE_START;

/// `_IOW('V', 90, struct v4l2_event_subscription)`
const SUBSCRIBE: Request = ioctl_number::<sys::v4l2_event_subscription>(1, 90);
/// `_IOR('V', 89, struct v4l2_event)`
const DEQUEUE: Request = ioctl_number::<sys::v4l2_event>(2, 89);

/// Computes an ioctl number of V4L2: direction (1 to the driver, 2 from it), argument size, group, index.
const fn ioctl_number<T>(direction: c_ulong, index: c_ulong) -> Request {
    direction << 30 | (size_of::<T>() as c_ulong) << 16 | (b'V' as c_ulong) << 8 | index
}

/// An event of a device (`struct v4l2_event`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    pub kind: u32,
    /// Event payload; its format depends on the event.
    pub data: [u8; 64],
}

impl Device {
    /// Subscribes to an event; polling for priority data then returns when one is pending.
    ///
    /// # Errors
    /// The driver's error: EINVAL or ENOTTY where it does not support this event.
    pub fn subscribe(&self, kind: u32, flags: u32) -> io::Result<()> {
        let mut subscription = sys::v4l2_event_subscription { type_: kind, flags, ..zeroed() };
        // SAFETY: the type is the one that the number was made of, and it holds no pointer.
        #[allow(unsafe_code)]
        unsafe {
            self.ioctl(SUBSCRIBE, &mut subscription)
        }
    }

    /// Dequeues the oldest pending event.
    ///
    /// # Errors
    /// The driver's error; ENOENT when none is pending.
    pub fn dequeue_event(&self) -> io::Result<Event> {
        let mut event: sys::v4l2_event = zeroed();
        // SAFETY: the type is the one that the number was made of, and it holds no pointer.
        #[allow(unsafe_code)]
        unsafe {
            self.ioctl(DEQUEUE, &mut event)?;
        }
        // SAFETY: these bytes are as long as the union, and every bit pattern is valid.
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
