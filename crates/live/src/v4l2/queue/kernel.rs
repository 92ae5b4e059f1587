//! The kernel interface of a queue, and its implementation for real devices.

use std::io;
use std::os::fd::AsFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc;

use super::{ByteRange, Dequeued, MAX_PLANES};
use crate::v4l2::device::{Device, Request, zeroed};
use crate::v4l2::modes::QueueKind;

/// The kernel's side of a queue of buffers.
pub trait Kernel {
    /// A mapped plane; dropping it unmaps it.
    type Memory: AsRef<[u8]>;

    /// Requests `count` buffers; returns how many were granted.
    fn request_buffers(&mut self, count: u32) -> io::Result<u32>;
    /// Describes a buffer.
    fn query_buffer(&mut self, index: u32) -> io::Result<BufferInfo>;
    /// Maps a plane of a buffer.
    fn map_plane(&mut self, span: Span) -> io::Result<Self::Memory>;
    /// Ensures that the first `bytes` of a dequeued buffer's plane do not change until the buffer is queued again.
    fn snapshot(&mut self, memory: &mut Self::Memory, bytes: usize) {
        let _ = (memory, bytes);
    }
    /// Passes a buffer to the driver.
    fn queue_buffer(&mut self, index: u32) -> io::Result<()>;
    /// Dequeues the oldest filled buffer; fails with [`io::ErrorKind::WouldBlock`] if no buffer is filled.
    fn dequeue_buffer(&mut self) -> io::Result<Dequeued>;
    fn stream_on(&mut self) -> io::Result<()>;
    /// Stops the stream; all buffers are returned.
    fn stream_off(&mut self) -> io::Result<()>;
    /// Waits until there is something to dequeue, an error included.
    fn wait(&mut self, timeout: Duration) -> io::Result<Wake>;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    TimedOut,
    /// A buffer is filled.
    Filled,
    /// An error condition; dequeuing returns its cause.
    Error,
}

/// The location of a plane's memory, in the device's address space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    pub offset: u64,
    /// Length, in bytes.
    pub length_bytes: usize,
}

/// The kernel's description of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferInfo {
    pub planes: [Span; MAX_PLANES],
    /// Number of valid entries in `planes`.
    pub plane_count: usize,
    /// Whether the driver owns it, to fill or filled.
    pub in_kernel: bool,
}

/// The capture queue of an open device.
#[derive(Debug)]
pub struct DeviceKernel {
    device: Device,
    kind: QueueKind,
    writer: Writer,
}

/// Writer of a device's buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writer {
    /// A driver, which does not touch a buffer from its dequeuing until it is queued again, as V4L2 demands.
    Driver,
    /// Another program through v4l2loopback, which cycles through its buffers whether or not a reader holds them.
    Program,
}

/// A mapped, readable region of a device's memory.
#[derive(Debug)]
pub struct Mapping {
    address: *mut std::ffi::c_void,
    length_bytes: usize,
    /// Copy to read from, where the memory may change meanwhile.
    copy: Option<Vec<u8>>,
}

// SAFETY: the memory belongs to the process, not to a thread.
#[allow(unsafe_code)]
unsafe impl Send for Mapping {}

/// A buffer's description together with the planes that it points to. The pointer is valid only during an ioctl: it
/// dangles once the value has moved.
struct Buffer {
    head: sys::v4l2_buffer,
    planes: [sys::v4l2_plane; MAX_PLANES],
}

impl DeviceKernel {
    /// Creates the queue of `kind` of a device.
    pub fn new(device: Device, kind: QueueKind, writer: Writer) -> Self {
        Self { device, kind, writer }
    }

    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Issues `request` (QUERYBUF, QBUF or DQBUF) for a buffer; returns what the driver filled in.
    fn buffer_ioctl(&self, request: Request, index: u32) -> io::Result<Buffer> {
        let mut buffer = Buffer { head: zeroed(), planes: [zeroed(); MAX_PLANES] };
        buffer.head.index = index;
        buffer.head.type_ = self.kind.buffer_type();
        buffer.head.memory = sys::v4l2_memory_V4L2_MEMORY_MMAP;
        if self.kind == QueueKind::MultiPlanar {
            buffer.head.length = MAX_PLANES as u32;
            buffer.head.m.planes = buffer.planes.as_mut_ptr();
        }
        // SAFETY: all three requests take a `v4l2_buffer`. Its pointer, used with a multi-planar queue only, leads to
        // the number of planes that its length says, which live until after the call.
        #[allow(unsafe_code)]
        unsafe {
            self.device.ioctl(request, &mut buffer.head)?;
        }
        Ok(buffer)
    }

