//! An open device node and its ioctls, each with the one type that the kernel expects.

use std::ffi::c_void;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc;

/// A device node such as `/dev/video0`. Calls never block: they return `WouldBlock` where there is nothing to dequeue.
#[derive(Debug)]
pub struct Device {
    fd: OwnedFd,
    path: PathBuf,
}

/// An ioctl number.
pub type Request = std::ffi::c_ulong;

macro_rules! ioctls {
    ($($(#[$doc:meta])* $name:ident: $request:ident($type:ty);)*) => {
        $(
            $(#[$doc])*
            pub fn $name(&self, argument: &mut $type) -> io::Result<()> {
                if !argument.is_pointer_free() {
                    return Err(io::ErrorKind::InvalidInput.into());
                }
                // SAFETY: the type is the one that the request's number was made of, and the driver follows no pointer
                // in it, as `is_pointer_free` has checked.
                #[allow(unsafe_code)]
                unsafe { self.ioctl(vidioc::$request as Request, argument) }
            }
        )*
    };
}

/// An ioctl argument that contains its whole result: the driver follows no pointer out of it.
trait PointerFree {
    /// Whether the driver follows no pointer in this value.
    fn is_pointer_free(&self) -> bool {
        true
    }
}

macro_rules! pointer_free {
    ($($type:ty),* $(,)?) => { $(impl PointerFree for $type {})* };
}

// None of these has a pointer in any member of any union.
pointer_free!(
    i32,
    sys::v4l2_capability,
    sys::v4l2_control,
    sys::v4l2_fmtdesc,
    sys::v4l2_frmivalenum,
    sys::v4l2_frmsizeenum,
    sys::v4l2_query_ext_ctrl,
    sys::v4l2_querymenu,
    sys::v4l2_requestbuffers,
    sys::v4l2_streamparm,
);

impl PointerFree for sys::v4l2_format {
    /// An overlay's format points to clips and a bitmap; formats of picture queues are plain numbers.
    fn is_pointer_free(&self) -> bool {
        let pictures = [
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE,
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE,
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT,
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE,
        ];
        pictures.contains(&self.type_)
    }
}

impl Device {
    /// Opens a node for reading and writing.
    ///
    /// # Errors
    /// The system's error.
    pub fn open(path: &Path) -> io::Result<Self> {
        // CLOEXEC: child processes would keep the camera busy otherwise.
        let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty())?;
        Ok(Self { fd, path: path.to_owned() })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Calls the driver, repeating the call if a signal interrupts it.
    ///
    /// # Errors
    /// The driver's error.
    ///
    /// # Safety
    /// `T` must be the type that `request` reads and writes, and pointers in it must be valid for the driver's
    /// accesses.
    #[allow(unsafe_code)]
    pub unsafe fn ioctl<T>(&self, request: Request, argument: &mut T) -> io::Result<()> {
        loop {
            let pointer: *mut T = argument;
            // SAFETY: the descriptor is open, and the caller vouches for the argument.
            let done = unsafe { v4l::v4l2::ioctl(self.fd.as_raw_fd(), request as _, pointer.cast::<c_void>()) };
            match done {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                done => return done,
            }
        }
    }

    ioctls! {
        /// Reads the device's identity and capabilities.
        query_capability: VIDIOC_QUERYCAP(sys::v4l2_capability);
        /// Reads the format number `index` of a queue.
        enum_format: VIDIOC_ENUM_FMT(sys::v4l2_fmtdesc);
        /// Reads the size number `index` of a format.
        enum_frame_size: VIDIOC_ENUM_FRAMESIZES(sys::v4l2_frmsizeenum);
        /// Reads the frame interval number `index` of a format and size.
        enum_frame_interval: VIDIOC_ENUM_FRAMEINTERVALS(sys::v4l2_frmivalenum);
        /// Reads the current format.
        get_format: VIDIOC_G_FMT(sys::v4l2_format);
        /// Sets a format; the driver may change every part of it.
        set_format: VIDIOC_S_FMT(sys::v4l2_format);
        /// Returns the format that setting this one would result in.
        try_format: VIDIOC_TRY_FMT(sys::v4l2_format);
        get_parameters: VIDIOC_G_PARM(sys::v4l2_streamparm);
        /// Sets the frame rate; the driver may change it.
        set_parameters: VIDIOC_S_PARM(sys::v4l2_streamparm);
        /// Reads the value of a control.
        get_control: VIDIOC_G_CTRL(sys::v4l2_control);
        /// Requests buffers; the driver returns how many it grants.
        request_buffers: VIDIOC_REQBUFS(sys::v4l2_requestbuffers);
        /// Describes a control, or the next one.
        query_control: VIDIOC_QUERY_EXT_CTRL(sys::v4l2_query_ext_ctrl);
        /// Reads an item of a control's menu.
        query_menu: VIDIOC_QUERYMENU(sys::v4l2_querymenu);
        /// Starts streaming on a queue of this type.
        stream_on: VIDIOC_STREAMON(i32);
        /// Stops streaming; every buffer is returned.
        stream_off: VIDIOC_STREAMOFF(i32);
    }
}

/// Returns the capabilities of a node itself; `capabilities` has those of all nodes of its device together.
pub fn node_caps(capability: &sys::v4l2_capability) -> u32 {
    match capability.capabilities & sys::V4L2_CAP_DEVICE_CAPS {
        0 => capability.capabilities,
        _ => capability.device_caps,
    }
}

/// Returns a kernel structure with all bits zero.
pub fn zeroed<T: KernelStruct>() -> T {
    // SAFETY: `KernelStruct` guarantees that zero is valid for every field.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::zeroed()
    }
}

/// Plain C structures for which all bits zero is a valid value.
///
/// # Safety
/// Every field must accept zero: integers, unions of them, and pointers, which are then null.
#[allow(unsafe_code)]
pub unsafe trait KernelStruct {}

macro_rules! kernel_structs {
    ($($name:ident),* $(,)?) => {
        // SAFETY: C structures of integers, arrays, unions of those, and pointers.
        $(#[allow(unsafe_code)] unsafe impl KernelStruct for sys::$name {})*
    };
}

kernel_structs!(
    v4l2_buffer,
    v4l2_capability,
    v4l2_event,
    v4l2_event_subscription,
    v4l2_fmtdesc,
    v4l2_format,
    v4l2_frmivalenum,
    v4l2_frmsizeenum,
    v4l2_input,
    v4l2_pix_format,
    v4l2_pix_format_mplane,
    v4l2_plane,
    v4l2_query_ext_ctrl,
    v4l2_querymenu,
    v4l2_requestbuffers,
    v4l2_streamparm,
    v4l2_ext_control,
    v4l2_ext_controls,
);

impl AsFd for Device {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_driver_is_given_a_pointer_out_of_a_format() {
        let device = Device::open("/dev/null".as_ref()).unwrap();
        let asked = |type_| {
            let mut format = sys::v4l2_format { type_, ..zeroed() };
            device.try_format(&mut format).unwrap_err()
        };
        let overlay = asked(sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OVERLAY);
        assert_eq!((overlay.kind(), overlay.raw_os_error()), (io::ErrorKind::InvalidInput, None), "by us");
        let capture = asked(sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE);
        assert!(capture.raw_os_error().is_some(), "by the driver: {capture}");
    }
}
