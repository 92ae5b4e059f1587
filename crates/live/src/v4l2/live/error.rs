//! Why a camera cannot be opened.

use std::io;
use std::path::{Path, PathBuf};

use super::negotiate::NoMode;
use crate::layout::LayoutError;
use crate::v4l2::controls::ControlError;
use crate::v4l2::holders::{Holder, list_holders};
use crate::v4l2::node::NodeError;
use crate::v4l2::queue::QueueError;

/// Why a camera cannot be opened.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// No device matches the name.
    #[error(transparent)]
    Name(#[from] NodeError),
    /// The node does not exist, or has no device.
    #[error("{}: there is no such camera; is it plugged in? `bokehcam devices` lists the cameras", .0.display())]
    Gone(PathBuf),
    #[error("{}: permission denied; join the group that may use cameras: sudo usermod -aG video $USER, then log in again", .0.display())]
    Denied(PathBuf),
    /// Another program uses it.
    #[error("{}: the camera is busy{}", path.display(), format_holders(.holders))]
    Busy { path: PathBuf, holders: Vec<Holder> },
    #[error("{}: this is not a camera: {what}; `bokehcam devices` lists the cameras", path.display())]
    NotACamera { path: PathBuf, what: &'static str },
    /// It offers no usable mode.
    #[error("{}: {source}", path.display())]
    NoMode { path: PathBuf, source: NoMode },
    /// Its pictures cannot be read.
    #[error("{}: {source}", path.display())]
    Layout { path: PathBuf, source: LayoutError },
    /// The USB bandwidth is exhausted.
    #[error(
        "{}: not enough USB bandwidth to start; choose --format MJPG, a smaller --size or a lower --fps, or plug the \
         camera into a USB port away from other cameras",
        .0.display()
    )]
    Bandwidth(PathBuf),
    /// A control cannot be set as requested.
    #[error("{}: {source}", path.display())]
    Control { path: PathBuf, source: ControlError },
    /// It does not start to send, or its last program left it in a bad state.
    #[error(
        "{}: the camera does not start ({source}): unplug it and plug it in again, restart the computer if it is built in, \
         or try another --format or --size",
        path.display()
    )]
    NotStarting { path: PathBuf, source: io::Error },
    /// The queue of buffers cannot be set up.
    #[error("{}: the camera cannot be started: {source}", path.display())]
    Queue { path: PathBuf, source: QueueError },
    /// Any other system error.
    #[error("{}: {what}: {source}", path.display())]
    Io { path: PathBuf, what: &'static str, source: io::Error },
}

const EPERM: i32 = rustix::io::Errno::PERM.raw_os_error();
const ENOENT: i32 = rustix::io::Errno::NOENT.raw_os_error();
const ENXIO: i32 = rustix::io::Errno::NXIO.raw_os_error();
const EACCES: i32 = rustix::io::Errno::ACCESS.raw_os_error();
const EBUSY: i32 = rustix::io::Errno::BUSY.raw_os_error();
const ENODEV: i32 = rustix::io::Errno::NODEV.raw_os_error();
const EIO: i32 = rustix::io::Errno::IO.raw_os_error();
const EPIPE: i32 = rustix::io::Errno::PIPE.raw_os_error();
const EPROTO: i32 = rustix::io::Errno::PROTO.raw_os_error();
const ETIMEDOUT: i32 = rustix::io::Errno::TIMEDOUT.raw_os_error();
const ENOSPC: i32 = rustix::io::Errno::NOSPC.raw_os_error();