    fn plane_count(&self, buffer: &Buffer) -> usize {
        match self.kind {
            QueueKind::SinglePlanar => 1,
            QueueKind::MultiPlanar => (buffer.head.length as usize).min(MAX_PLANES),
        }
    }
}

impl Kernel for DeviceKernel {
    type Memory = Mapping;

    fn request_buffers(&mut self, count: u32) -> io::Result<u32> {
        let mut request = zeroed::<sys::v4l2_requestbuffers>();
        (request.count, request.type_) = (count, self.kind.buffer_type());
        request.memory = sys::v4l2_memory_V4L2_MEMORY_MMAP;
        self.device.request_buffers(&mut request)?;
        Ok(request.count)
    }

    fn query_buffer(&mut self, index: u32) -> io::Result<BufferInfo> {
        let buffer = self.buffer_ioctl(vidioc::VIDIOC_QUERYBUF as Request, index)?;
        let plane_count = self.plane_count(&buffer);
        let mut planes = [Span::default(); MAX_PLANES];
        // SAFETY: the members read are integers, and with MMAP memory the kernel writes these.
        #[allow(unsafe_code)]
        unsafe {
            match self.kind {
                QueueKind::SinglePlanar => {
                    let offset = u64::from(buffer.head.m.offset);
                    planes[0] = Span { offset, length_bytes: buffer.head.length as usize };
                }
                QueueKind::MultiPlanar => {
                    for (span, plane) in planes.iter_mut().zip(&buffer.planes[..plane_count]) {
                        let offset = u64::from(plane.m.mem_offset);
                        *span = Span { offset, length_bytes: plane.length as usize };
                    }
                }
            }
        }
        let in_kernel = buffer.head.flags & (sys::V4L2_BUF_FLAG_QUEUED | sys::V4L2_BUF_FLAG_DONE) != 0;
        Ok(BufferInfo { planes, plane_count, in_kernel })
    }

    fn map_plane(&mut self, span: Span) -> io::Result<Mapping> {
        let Span { offset, length_bytes } = span;
        // SAFETY: a new mapping at an address that the kernel chooses disturbs no other memory.
        #[allow(unsafe_code)]
        let address = unsafe {
            mmap(std::ptr::null_mut(), length_bytes, ProtFlags::READ, MapFlags::SHARED, self.device.as_fd(), offset)?
        };
        let copy = (self.writer == Writer::Program).then(|| vec![0; length_bytes]);
        Ok(Mapping { address, length_bytes, copy })
    }

    fn snapshot(&mut self, memory: &mut Mapping, bytes: usize) {
        memory.snapshot(bytes);
    }

    fn queue_buffer(&mut self, index: u32) -> io::Result<()> {
        self.buffer_ioctl(vidioc::VIDIOC_QBUF as Request, index).map(drop)
    }

    fn dequeue_buffer(&mut self) -> io::Result<Dequeued> {
        let buffer = self.buffer_ioctl(vidioc::VIDIOC_DQBUF as Request, 0)?;
        let mut filled = [ByteRange::default(); MAX_PLANES];
        match self.kind {
            QueueKind::SinglePlanar => filled[0] = ByteRange { start: 0, end: buffer.head.bytesused as usize },
            QueueKind::MultiPlanar => {
                for (range, plane) in filled.iter_mut().zip(&buffer.planes) {
                    // `bytesused` counts from the plane's first byte, not from `data_offset`.
                    *range = ByteRange { start: plane.data_offset as usize, end: plane.bytesused as usize };
                }
            }
        }
        let flags = buffer.head.flags;
        let monotonic = flags & sys::V4L2_BUF_FLAG_TIMESTAMP_MASK == sys::V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        let stamp = buffer.head.timestamp;
        let stamp_ns = stamp.tv_sec as u64 * 1_000_000_000 + stamp.tv_usec as u64 * 1000;
        Ok(Dequeued {
            index: buffer.head.index,
            sequence: buffer.head.sequence,
            // Other clocks cannot be compared with ours, and 0 means no time.
            stamp_ns: (monotonic && stamp_ns > 0).then_some(stamp_ns),
            flagged: flags & sys::V4L2_BUF_FLAG_ERROR != 0,
            filled,
        })
    }

