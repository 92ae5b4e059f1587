//! Access to the frames in a stream's buffers. PipeWire's bindings expose neither the header nor the end of the data,
//! so this module uses the raw structures.

use std::slice;

use pipewire::spa::sys;
use pipewire::stream::Stream;

/// Capture time of a picture, on the system's monotonic clock, and its sequence number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    pub captured_ns: u64,
    pub sequence: u64,
}

/// Lets `fill` write a frame of at most `frame_bytes` bytes into a free buffer of `stream`, with `stride` bytes per row
/// (0 if it has no rows), and queues it for the readers. `fill` returns the number of bytes used and the header.
/// Returns whether a buffer was available: readers may hold them all.
///
/// Must be called on the thread of the stream's loop.
pub fn write_frame(
    stream: &Stream,
    frame_bytes: usize,
    stride: i32,
    fill: impl FnOnce(&mut [u8]) -> (usize, Header),
) -> bool {
    // SAFETY: the buffer, if it is not null, and all that it points to belong to this program from here to
    // `queue_raw_buffer`: only the stream's loop removes buffers, and it is busy with this call. PipeWire has mapped
    // `maxsize` bytes at `data` (flag MAP_BUFFERS) or left `data` null; `chunk` and the header lie in memory that it
    // shares with the readers, which do not write to it. `find_meta_data` returns null or a header of at least the
    // requested size. `fill` returns, or the program ends: this is called from C, through which nothing unwinds.
    #[allow(unsafe_code)]
    unsafe {
        let handle = stream.dequeue_raw_buffer();
        if handle.is_null() {
            return false;
        }
        let buffer = (*handle).buffer;
        let data = if (*buffer).n_datas == 0 { std::ptr::null_mut() } else { (*buffer).datas };
        let has_room = !data.is_null() && !(*data).data.is_null() && (*data).maxsize as usize >= frame_bytes;
        if has_room {
            let (used, header) = fill(slice::from_raw_parts_mut((*data).data.cast::<u8>(), frame_bytes));
            let chunk = (*data).chunk;
            (*chunk).offset = 0;
            (*chunk).size = used.min(frame_bytes) as u32;
            (*chunk).stride = stride;
            (*chunk).flags = 0;
            let size = size_of::<sys::spa_meta_header>();
            let meta = sys::spa_buffer_find_meta_data(buffer, sys::SPA_META_Header, size);
            if let Some(meta) = meta.cast::<sys::spa_meta_header>().as_mut() {
                meta.flags = 0;
                meta.offset = 0;
                meta.pts = header.captured_ns as i64;
                meta.dts_offset = 0;
                meta.seq = header.sequence;
            }
        } else if !data.is_null() {
            // A buffer that is too small is queued empty: there is no other way to return it.
            (*(*data).chunk).size = 0;
        }
        stream.queue_raw_buffer(handle);
        has_room
    }
}
