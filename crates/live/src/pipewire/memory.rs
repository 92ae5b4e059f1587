//! The memory of a camera's pictures, mapped for reading.
//!
//! Cameras of libcamera and V4L2 share DMA-BUFs, which a processor may read between two calls of an ioctl. PipeWire calls
//! them `DmaBuf`, or `MemFd` for readers that prefer it. Its flag MAP_BUFFERS maps the latter, and some versions the
//! former, but not all that libcamera's chunks name: the planes of a picture may share one DMA-BUF, and `maxsize` is then
//! the length of a plane, wherever it begins. So this module maps what the chunks name, within the size of the file.

use std::ffi::c_void;
use std::os::fd::{BorrowedFd, RawFd};
use std::{ptr, slice};

use pipewire::spa::buffer::{ChunkFlags, Data, DataType};
use rustix::fs::{SeekFrom, fstat, seek};
use rustix::io::Errno;
use rustix::ioctl::{Opcode, Setter, ioctl, opcode};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use crate::layout::MAX_PLANES;

/// DMA_BUF_IOCTL_SYNC and its flags (linux/dma-buf.h).
const SYNC: Opcode = opcode::write::<u64>(b'b', 0);
const SYNC_READ: u64 = 1;
const SYNC_END: u64 = 4;
/// Maximum number of calls for one synchronisation: each may be interrupted.
const MAX_SYNC_CALLS: usize = 1000;
/// Alignment of mappings in their file: a multiple of every page size.
const ALIGNMENT: u64 = 1 << 16;

/// The mappings of a stream's buffers, which are kept for the following pictures.
#[derive(Default)]
pub struct BufferMemory {
    mappings: Vec<Mapping>,
}

/// The planes of a picture, readable until this is dropped.
pub struct Picture<'a> {
    planes: [&'a [u8]; MAX_PLANES],
    strides_bytes: [usize; MAX_PLANES],
    count: usize,
    /// DMA-BUFs whose reading has begun.
    begun: [Option<RawFd>; MAX_PLANES],
}

impl<'a> Picture<'a> {
    /// The used bytes of each plane.
    pub fn planes(&self) -> &[&'a [u8]] {
        &self.planes[..self.count]
    }

    /// Bytes per row of each plane; 0 if not stated.
    pub fn strides_bytes(&self) -> &[usize] {
        &self.strides_bytes[..self.count]
    }
}

impl Drop for Picture<'_> {
    fn drop(&mut self) {
        for file in self.begun.iter().flatten() {
            // A failure concerns only what was written, which is nothing.
            let _ = sync(*file, SYNC_READ | SYNC_END);
        }
    }
}

impl BufferMemory {
    /// Removes all mappings. PipeWire may reuse the descriptors of removed buffers.
    pub fn clear(&mut self) {
        self.mappings.clear();
    }

    /// Begins to read the picture in the planes `datas` of a dequeued buffer; `None` if it is damaged: empty, marked as
    /// corrupt, or not within its memory.
    pub fn read<'a>(&'a mut self, datas: &'a mut [Data]) -> Option<Picture<'a>> {
        let count = datas.len().min(MAX_PLANES);
        let mut picture = Picture { planes: [&[]; _], strides_bytes: [0; _], count, begun: [None; _] };
        let mut spans = [Span::default(); MAX_PLANES];
        for (index, data) in datas[..count].iter().enumerate() {
            let span = Span::new(data)?;
            if is_file(data) {
                let mapping = self.map(data, span)?;
                let file = data.fd();
                if mapping.needs_sync && !picture.begun.contains(&Some(file)) {
                    match sync(file, SYNC_READ) {
                        Ok(()) => picture.begun[index] = Some(file),
                        Err(Errno::NOTTY) => mapping.needs_sync = false,
                        Err(_) => return None,
                    }
                }
            }
            (spans[index], picture.strides_bytes[index]) = (span, span.stride_bytes);
        }
        let mappings = &self.mappings;
        for ((plane, data), span) in picture.planes.iter_mut().zip(&mut *datas).zip(spans) {
            *plane = if is_file(data) {
                mappings.iter().find(|mapping| mapping.is_of(data))?.bytes(data, span)?
            } else {
                data.data()?.get(span.offset_bytes..)?.get(..span.size_bytes)?
            };
        }
        (count > 0).then_some(picture)
    }