    fn stream_on(&mut self) -> io::Result<()> {
        self.device.stream_on(&mut (self.kind.buffer_type() as i32))
    }

    fn stream_off(&mut self) -> io::Result<()> {
        self.device.stream_off(&mut (self.kind.buffer_type() as i32))
    }

    fn wait(&mut self, timeout: Duration) -> io::Result<Wake> {
        let timeout = Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: timeout.subsec_nanos().into() };
        // Errors are reported without being requested. No events are subscribed to, so PRI, too, is an error.
        let mut fds = [PollFd::new(&self.device, PollFlags::IN)];
        if poll(&mut fds, Some(&timeout))? == 0 {
            return Ok(Wake::TimedOut);
        }
        let woken = fds[0].revents();
        let errors = PollFlags::ERR | PollFlags::HUP | PollFlags::NVAL | PollFlags::PRI;
        Ok(if woken.intersects(errors) { Wake::Error } else { Wake::Filled })
    }
}

impl Mapping {
    /// Copies the first `bytes` if another program may overwrite them. A write during the copy may tear the picture,
    /// but later writes do not affect it.
    fn snapshot(&mut self, bytes: usize) {
        let Some(copy) = &mut self.copy else { return };
        let bytes = bytes.min(self.length_bytes);
        // Copied by words, since volatile reads of single bytes would be slow.
        let (words, rest) = copy[..bytes].as_chunks_mut::<{ size_of::<u64>() }>();
        let (address, rest_at) = (self.address.cast::<u64>(), words.len() * size_of::<u64>());
        for (k, word) in words.iter_mut().enumerate() {
            // SAFETY: within the mapping, which is page-aligned. Volatile, as other programs write to it.
            #[allow(unsafe_code)]
            let value = unsafe { address.add(k).read_volatile() };
            *word = value.to_ne_bytes();
        }
        for (k, byte) in rest.iter_mut().enumerate() {
            // SAFETY: as above.
            #[allow(unsafe_code)]
            let value = unsafe { self.address.cast::<u8>().add(rest_at + k).read_volatile() };
            *byte = value;
        }
    }
}

impl AsRef<[u8]> for Mapping {
    fn as_ref(&self) -> &[u8] {
        if let Some(copy) = &self.copy {
            return copy;
        }
        // SAFETY: the mapping is readable, of this length, and lives until this value is dropped. A driver writes to it
        // only while it owns the buffer, and the queue reads no buffer then; where others write, `copy` is read
        // instead.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(self.address.cast::<u8>(), self.length_bytes)
        }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: mapped once, with this length, and nothing borrows from it any longer.
        #[allow(unsafe_code)]
        let unmapped = unsafe { munmap(self.address, self.length_bytes) };
        if let Err(error) = unmapped {
            tracing::debug!("a camera's buffer cannot be unmapped: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Seek, Write};

    use super::*;

    #[test]
    fn what_is_read_of_another_programs_buffer_stays_as_it_was() {
        let bytes: Vec<u8> = (0..1003).map(|k| k as u8).collect();
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&bytes).unwrap();
        let device = Device::open(file.path()).unwrap();
        let mut kernel = DeviceKernel::new(device, QueueKind::SinglePlanar, Writer::Program);
        let mut memory = kernel.map_plane(Span { offset: 0, length_bytes: bytes.len() }).unwrap();
        kernel.snapshot(&mut memory, bytes.len());
        // The writer overwrites the buffer.
        file.rewind().unwrap();
        file.write_all(&vec![0xff; bytes.len()]).unwrap();
        assert_eq!(memory.as_ref(), bytes);
        kernel.snapshot(&mut memory, 5);
        assert_eq!((&memory.as_ref()[..5], &memory.as_ref()[5..]), (&[0xff; 5][..], &bytes[5..]));
    }
}
