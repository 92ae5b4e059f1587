//! Virtual cameras of the kernel module v4l2loopback: programs read the frames written to a node as those of a camera.

mod error;

use std::fs;
use std::io;
use std::os::fd::AsFd;
use std::path::Path;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use v4l::v4l_sys as sys;

pub use self::error::{LoopbackError, list_nodes, modprobe_command};

use super::device::{Device, zeroed};
use super::holders::list_other_holders;

// A node's reported capabilities depend on its users; its driver name does not.
pub use super::node::LOOPBACK_DRIVER as DRIVER;

const OUTPUT: u32 = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT;
/// The module's control `keep_format`.
const KEEP_FORMAT: u32 = sys::V4L2_CID_BASE | 0xf000;
/// Longest wait for space before a write is repeated; no version of the module has needed it so far.
const WRITE_TIMEOUT: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

/// Pixel format and memory layout of a frame; all without padding between rows or planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Packed Y Cb Y Cr: two pixels share their chroma (4:2:2).
    Yuyv,
    /// Three planes, chroma halved in both directions (4:2:0).
    Yu12,
    /// Two planes, chroma halved in both directions and interleaved (4:2:0).
    Nv12,
    Rgb24,
    Bgr24,
}

impl Layout {
    const ALL: [(Self, &'static [u8; 4]); 5] = [
        (Self::Yuyv, b"YUYV"),
        (Self::Yu12, b"YU12"),
        (Self::Nv12, b"NV12"),
        (Self::Rgb24, b"RGB3"),
        (Self::Bgr24, b"BGR3"),
    ];

    pub fn fourcc(self) -> &'static str {
        let code = Self::ALL.iter().find(|(layout, _)| *layout == self).map_or(b"????", |(_, code)| code);
        std::str::from_utf8(code).unwrap_or("????")
    }

    fn from_fourcc(fourcc: u32) -> Option<Self> {
        Self::ALL.iter().find(|(_, code)| u32::from_le_bytes(**code) == fourcc).map(|(layout, _)| *layout)
    }

    /// Returns the bytes of a frame. The size must be even where pixels share chroma.
    pub fn frame_bytes(self, (width, height): (u32, u32)) -> usize {
        let pixels = width as usize * height as usize;
        match self {
            Self::Yuyv => 2 * pixels,
            Self::Yu12 | Self::Nv12 => pixels + pixels / 2,
            Self::Rgb24 | Self::Bgr24 => 3 * pixels,
        }
    }

    /// Whether frames of this size fit the layout: sides along which pixels share chroma must be even.
    fn fits_size(self, (width, height): (u32, u32)) -> bool {
        match self {
            Self::Yuyv => width.is_multiple_of(2),
            Self::Yu12 | Self::Nv12 => width.is_multiple_of(2) && height.is_multiple_of(2),
            Self::Rgb24 | Self::Bgr24 => true,
        }
    }
}

/// A loopback node opened for writing.
#[derive(Debug)]
pub struct Output {
    device: Arc<Device>,
    card: String,
    layout: Layout,
    size: (u32, u32),
}

/// Returns how many frames each node buffers, as set when the module was loaded; `None` if it cannot be read.
pub fn read_buffer_count() -> Option<u32> {
    let text = fs::read_to_string("/sys/module/v4l2loopback/parameters/max_buffers").ok()?;
    text.trim().parse().ok().filter(|buffers| (1..=MAX_BUFFERS).contains(buffers))
}

/// The module's upper limit.
const MAX_BUFFERS: u32 = 32;