    /// Returns a mapping that holds `span`; `None` if the file is shorter, or cannot be mapped.
    fn map(&mut self, data: &Data, span: Span) -> Option<&mut Mapping> {
        let known = self.mappings.iter().position(|mapping| mapping.is_of(data));
        let index = match known.filter(|&index| self.mappings[index].bytes(data, span).is_some()) {
            Some(index) => index,
            None => {
                let mapping = Mapping::new(data, span)?;
                known.map(|index| self.mappings.swap_remove(index));
                self.mappings.push(mapping);
                self.mappings.len() - 1
            }
        };
        Some(&mut self.mappings[index])
    }
}

/// The used bytes of a plane, from where PipeWire says that its memory begins.
#[derive(Clone, Copy, Default)]
struct Span {
    offset_bytes: usize,
    size_bytes: usize,
    stride_bytes: usize,
}

impl Span {
    /// Reads a chunk, once, as the camera may change it at any time; `None` if it is marked as corrupt, empty, or has rows
    /// from the bottom upwards.
    fn new(data: &Data) -> Option<Self> {
        let chunk = data.chunk();
        let (offset, size) = (chunk.offset(), chunk.size().min(data.as_raw().maxsize));
        let is_usable = !chunk.flags().contains(ChunkFlags::CORRUPTED) && size > 0;
        let stride_bytes = usize::try_from(chunk.stride()).ok().filter(|_| is_usable)?;
        Some(Self { offset_bytes: offset as usize, size_bytes: size as usize, stride_bytes })
    }

    fn end_bytes(self) -> u64 {
        self.offset_bytes as u64 + self.size_bytes as u64
    }
}

/// Mapped bytes of a file.
struct Mapping {
    /// PipeWire's description of the plane, which only identifies it.
    plane: *const Data,
    file: RawFd,
    start: *mut c_void,
    /// Offset of `start` in the file.
    offset: u64,
    length_bytes: usize,
    /// Whether the file may be a DMA-BUF.
    needs_sync: bool,
}

impl Mapping {
    fn new(data: &Data, span: Span) -> Option<Self> {
        // SAFETY: the descriptor is PipeWire's, which keeps it open until it removes the buffer.
        #[allow(unsafe_code)]
        let file = unsafe { BorrowedFd::borrow_raw(data.fd()) };
        // Older kernels tell a DMA-BUF's size only by seeking. What tells none is a device, which maps nothing beyond its
        // memory.
        let stated = fstat(file).map_or(0, |status| u64::try_from(status.st_size).unwrap_or(0));
        let file_bytes = if stated > 0 { stated } else { seek(file, SeekFrom::End(0)).unwrap_or(u64::MAX) };
        let first = u64::from(data.as_raw().mapoffset);
        let end = (first + span.end_bytes().max(data.as_raw().maxsize.into())).min(file_bytes);
        let offset = first - first % ALIGNMENT;
        let length_bytes =
            usize::try_from(end.checked_sub(offset)?).ok().filter(|_| first + span.end_bytes() <= end)?;
        // SAFETY: a new mapping, at an address that the kernel chooses.
        #[allow(unsafe_code)]
        let start =
            unsafe { mmap(ptr::null_mut(), length_bytes, ProtFlags::READ, MapFlags::SHARED, file, offset) }.ok()?;
        Some(Self { plane: data, file: data.fd(), start, offset, length_bytes, needs_sync: true })
    }

    fn is_of(&self, data: &Data) -> bool {
        ptr::eq(self.plane, data)
    }

