//! A camera with memory of its own, as libcamera's are: NV12 with padded rows, in DMA-BUFs, of one size.

use std::ffi::c_void;
use std::fs::File;
use std::io::{Cursor, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use bokehcam_live::pipewire::bindings::properties::properties;
use bokehcam_live::pipewire::bindings::spa::buffer::{Data, DataType};
use bokehcam_live::pipewire::bindings::spa::param::ParamType;
use bokehcam_live::pipewire::bindings::spa::pod::serialize::PodSerializer;
use bokehcam_live::pipewire::bindings::spa::pod::{ChoiceValue, Object, Pod, Property, Value};
use bokehcam_live::pipewire::bindings::spa::sys as spa;
use bokehcam_live::pipewire::bindings::spa::utils::{Choice, ChoiceEnum, ChoiceFlags, Direction, SpaTypes};
use bokehcam_live::pipewire::bindings::stream::{Stream, StreamFlags, StreamRc, StreamState};
use bokehcam_live::pipewire::bindings::sys::pw_buffer;
use bokehcam_live::pipewire::mode::NegotiatedFormat;
use bokehcam_live::pipewire::param;
use bokehcam_live::pipewire::session::Session;
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
use rustix::ioctl::{Ioctl, IoctlOutput, Opcode, ioctl, opcode};

use super::session::{node, until};

pub const NAME: &str = "own-memory";
/// The only size.
pub const SIZE: (usize, usize) = (800, 450);
const PERIOD: Duration = Duration::from_millis(30);

/// How a camera gives its pictures, which are always the same one.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Types of memory that it offers, as bits; it prefers DMA-BUFs.
    pub types: u32,
    /// Bytes per row.
    pub stride: usize,
    /// Whether luma and chroma are planes of their own, in one file.
    pub in_two_planes: bool,
    /// Whether all but every fourth picture are damaged.
    pub is_faulty: bool,
}

pub const DMA_BUF: u32 = 1 << spa::SPA_DATA_DmaBuf;
pub const MEM_FD: u32 = 1 << spa::SPA_DATA_MemFd;

/// A camera on a thread of its own, until it is dropped.
pub struct OwnMemory {
    stop: Arc<AtomicBool>,
    /// Types of memory that its reader asked for, as bits.
    asked_types: Arc<AtomicU32>,
    thread: Option<JoinHandle<()>>,
}

impl OwnMemory {
    pub fn start(layout: Layout) -> Self {
        let (stop, asked_types) = (Arc::<AtomicBool>::default(), Arc::<AtomicU32>::default());
        let (end, asked) = (Arc::clone(&stop), Arc::clone(&asked_types));
        let thread = std::thread::spawn(move || serve(layout, &end, &asked));
        until("the camera", || node(NAME));
        Self { stop, asked_types, thread: Some(thread) }
    }

    /// Returns the types of memory that its last reader asked for, as bits.
    pub fn asked_types(&self) -> u32 {
        self.asked_types.load(Ordering::Acquire)
    }
}

impl Drop for OwnMemory {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
        until("the camera to go", || node(NAME).is_none().then_some(()));
    }
}

fn serve(layout: Layout, stop: &AtomicBool, asked_types: &Arc<AtomicU32>) {
    let session = Session::open().unwrap();
    let props = properties! {
        "media.class" => "Video/Source",
        "media.role" => "Camera",
        "node.name" => NAME,
        "node.description" => "Own memory",
    };
    let stream = StreamRc::new(session.core.clone(), NAME, props).unwrap();
    let asked = Arc::clone(asked_types);
    let mut pictures = 0;
    let _listener = stream
        .add_local_listener::<()>()
        .param_changed(move |stream, (), id, format| {
            if format.is_some() && id == ParamType::Format.as_raw() {
                let buffers = layout.buffers();
                stream.update_params(&mut [Pod::from_bytes(&buffers).unwrap()]).unwrap();
            }
        })
        .add_buffer(move |_, (), buffer| {
            let planes = planes(buffer);
            asked.store(planes[0].as_raw().type_, Ordering::Release);
            layout.give_memory(planes);
        })
        .remove_buffer(|_, (), buffer| {
            // SAFETY: `give_memory` left the file to the buffer, and its planes share it.
            #[allow(unsafe_code)]
            drop(unsafe { OwnedFd::from_raw_fd(planes(buffer)[0].fd()) });
        })
        .process(move |stream, ()| {
            layout.give_picture(stream, pictures);
            pictures += 1;
        })
        .register()
        .unwrap();
    let size = (SIZE.0 as u32, SIZE.1 as u32);
    let format = param::build_format(&NegotiatedFormat { fourcc: *b"NV12", size, rate: (30, 1) });
    let flags = StreamFlags::DRIVER | StreamFlags::ALLOC_BUFFERS;
    stream.connect(Direction::Output, None, flags, &mut [Pod::from_bytes(&format).unwrap()]).unwrap();
    while !stop.load(Ordering::Acquire) {
        session.iterate(Some(PERIOD));
        if stream.state() == StreamState::Streaming {
            stream.trigger_process().unwrap();
            std::thread::sleep(PERIOD);
        }
    }
}

/// Returns the planes of a buffer.
fn planes<'a>(buffer: *mut pw_buffer) -> &'a mut [Data] {
    // SAFETY: PipeWire passes a buffer that it adds or removes, on the stream's thread. `Data` is a transparent wrapper.
    #[allow(unsafe_code)]
    unsafe {
        let buffer = (*buffer).buffer;
        std::slice::from_raw_parts_mut((*buffer).datas.cast::<Data>(), (*buffer).n_datas as usize)
    }
}