impl Output {
    /// Opens a node and starts streaming YUYV to it, in BT.601 and limited range, which readers assume for every
    /// picture: `size` in pixels (the width even), `rate / scale` frames per second. Where a reader or a control has
    /// fixed the format, that format is used instead: see [`Output::layout`] and [`Output::size`].
    ///
    /// # Errors
    /// It is not a free node of the module, or its fixed format cannot be written.
    pub fn open(path: &Path, size: (u32, u32), (rate, scale): (u64, u64)) -> Result<Self, LoopbackError> {
        let device = Device::open(path).map_err(|cause| map_open_error(path, cause))?;
        let mut capability: sys::v4l2_capability = zeroed();
        if device.query_capability(&mut capability).is_err() {
            return Err(LoopbackError::NotVideo { path: path.to_owned() });
        }
        let card = decode_text(&capability.card);
        if decode_text(&capability.driver) != DRIVER {
            return Err(LoopbackError::NotLoopback { path: path.to_owned(), card });
        }
        let has_caps = |any: u32| capability.device_caps & any != 0;
        // With exclusive_caps, a node that reports capture but no output has a writer, unless its format is kept.
        let has_writer =
            has_caps(sys::V4L2_CAP_VIDEO_CAPTURE) && !has_caps(sys::V4L2_CAP_VIDEO_OUTPUT) && !keeps_format(&device);
        // Versions before 0.14 let several programs write, and without exclusive_caps do not show it: the lock at least
        // keeps out another instance of this program.
        let locked = flock(&device, FlockOperation::NonBlockingLockExclusive);
        if has_writer || locked.is_err_and(|error| error == Errno::WOULDBLOCK) {
            return Err(LoopbackError::InUse { path: path.to_owned(), by: list_other_holders(path) });
        }
        if !has_caps(sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_OUTPUT) {
            return Err(LoopbackError::Stuck { path: path.to_owned() });
        }
        let (layout, size) = set_format(&device, size)?;
        let mut parameters: sys::v4l2_streamparm = zeroed();
        parameters.type_ = OUTPUT;
        let saturated = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
        parameters.parm.output.timeperframe =
            sys::v4l2_fract { numerator: saturated(scale), denominator: saturated(rate) };
        // Informs readers only: the module passes frames on when they are written.
        if let Err(error) = device.set_parameters(&mut parameters) {
            tracing::debug!("{}: the frame rate cannot be set: {error}", path.display());
        }
        match device.stream_on(&mut (OUTPUT as i32)) {
            // Up to 0.13, a node that was closed without this call accepts no more frames. From 0.14 on the call needs
            // buffers first (EINVAL), and the first write starts the stream.
            Err(error) if Errno::from_io_error(&error) != Some(Errno::INVAL) => {
                return Err(map_operation_error(&device, "the stream cannot be started", error));
            }
            _ => {}
        }
        Ok(Self { device: Arc::new(device), card, layout, size })
    }

    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The name shown to users.
    pub fn card(&self) -> &str {
        &self.card
    }

    /// The pixel layout that frames must have.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Width and height of a frame, in pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Writes one frame into every buffer of the module, because a new reader first gets the buffered frames, however
    /// old.
    ///
    /// # Errors
    /// A write failed.
    pub fn fill_buffers(&self, frame: &[u8]) -> Result<(), LoopbackError> {
        (0..read_buffer_count().unwrap_or(MAX_BUFFERS)).try_for_each(|_| self.write_frame(frame))
    }

    /// Writes one frame of exactly [`Layout::frame_bytes`]. Never waits for readers: a slow reader skips to this frame.
    ///
    /// # Errors
    /// The write failed.
    pub fn write_frame(&self, frame: &[u8]) -> Result<(), LoopbackError> {
        let failed = |cause| LoopbackError::System {
            path: self.device.path().to_owned(),
            doing: "a frame cannot be written",
            cause,
        };
        let mut waited = false;
        loop {
            match rustix::io::write(&*self.device, frame) {
                Ok(written) if written == frame.len() => return Ok(()),
                Ok(written) => {
                    let short = format!("only {written} of {} bytes were taken", frame.len());
                    return Err(failed(io::Error::other(short)));
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) if !waited => {
                    waited = true;
                    let mut fds = [PollFd::from_borrowed_fd(self.device.as_fd(), PollFlags::OUT)];
                    // Space, a timeout or an error: the next write shows which.
                    let _ = poll(&mut fds, Some(&WRITE_TIMEOUT));
                }
                Err(Errno::BUSY) => {
                    return Err(map_operation_error(&self.device, "a frame cannot be written", Errno::BUSY.into()));
                }
                Err(error) => return Err(failed(error.into())),
            }
        }
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Readers stay connected; a stream that cannot be stopped ends when the node is closed.
        let _ = self.device.stream_off(&mut (OUTPUT as i32));
    }
}