    /// Returns the bytes of `span`; `None` if not all are mapped.
    fn bytes(&self, data: &Data, span: Span) -> Option<&[u8]> {
        if self.file != data.fd() {
            return None;
        }
        let skipped = usize::try_from(u64::from(data.as_raw().mapoffset).checked_sub(self.offset)?).ok()?;
        // SAFETY: `start` is a mapping of `length_bytes`, within the size of its file, until `drop`. The camera writes to
        // it only while it has the buffer, and shrinks no file that it shares.
        #[allow(unsafe_code)]
        let mapped = unsafe { slice::from_raw_parts(self.start.cast::<u8>(), self.length_bytes) };
        mapped.get(skipped..)?.get(span.offset_bytes..)?.get(..span.size_bytes)
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: `new` mapped it, and what `bytes` returned borrows this.
        #[allow(unsafe_code)]
        let unmapped = unsafe { munmap(self.start, self.length_bytes) };
        debug_assert!(unmapped.is_ok(), "{unmapped:?}");
    }
}

/// Whether a plane lies in a file, and not in memory that PipeWire has mapped.
fn is_file(data: &Data) -> bool {
    matches!(data.type_(), DataType::MemFd | DataType::DmaBuf)
}

/// Begins or ends reading from a DMA-BUF.
///
/// # Errors
/// [`Errno::NOTTY`] for any other file; or the driver refuses.
fn sync(file: RawFd, flags: u64) -> Result<(), Errno> {
    // SAFETY: the descriptor belongs to a dequeued buffer, which PipeWire keeps open; the ioctl reads one `u64`. For files
    // other than DMA-BUFs, it is not defined.
    #[allow(unsafe_code)]
    let call = || unsafe { ioctl(BorrowedFd::borrow_raw(file), Setter::<SYNC, u64>::new(flags)) };
    repeat_interrupted(call)
}