impl Layout {
    /// Offset and size of each plane in a file.
    fn spans(&self) -> Vec<(usize, usize)> {
        let [luma, chroma] = [SIZE.1, SIZE.1 / 2].map(|rows| rows * self.stride);
        if self.in_two_planes { vec![(0, luma), (luma, chroma)] } else { vec![(0, luma + chroma)] }
    }

    /// Describes the buffers.
    fn buffers(&self) -> Vec<u8> {
        let property = |key: u32, value: i32| Property::new(key, Value::Int(value));
        let types = Choice(ChoiceFlags::empty(), ChoiceEnum::Flags { default: self.types as i32, flags: vec![] });
        let properties = vec![
            property(spa::SPA_PARAM_BUFFERS_buffers, 4),
            property(spa::SPA_PARAM_BUFFERS_blocks, self.spans().len() as i32),
            property(spa::SPA_PARAM_BUFFERS_size, (self.stride * SIZE.1 * 3 / 2) as i32),
            property(spa::SPA_PARAM_BUFFERS_stride, self.stride as i32),
            Property::new(spa::SPA_PARAM_BUFFERS_dataType, Value::Choice(ChoiceValue::Int(types))),
        ];
        let (type_, id) = (SpaTypes::ObjectParamBuffers.as_raw(), ParamType::Buffers.as_raw());
        let object = Value::Object(Object { type_, id, properties });
        PodSerializer::serialize(Cursor::new(Vec::new()), &object).unwrap().0.into_inner()
    }

    /// Draws the picture: padding is of another colour than all else.
    fn draw(&self) -> Vec<u8> {
        let row = |samples: Vec<u8>| samples.into_iter().chain(std::iter::repeat(0xee)).take(self.stride);
        let luma = (0..SIZE.1).flat_map(|y| row((0..SIZE.0).map(|x| (40 + (x / 8 + 3 * y / 8) % 160) as u8).collect()));
        let chroma = (0..SIZE.1 / 2)
            .flat_map(|y| row((0..SIZE.0).map(|x| if x % 2 == 0 { 90 + x / 20 } else { 90 + y / 4 } as u8).collect()));
        luma.chain(chroma).collect()
    }

    /// Creates a file with the picture, and gives it to a buffer.
    fn give_memory(&self, planes: &mut [Data]) {
        let is_dma_buf = planes[0].as_raw().type_ & self.types & DMA_BUF != 0;
        let memory = memfd_create(NAME, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING).unwrap();
        let mut file = File::from(memory);
        file.write_all(&self.draw()).unwrap();
        let file = if is_dma_buf { to_dma_buf(file) } else { file };
        for (plane, (_, size)) in planes.iter_mut().zip(self.spans()) {
            let plane: *mut spa::spa_data = std::ptr::from_mut(plane).cast();
            // SAFETY: `Data` is a transparent wrapper, and a buffer that is added belongs to the camera.
            #[allow(unsafe_code)]
            let plane = unsafe { &mut *plane };
            plane.type_ = if is_dma_buf { DataType::DmaBuf } else { DataType::MemFd }.as_raw();
            plane.flags = spa::SPA_DATA_FLAG_READABLE;
            plane.fd = file.as_raw_fd().into();
            plane.mapoffset = 0;
            // As libcamera: the plane's length, wherever it begins.
            plane.maxsize = size as u32;
            plane.data = std::ptr::null_mut();
        }
        // Closed when PipeWire removes the buffer.
        std::mem::forget(file);
    }

    fn give_picture(&self, stream: &Stream, number: usize) {
        let Some(mut buffer) = stream.dequeue_buffer() else { return };
        for (plane, (offset, size)) in buffer.datas_mut().iter_mut().zip(self.spans()) {
            let (mut offset, mut size, mut stride) = (offset as u32, size as u32, self.stride as i32);
            match number % 4 {
                _ if !self.is_faulty => (),
                0 => (),
                1 => stride = SIZE.0 as i32 - 2,
                2 => size /= 2,
                _ => (offset, size, stride) = (u32::MAX - 4096, u32::MAX, -stride * (number as i32 / 4 % 2)),
            }
            let chunk = plane.chunk_mut();
            (*chunk.offset_mut(), *chunk.size_mut(), *chunk.stride_mut()) = (offset, size, stride);
        }
    }
}

/// UDMABUF_CREATE (linux/udmabuf.h).
#[repr(C)]
struct UdmabufCreate {
    memfd: u32,
    flags: u32,
    offset: u64,
    size: u64,
}

// SAFETY: the kernel reads the struct, and returns a new descriptor.
#[allow(unsafe_code)]
unsafe impl Ioctl for UdmabufCreate {
    type Output = RawFd;
    const IS_MUTATING: bool = false;

    fn opcode(&self) -> Opcode {
        opcode::write::<Self>(b'u', 0x42)
    }

    fn as_ptr(&mut self) -> *mut c_void {
        std::ptr::from_mut(self).cast()
    }

    unsafe fn output_from_ptr(made: IoctlOutput, _: *mut c_void) -> rustix::io::Result<RawFd> {
        Ok(made)
    }
}

/// Returns a DMA-BUF of a memory file's pages; the file itself where the kernel makes none (`/dev/udmabuf`).
fn to_dma_buf(memory: File) -> File {
    let Ok(device) = File::options().read(true).write(true).open("/dev/udmabuf") else { return memory };
    let size = memory.metadata().unwrap().len().next_multiple_of(1 << 16);
    memory.set_len(size).unwrap();
    fcntl_add_seals(&memory, SealFlags::SHRINK).unwrap();
    let create = UdmabufCreate { memfd: memory.as_raw_fd() as u32, flags: 1, offset: 0, size };
    // SAFETY: this is the device of the ioctl, whose descriptor is new.
    #[allow(unsafe_code)]
    unsafe {
        File::from_raw_fd(ioctl(&device, create).unwrap())
    }
}
