//! Virtual cameras of the kernel module v4l2loopback: what is written to a node is read by others as a camera's frames.

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

pub use self::error::{LoopbackError, modprobe, nodes};

use super::device::{Device, zeroed};
use super::holders::other_holders;

// What its nodes say that they can do depends on who uses them; what their driver is does not.
pub use super::node::LOOPBACK_DRIVER as DRIVER;

const OUTPUT: u32 = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT;
/// The module's control `keep_format`.
const KEEP_FORMAT: u32 = sys::V4L2_CID_BASE | 0xf000;
/// How long a write may wait for room; no version of the module has made one wait so far.
const WRITE_PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

/// How the pixels of a frame lie in memory; all without gaps between rows or planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Y Cb Y Cr: two pixels share their colour.
    Yuyv,
    /// Three planes, colour halved both ways.
    Yu12,
    /// Two planes, colour halved both ways and interleaved.
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

    fn of(fourcc: u32) -> Option<Self> {
        Self::ALL.iter().find(|(_, code)| u32::from_le_bytes(**code) == fourcc).map(|(layout, _)| *layout)
    }

    /// Bytes of a frame. Columns are even, and so are rows where they share their colour.
    pub fn frame_bytes(self, (width, height): (u32, u32)) -> usize {
        let pixels = width as usize * height as usize;
        match self {
            Self::Yuyv => 2 * pixels,
            Self::Yu12 | Self::Nv12 => pixels + pixels / 2,
            Self::Rgb24 | Self::Bgr24 => 3 * pixels,
        }
    }

    /// Whether frames of this size can be laid out so: sides along which pixels share their colour must be even.
    fn takes(self, (width, height): (u32, u32)) -> bool {
        match self {
            Self::Yuyv => width.is_multiple_of(2),
            Self::Yu12 | Self::Nv12 => width.is_multiple_of(2) && height.is_multiple_of(2),
            Self::Rgb24 | Self::Bgr24 => true,
        }
    }
}

/// A node that frames are written to.
#[derive(Debug)]
pub struct Output {
    device: Arc<Device>,
    card: String,
    layout: Layout,
    size: (u32, u32),
}

/// Frames that a node keeps, as the module was loaded; `None` where it does not tell.
pub fn buffers() -> Option<u32> {
    let text = fs::read_to_string("/sys/module/v4l2loopback/parameters/max_buffers").ok()?;
    text.trim().parse().ok().filter(|buffers| (1..=MOST_BUFFERS).contains(buffers))
}

/// The module keeps no more.
const MOST_BUFFERS: u32 = 32;

impl Output {
    /// Opens a node and starts to stream YUYV to it, in BT.601 and limited range, as readers assume of every picture:
    /// `size` pixels (the width even), `rate / scale` frames per second. Where a reader or a control has fixed the
    /// format, that one is used instead: see [`Output::layout`] and [`Output::size`].
    ///
    /// # Errors
    /// It is no free node of the module, or its fixed format cannot be written.
    pub fn open(path: &Path, size: (u32, u32), (rate, scale): (u64, u64)) -> Result<Self, LoopbackError> {
        let device = Device::open(path).map_err(|cause| refused(path, cause))?;
        let mut capability: sys::v4l2_capability = zeroed();
        if device.query_capability(&mut capability).is_err() {
            return Err(LoopbackError::NoVideo { path: path.to_owned() });
        }
        let card = text(&capability.card);
        if text(&capability.driver) != DRIVER {
            return Err(LoopbackError::NotLoopback { path: path.to_owned(), card });
        }
        let can = |any: u32| capability.device_caps & any != 0;
        // With exclusive_caps, a node that announces capture but no output has a writer, unless its format is kept.
        let has_writer = can(sys::V4L2_CAP_VIDEO_CAPTURE) && !can(sys::V4L2_CAP_VIDEO_OUTPUT) && !keeps_format(&device);
        // Versions before 0.14 let several programs write, and without exclusive_caps do not show that one does: the
        // lock at least keeps out another run of this program.
        let locked = flock(&device, FlockOperation::NonBlockingLockExclusive);
        if has_writer || locked.is_err_and(|error| error == Errno::WOULDBLOCK) {
            return Err(LoopbackError::Taken { path: path.to_owned(), by: other_holders(path) });
        }
        if !can(sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_OUTPUT) {
            return Err(LoopbackError::Stuck { path: path.to_owned() });
        }
        let (layout, size) = set_format(&device, size)?;
        let mut parameters: sys::v4l2_streamparm = zeroed();
        parameters.type_ = OUTPUT;
        let saturated = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
        parameters.parm.output.timeperframe =
            sys::v4l2_fract { numerator: saturated(scale), denominator: saturated(rate) };
        // Only tells readers that ask: frames come when they are written.
        if let Err(error) = device.set_parameters(&mut parameters) {
            tracing::debug!("{}: the frame rate cannot be set: {error}", path.display());
        }
        match device.stream_on(&mut (OUTPUT as i32)) {
            // Up to 0.13 a node that is closed without this call having been made takes no frames any more. From 0.14
            // on the call wants buffers first (EINVAL), and the first write starts the stream.
            Err(error) if Errno::from_io_error(&error) != Some(Errno::INVAL) => {
                return Err(busy_or(&device, "the stream cannot be started", error));
            }
            _ => {}
        }
        Ok(Self { device: Arc::new(device), card, layout, size })
    }

    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The name that it shows to users.
    pub fn card(&self) -> &str {
        &self.card
    }