/// Sets YUYV of `size` as the node's format; returns the layout and size then in effect, which differ where the format
/// is fixed.
fn set_format(device: &Device, size: (u32, u32)) -> Result<(Layout, (u32, u32)), LoopbackError> {
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = OUTPUT;
    format.fmt.pix = sys::v4l2_pix_format {
        width: size.0,
        height: size.1,
        pixelformat: u32::from_le_bytes(*b"YUYV"),
        field: sys::v4l2_field_V4L2_FIELD_NONE,
        bytesperline: 2 * size.0,
        sizeimage: Layout::Yuyv.frame_bytes(size) as u32,
        colorspace: sys::v4l2_colorspace_V4L2_COLORSPACE_SRGB,
        // Without it, the kernel treats the last fields as unset.
        priv_: sys::V4L2_PIX_FMT_PRIV_MAGIC,
        flags: 0,
        __bindgen_anon_1: sys::v4l2_pix_format__bindgen_ty_1 { ycbcr_enc: sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_601 },
        quantization: sys::v4l2_quantization_V4L2_QUANTIZATION_LIM_RANGE,
        xfer_func: sys::v4l2_xfer_func_V4L2_XFER_FUNC_SRGB,
    };
    let refused = |cause| map_operation_error(device, "its format cannot be set", cause);
    match device.set_format(&mut format) {
        Err(error) if Errno::from_io_error(&error) == Some(Errno::BUSY) => {
            // 0.13 refuses every format except the fixed one. A node that has a writer refuses that one, too.
            device.get_format(&mut format).map_err(refused)?;
            device.set_format(&mut format).map_err(refused)?;
        }
        done => done.map_err(refused)?,
    }
    // Read back, since some versions return the buffer's size instead of the frame's from the call above.
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = OUTPUT;
    device.get_format(&mut format).map_err(refused)?;
    // SAFETY: for this type of buffer the driver fills in this field.
    #[allow(unsafe_code)]
    let pix = unsafe { format.fmt.pix };
    let size = (pix.width, pix.height);
    match Layout::from_fourcc(pix.pixelformat)
        .filter(|layout| layout.fits_size(size) && pix.width > 0 && pix.height > 0)
    {
        Some(layout) if layout.frame_bytes(size) == pix.sizeimage as usize => Ok((layout, size)),
        _ => Err(LoopbackError::FormatFixed {
            path: device.path().to_owned(),
            fourcc: String::from_utf8_lossy(&pix.pixelformat.to_le_bytes()).into_owned(),
            width: pix.width,
            height: pix.height,
            by: list_other_holders(device.path()),
        }),
    }
}

/// Whether the module's control `keep_format` is set: the format then stays when the writer closes the node.
fn keeps_format(device: &Device) -> bool {
    let mut control = sys::v4l2_control { id: KEEP_FORMAT, value: 0 };
    device.get_control(&mut control).is_ok() && control.value != 0
}

/// Maps a failed open to its error.
fn map_open_error(path: &Path, cause: io::Error) -> LoopbackError {
    let path = path.to_owned();
    match Errno::from_io_error(&cause) {
        Some(Errno::NOENT | Errno::NOTDIR | Errno::NODEV | Errno::NXIO) => LoopbackError::Missing { path },
        Some(Errno::ACCESS | Errno::PERM) => LoopbackError::Denied { path },
        Some(Errno::ISDIR) => LoopbackError::NotVideo { path },
        // The module's limit of openers is reached.
        Some(Errno::BUSY) => LoopbackError::InUse { by: list_other_holders(&path), path },
        _ => LoopbackError::System { path, doing: "it cannot be opened", cause },
    }
}

/// Maps a failed operation (`doing`) to its error: the module has several error codes for a node with another writer.
fn map_operation_error(device: &Device, doing: &'static str, cause: io::Error) -> LoopbackError {
    let path = device.path().to_owned();
    let by = list_other_holders(&path);
    match Errno::from_io_error(&cause) {
        Some(Errno::BUSY) => LoopbackError::InUse { path, by },
        Some(Errno::INVAL) if !by.is_empty() => LoopbackError::InUse { path, by },
        _ => LoopbackError::System { path, doing, cause },
    }
}

/// Decodes a text up to its first zero byte.
fn decode_text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests;