/// Repeats a system call that was interrupted, as often as [`MAX_SYNC_CALLS`].
fn repeat_interrupted(call: impl FnMut() -> Result<(), Errno>) -> Result<(), Errno> {
    let is_over = |result: &Result<(), Errno>| !matches!(result, Err(Errno::INTR | Errno::AGAIN));
    std::iter::repeat_with(call).take(MAX_SYNC_CALLS).find(is_over).unwrap_or(Err(Errno::INTR))
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;
    use std::os::fd::AsRawFd;

    use pipewire::spa::sys;
    use rustix::fs::{MemfdFlags, memfd_create};

    use super::*;

    const FILE_BYTES: usize = 300_000;

    /// A plane in a file of [`FILE_BYTES`] pseudo-random bytes, with a chunk.
    struct Plane {
        bytes: Vec<u8>,
        _file: File,
        chunk: Box<sys::spa_chunk>,
        data: sys::spa_data,
    }

    impl Plane {
        fn new(kind: DataType, mapoffset: u32, maxsize: u32) -> Self {
            let bytes: Vec<u8> = (0..FILE_BYTES).map(|at| (at * at / 7 + at / 251) as u8).collect();
            let mut file = File::from(memfd_create("plane", MemfdFlags::CLOEXEC).unwrap());
            file.write_all(&bytes).unwrap();
            let mut chunk = Box::new(sys::spa_chunk { offset: 0, size: 0, stride: 0, flags: 0 });
            let (type_, fd, chunk_start) = (kind.as_raw(), file.as_raw_fd().into(), &raw mut *chunk);
            let data = ptr::null_mut();
            let data = sys::spa_data { type_, flags: 0, fd, mapoffset, maxsize, data, chunk: chunk_start };
            Self { bytes, _file: file, chunk, data }
        }

        /// Reads a picture from `offset` on; returns where in the file it was read.
        fn read(&mut self, memory: &mut BufferMemory, offset: u32, size: u32) -> Option<std::ops::Range<usize>> {
            (self.chunk.offset, self.chunk.size) = (offset, size);
            // SAFETY: `Data` is a transparent wrapper.
            #[allow(unsafe_code)]
            let datas = unsafe { slice::from_raw_parts_mut((&raw mut self.data).cast::<Data>(), 1) };
            let picture = memory.read(datas)?;
            let [read] = picture.planes() else { panic!("one plane") };
            let start = self.data.mapoffset as usize + offset as usize;
            assert!(*read == &self.bytes[start..start + read.len()], "from {start}");
            Some(start..start + read.len())
        }
    }

    #[test]
    fn chunks_are_read_within_their_file_only() {
        for kind in [DataType::MemFd, DataType::DmaBuf] {
            for mapoffset in [0, 5000, 65_536 + 17] {
                let mut memory = BufferMemory::default();
                let mut plane = Plane::new(kind, mapoffset, 100_000);
                let start = mapoffset as usize;
                let end = FILE_BYTES as u32 - mapoffset;
                assert_eq!(plane.read(&mut memory, 0, 1000), Some(start..start + 1000));
                assert_eq!(plane.read(&mut memory, 64, 99_936), Some(start + 64..start + 100_000));
                // As libcamera's planes in one file, of which each states only its own length.
                assert_eq!(plane.read(&mut memory, end - 100_000, 100_000), Some(FILE_BYTES - 100_000..FILE_BYTES));
                assert_eq!(plane.read(&mut memory, 0, u32::MAX), Some(start..start + 100_000), "the plane's length");
                for (offset, size) in [(0, 0), (end - 99_999, 100_000), (end, 1), (u32::MAX, 1), (u32::MAX, u32::MAX)] {
                    assert_eq!(plane.read(&mut memory, offset, size), None, "{size} from {offset}");
                }
                assert_eq!(memory.mappings.len(), 1, "{kind:?}");
                memory.clear();
                assert_eq!(plane.read(&mut memory, 1, 2), Some(start + 1..start + 3));
            }
        }
    }

    #[test]
    fn a_file_that_is_shorter_than_stated_is_read_up_to_its_end() {
        let mut memory = BufferMemory::default();
        let mut plane = Plane::new(DataType::DmaBuf, 0, 1_000_000);
        assert_eq!(plane.read(&mut memory, 0, FILE_BYTES as u32), Some(0..FILE_BYTES));
        assert_eq!(plane.read(&mut memory, 0, FILE_BYTES as u32 + 1), None);
        let mut empty = Plane::new(DataType::DmaBuf, 0, 1000);
        empty._file.set_len(0).unwrap();
        assert_eq!(empty.read(&mut memory, 0, 1), None);
    }

    #[test]
    fn what_a_camera_marks_as_corrupt_is_not_read() {
        let mut memory = BufferMemory::default();
        let mut plane = Plane::new(DataType::DmaBuf, 0, 1000);
        plane.chunk.stride = -100;
        assert_eq!(plane.read(&mut memory, 0, 1000), None);
        (plane.chunk.stride, plane.chunk.flags) = (100, sys::SPA_CHUNK_FLAG_CORRUPTED as i32);
        assert_eq!(plane.read(&mut memory, 0, 1000), None);
        plane.chunk.flags = 0;
        assert_eq!(plane.read(&mut memory, 0, 1000), Some(0..1000));
        plane.data.type_ = DataType::MemPtr.as_raw();
        assert_eq!(plane.read(&mut memory, 0, 1000), None, "there is no memory");
        assert!(memory.read(&mut []).is_none());
    }

    #[test]
    fn interrupted_calls_are_repeated_and_other_failures_are_not() {
        let fails = |error: Errno, times: usize| {
            let mut calls = 0;
            move || {
                calls += 1;
                if calls <= times { Err(error) } else { Ok(()) }
            }
        };
        assert_eq!(repeat_interrupted(fails(Errno::INTR, 3)), Ok(()));
        assert_eq!(repeat_interrupted(fails(Errno::AGAIN, 3)), Ok(()));
        assert_eq!(repeat_interrupted(fails(Errno::NOTTY, 1)), Err(Errno::NOTTY));
        assert_eq!(repeat_interrupted(fails(Errno::AGAIN, usize::MAX)), Err(Errno::INTR));
    }
}