    /// How pixels are to be laid out.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Columns and rows of a frame.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Writes one frame into every buffer of the module: a new reader is first given what lies there, however old.
    ///
    /// # Errors
    /// The system refused.
    pub fn overwrite(&self, frame: &[u8]) -> Result<(), LoopbackError> {
        (0..buffers().unwrap_or(MOST_BUFFERS)).try_for_each(|_| self.write(frame))
    }

    /// Shows one frame, of exactly [`Layout::frame_bytes`]. Never waits for readers: whoever was too slow for the
    /// frames before gets this one.
    ///
    /// # Errors
    /// The system refused.
    pub fn write(&self, frame: &[u8]) -> Result<(), LoopbackError> {
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
                    // Room, a timeout or an error: the next write tells which.
                    let _ = poll(&mut fds, Some(&WRITE_PATIENCE));
                }
                Err(Errno::BUSY) => return Err(busy_or(&self.device, "a frame cannot be written", Errno::BUSY.into())),
                Err(error) => return Err(failed(error.into())),
            }
        }
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Readers stay; what cannot be stopped ends with the node's closing.
        let _ = self.device.stream_off(&mut (OUTPUT as i32));
    }
}

/// Sets YUYV of `size` as the node's format; returns the layout and size that hold then, which are others where the
/// format is fixed.
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
        // Without it the kernel takes the last fields for not set.
        priv_: sys::V4L2_PIX_FMT_PRIV_MAGIC,
        flags: 0,
        __bindgen_anon_1: sys::v4l2_pix_format__bindgen_ty_1 { ycbcr_enc: sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_601 },
        quantization: sys::v4l2_quantization_V4L2_QUANTIZATION_LIM_RANGE,
        xfer_func: sys::v4l2_xfer_func_V4L2_XFER_FUNC_SRGB,
    };
    let refused = |cause| busy_or(device, "its format cannot be set", cause);
    match device.set_format(&mut format) {
        Err(error) if Errno::from_io_error(&error) == Some(Errno::BUSY) => {
            // 0.13 refuses every format but the one that is fixed. A node that has a writer refuses that one, too.
            device.get_format(&mut format).map_err(refused)?;
            device.set_format(&mut format).map_err(refused)?;
        }
        done => done.map_err(refused)?,
    }
    // Asked for, since some versions answer the call above with the buffer's size instead of the frame's.
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = OUTPUT;
    device.get_format(&mut format).map_err(refused)?;
    // SAFETY: for this type of buffer the driver fills in this field.
    #[allow(unsafe_code)]
    let pix = unsafe { format.fmt.pix };
    let size = (pix.width, pix.height);
    match Layout::of(pix.pixelformat).filter(|layout| layout.takes(size) && pix.width > 0 && pix.height > 0) {
        Some(layout) if layout.frame_bytes(size) == pix.sizeimage as usize => Ok((layout, size)),
        _ => Err(LoopbackError::Frozen {
            path: device.path().to_owned(),
            fourcc: String::from_utf8_lossy(&pix.pixelformat.to_le_bytes()).into_owned(),
            width: pix.width,
            height: pix.height,
            by: other_holders(device.path()),
        }),
    }
}

/// Whether the module's control `keep_format` is set: the format then stays when nobody writes.
fn keeps_format(device: &Device) -> bool {
    let mut control = sys::v4l2_control { id: KEEP_FORMAT, value: 0 };
    device.get_control(&mut control).is_ok() && control.value != 0
}

/// Why a node could not be opened.
fn refused(path: &Path, cause: io::Error) -> LoopbackError {
    let path = path.to_owned();
    match Errno::from_io_error(&cause) {
        Some(Errno::NOENT | Errno::NOTDIR | Errno::NODEV | Errno::NXIO) => LoopbackError::Missing { path },
        Some(Errno::ACCESS | Errno::PERM) => LoopbackError::Denied { path },
        Some(Errno::ISDIR) => LoopbackError::NoVideo { path },
        // The module's limit of openers is reached.
        Some(Errno::BUSY) => LoopbackError::Taken { by: other_holders(&path), path },
        _ => LoopbackError::System { path, doing: "it cannot be opened", cause },
    }
}

/// Why the node refused what was tried (`doing`): the module has several errors for a node with another writer.
fn busy_or(device: &Device, doing: &'static str, cause: io::Error) -> LoopbackError {
    let path = device.path().to_owned();
    let by = other_holders(&path);
    match Errno::from_io_error(&cause) {
        Some(Errno::BUSY) => LoopbackError::Taken { path, by },
        Some(Errno::INVAL) if !by.is_empty() => LoopbackError::Taken { path, by },
        _ => LoopbackError::System { path, doing, cause },
    }
}

/// A text that ends at its first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests;
