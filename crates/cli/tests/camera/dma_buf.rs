//! A driver's DMA-BUF, as PipeWire's cameras share it.

use std::os::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
use std::path::Path;
use std::{ptr, slice};

use bokehcam_live::pipewire::bindings::spa::buffer::{Data, DataType};
use bokehcam_live::pipewire::bindings::spa::sys as spa;
use bokehcam_live::pipewire::memory::BufferMemory;
use bokehcam_live::v4l2::device::{Device, Request};
use rustix::fs::{OFlags, SeekFrom, seek};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc::VIDIOC_EXPBUF;

/// Exports a buffer of a camera.
#[allow(unsafe_code)]
fn export(camera: &Device) -> OwnedFd {
    let (type_, memory) = (sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE, sys::v4l2_memory_V4L2_MEMORY_MMAP);
    // SAFETY: all zero is a value of these structs, and the second is that of its request.
    unsafe {
        let mut buffers = sys::v4l2_requestbuffers { count: 2, type_, memory, ..std::mem::zeroed() };
        camera.request_buffers(&mut buffers).unwrap();
        let flags = (OFlags::RDWR | OFlags::CLOEXEC).bits();
        let mut exported = sys::v4l2_exportbuffer { type_, index: 0, flags, ..std::mem::zeroed() };
        camera.ioctl(VIDIOC_EXPBUF as Request, &mut exported).unwrap();
        OwnedFd::from_raw_fd(exported.fd)
    }
}

/// Fills the first bytes of a file with a pattern; returns it.
#[allow(unsafe_code)]
fn fill(file: &OwnedFd, bytes: usize) -> Vec<u8> {
    let pattern: Vec<u8> = (0..bytes).map(|at| (at * at / 3) as u8).collect();
    // SAFETY: a new mapping, which nothing else refers to.
    unsafe {
        let start = mmap(ptr::null_mut(), bytes, ProtFlags::WRITE, MapFlags::SHARED, file.as_fd(), 0).unwrap();
        start.cast::<u8>().copy_from(pattern.as_ptr(), bytes);
        munmap(start, bytes).unwrap();
    }
    pattern
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn what_a_driver_exports_is_read_within_its_size() {
    const BYTES: u32 = 100_000;
    let camera = Device::open(Path::new("/dev/video0")).unwrap();
    let file = export(&camera);
    let size = u32::try_from(seek(&file, SeekFrom::End(0)).unwrap()).unwrap();
    assert!(size > BYTES, "{size}");
    let pattern = fill(&file, BYTES as usize);
    let mut memory = BufferMemory::default();
    let mut read = |kind: DataType, offset, bytes| {
        let mut chunk = spa::spa_chunk { offset, size: bytes, stride: 0, flags: 0 };
        let (type_, fd, data) = (kind.as_raw(), file.as_raw_fd().into(), ptr::null_mut());
        let mut plane = spa::spa_data { type_, flags: 0, fd, mapoffset: 0, maxsize: bytes, data, chunk: &mut chunk };
        // SAFETY: `Data` is a transparent wrapper.
        #[allow(unsafe_code)]
        let planes = unsafe { slice::from_raw_parts_mut((&raw mut plane).cast::<Data>(), 1) };
        let bytes = memory.read(planes).map(|picture| picture.planes()[0].to_vec());
        memory.clear();
        bytes
    };
    // PipeWire names it so, or so.
    for kind in [DataType::DmaBuf, DataType::MemFd] {
        assert_eq!(read(kind, 0, BYTES).as_ref(), Some(&pattern));
        assert_eq!(read(kind, 50_000, 50_000).as_deref(), Some(&pattern[50_000..]));
        assert_eq!(read(kind, size - 10, 10).map(|bytes| bytes.len()), Some(10));
        assert_eq!(read(kind, size - 10, 11), None);
    }
}