impl OpenError {
    /// Creates the error for a system call that failed on the node `path`; `what` names the call, or what failed with
    /// it.
    pub fn from_io(path: &Path, what: &'static str, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.raw_os_error() {
            Some(ENOENT | ENXIO | ENODEV) => Self::Gone(path),
            Some(EACCES | EPERM) => Self::Denied(path),
            Some(EBUSY) => Self::Busy { holders: list_holders(&path), path },
            _ => Self::Io { path, what, source },
        }
    }

    /// Creates the error for a queue of buffers of the node `path`.
    pub fn from_queue(path: &Path, source: QueueError) -> Self {
        match source {
            // When streaming starts, ENOSPC means lack of USB bandwidth, not of disk space.
            QueueError::Refused { step: "STREAMON", source } if source.raw_os_error() == Some(ENOSPC) => {
                Self::Bandwidth(path.to_owned())
            }
            QueueError::Refused { step: "STREAMON", source }
                if matches!(source.raw_os_error(), Some(EIO | EPIPE | EPROTO | ETIMEDOUT)) =>
            {
                Self::NotStarting { path: path.to_owned(), source }
            }
            QueueError::Refused { step, source } => match Self::from_io(path, step, source) {
                Self::Io { path, what, source } => {
                    Self::Queue { path, source: QueueError::Refused { step: what, source } }
                }
                known => known,
            },
            source => Self::Queue { path: path.to_owned(), source },
        }
    }

    /// Whether a retry may help: another program may release the device, or a driver recover.
    pub fn is_transient(&self) -> bool {
        matches!(self, Self::Busy { .. } | Self::NotStarting { .. } | Self::Queue { .. } | Self::Io { .. })
    }

    /// Whether the device is absent: it may come back.
    pub fn is_gone(&self) -> bool {
        matches!(self, Self::Gone(_) | Self::Name(_))
    }
}

/// Whether the device behind an open descriptor is gone.
pub fn is_gone(error: &QueueError) -> bool {
    matches!(error.source().and_then(io::Error::raw_os_error), Some(ENXIO | ENODEV))
}

fn format_holders(holders: &[Holder]) -> String {
    let others = holders.iter().filter(|holder| !holder.is_this_program());
    let names: Vec<String> = others.map(ToString::to_string).collect();
    match names.as_slice() {
        [] => "; another user's program uses it (sudo fuser -v names it)".to_owned(),
        names => format!(": {} has it open; close that first", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(errno: i32) -> String {
        OpenError::from_io(Path::new("/dev/video7"), "VIDIOC_S_FMT", io::Error::from_raw_os_error(errno)).to_string()
    }

    #[test]
    fn each_refusal_says_what_to_do() {
        assert!(told(ENODEV).starts_with("/dev/video7: there is no such camera"));
        assert!(told(EACCES).contains("usermod -aG video"));
        assert!(told(EBUSY).starts_with("/dev/video7: the camera is busy"));
        assert!(told(5).starts_with("/dev/video7: VIDIOC_S_FMT: Input/output error"));
        let refused = |step, errno| QueueError::Refused { step, source: io::Error::from_raw_os_error(errno) };
        let path = Path::new("/dev/video7");
        let full = OpenError::from_queue(path, refused("STREAMON", ENOSPC)).to_string();
        assert!(full.contains("USB bandwidth") && full.contains("--format MJPG"), "{full}");
        for errno in [EIO, EPIPE, EPROTO, ETIMEDOUT] {
            let error = OpenError::from_queue(path, refused("STREAMON", errno));
            let said = error.to_string();
            assert!(said.starts_with("/dev/video7: the camera does not start (") && said.contains("plug it in again"));
            assert!(error.is_transient(), "a busy camera bus recovers");
        }
        assert!(OpenError::from_queue(path, refused("QBUF", ENOSPC)).to_string().contains("QBUF"));
        assert!(OpenError::from_queue(path, QueueError::TooFewBuffers { granted: 1 }).to_string().contains("1 of 4"));
    }

    #[test]
    fn a_holder_is_named() {
        let holder = |pid| Holder { pid, name: "zoom".into(), has_buffers: true };
        assert_eq!(format_holders(&[holder(1)]), ": zoom (process 1) has it open; close that first");
        assert_eq!(format_holders(&[holder(std::process::id()), holder(1)]), format_holders(&[holder(1)]));
        assert!(format_holders(&[holder(std::process::id())]).contains("another user"));
    }
}
