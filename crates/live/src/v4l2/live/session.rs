//! An open, streaming camera: from the device node to the running queue.

use std::fmt;
use std::path::Path;

use v4l::v4l_sys as sys;

use super::error::OpenError;
use super::negotiate::{Choice, LinkSpeed, ModeRequest, rank_modes};
use crate::layout::{Layout, LayoutError};
use crate::v4l2::device::{Device, node_caps, zeroed};
use crate::v4l2::modes::{Interval, QueueKind, list_modes};
use crate::v4l2::node::{LOOPBACK_DRIVER, decode_text};
use crate::v4l2::queue::{DeviceKernel, Queue, Writer};
use crate::v4l2::{controls, layout, node};
use bokehcam::clock::Clock;

/// A control's name and value, as text.
pub type Setting = (String, String);

/// The mode negotiated with the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NegotiatedMode {
    /// The mode requested.
    pub choice: Choice,
    pub layout: Layout,
    /// Time between frames, as the driver reports it.
    pub interval: Interval,
}

impl fmt::Display for NegotiatedMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { layout: Layout { width, height, fourcc, .. }, interval, .. } = self;
        write!(f, "{width}x{height} {fourcc} at {interval} fps")
    }
}

/// An open, streaming camera.
pub struct Session {
    pub queue: Queue<DeviceKernel>,
    pub negotiated: NegotiatedMode,
    /// Its capabilities when it was opened.
    pub capability: sys::v4l2_capability,
}

/// How many formats are tried if the driver refuses the best one.
const MAX_FORMATS: usize = 6;

impl Session {
    /// Opens the camera at `path`, negotiates a mode, sets its controls and starts it. With `previous`, the last
    /// negotiated mode, that mode is requested first, which is fast, and a control that cannot be set only causes a
    /// warning.
    ///
    /// # Errors
    /// Any of these steps is refused.
    pub fn open(
        path: &Path,
        request: &ModeRequest,
        settings: &[Setting],
        previous: Option<&NegotiatedMode>,
        clock: &Clock,
    ) -> Result<Self, OpenError> {
        let device = Device::open(path).map_err(|error| OpenError::from_io(path, "it cannot be opened", error))?;
        let capability = query_camera(&device)?;
        let negotiated = negotiate_mode(&device, &capability, request, previous)?;
        for (name, value) in settings {
            match controls::set_control(&device, name, value) {
                Ok(_) => {}
                // A running stream must not end because of a control.
                Err(error) if previous.is_some() => tracing::warn!("{}: {error}", path.display()),
                Err(source) => return Err(OpenError::Control { path: path.to_owned(), source }),
            }
        }
        let min_bytes: Vec<usize> =
            (0..negotiated.layout.planes().len()).map(|plane| negotiated.layout.min_size_bytes(plane)).collect();
        let writer = if is_loopback(&capability) { Writer::Program } else { Writer::Driver };
        let kernel = DeviceKernel::new(device, negotiated.choice.queue, writer);
        let refused = |error| OpenError::from_queue(path, error);
        let mut queue =
            Queue::new(kernel, &min_bytes, negotiated.interval.period_ns(), clock.clone()).map_err(refused)?;
        queue.start().map_err(refused)?;
        Ok(Self { queue, negotiated, capability })
    }

    /// Whether frames come from another program instead of a camera.
    pub fn is_loopback(&self) -> bool {
        is_loopback(&self.capability)
    }

    pub fn device(&self) -> &Device {
        self.queue.kernel().device()
    }
}

fn is_loopback(capability: &sys::v4l2_capability) -> bool {
    decode_text(&capability.driver) == LOOPBACK_DRIVER
}

/// Queries the device's capabilities; fails if it is not a camera.
fn query_camera(device: &Device) -> Result<sys::v4l2_capability, OpenError> {
    let path = device.path();
    let mut capability: sys::v4l2_capability = zeroed();
    device.query_capability(&mut capability).map_err(|error| match error.raw_os_error() {
        Some(ENOTTY) => OpenError::NotACamera { path: path.to_owned(), what: "it does not respond as a camera" },
        _ => OpenError::from_io(path, "VIDIOC_QUERYCAP", error),
    })?;
    match not_camera_reason(&capability) {
        Some(what) => Err(OpenError::NotACamera { path: path.to_owned(), what }),
        None => Ok(capability),
    }
}

/// Returns why a device with these capabilities is not a camera; `None` if it is one.
fn not_camera_reason(capability: &sys::v4l2_capability) -> Option<&'static str> {
    let caps = node_caps(capability);
    let has_caps = |any: u32| caps & any != 0;
    if has_caps(sys::V4L2_CAP_VIDEO_M2M | sys::V4L2_CAP_VIDEO_M2M_MPLANE) {
        return Some("it converts pictures");
    }
    if !has_caps(sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE) {
        return Some(match decode_text(&capability.driver) {
            driver if driver == LOOPBACK_DRIVER => "it is a virtual camera, and nothing writes to it",
            _ if has_caps(sys::V4L2_CAP_META_CAPTURE) => "it gives metadata about the pictures of another node",
            _ => "it captures no pictures",
        });
    }
    (!has_caps(sys::V4L2_CAP_STREAMING)).then_some("it does not stream")
}

const ENOTTY: i32 = rustix::io::Errno::NOTTY.raw_os_error();

/// Sets a mode on the device: that of `previous` if the driver still returns the same layout, otherwise the first
/// accepted one of the [`MAX_FORMATS`] best for `request`. The driver may change the size, the rate, and a format that
/// `request` leaves open, but a mode of other content is skipped. Fails at once if the device is gone or busy, and
/// otherwise with the first refusal.
fn negotiate_mode(
    device: &Device,
    capability: &sys::v4l2_capability,
    request: &ModeRequest,
    previous: Option<&NegotiatedMode>,
) -> Result<NegotiatedMode, OpenError> {
    if let Some(previous) = previous {
        match set_format(device, &previous.choice) {
            Ok(layout) if layout == previous.layout => return Ok(set_frame_rate(device, previous.choice, layout)),
            Err(error @ (OpenError::Gone(_) | OpenError::Busy { .. })) => return Err(error),
            // The camera has changed: negotiate again.
            _ => {}
        }
    }
    let path = device.path();
    let offered = list_modes(device).map_err(|error| OpenError::from_io(path, "VIDIOC_QUERYCAP", error))?;
    let choices = rank_modes(&offered, request, detect_link_speed(path, capability))
        .map_err(|source| OpenError::NoMode { path: path.to_owned(), source })?;
    // The first refusal, that of the best mode, is reported to the user.
    let mut refusal = None;
    for choice in choices.into_iter().take(MAX_FORMATS) {
        match set_format(device, &choice) {
            Ok(layout) if request.fourcc.is_some_and(|fourcc| fourcc != layout.fourcc) => {
                let what = "it does not give the format that it offers";
                let source = std::io::Error::from(std::io::ErrorKind::InvalidInput);
                refusal.get_or_insert(OpenError::Io { path: path.to_owned(), what, source });
            }
            Ok(layout) if layout.fourcc.content() == Some(request.content) => {
                let negotiated = set_frame_rate(device, choice, layout);
                warn_of_mode_differences(device, &negotiated, request);
                return Ok(negotiated);
            }
            // Changed into a format of other content, or one that cannot be read.
            Ok(_) => {}
            Err(error @ (OpenError::Gone(_) | OpenError::Busy { .. })) => return Err(error),
            Err(error) => {
                refusal.get_or_insert(error);
            }
        }
    }
    Err(refusal.unwrap_or_else(|| OpenError::NotACamera {
        path: path.to_owned(),
        what: "it accepts none of the formats that it offers",
    }))
}

/// Sets a format; returns the layout that the driver chose.
fn set_format(device: &Device, choice: &Choice) -> Result<Layout, OpenError> {
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = choice.queue.buffer_type();
    let ((width, height), pixelformat) = (choice.size_px, choice.fourcc.to_u32());
    let field = sys::v4l2_field_V4L2_FIELD_NONE;
    match choice.queue {
        QueueKind::SinglePlanar => {
            format.fmt.pix = sys::v4l2_pix_format { width, height, pixelformat, field, ..zeroed() };
        }
        QueueKind::MultiPlanar => {
            format.fmt.pix_mp = sys::v4l2_pix_format_mplane { width, height, pixelformat, field, ..zeroed() };
        }
    }
    device.set_format(&mut format).map_err(|error| OpenError::from_io(device.path(), "VIDIOC_S_FMT", error))?;
    layout::from_format(&format)
        .map_err(|source: LayoutError| OpenError::Layout { path: device.path().to_owned(), source })
}

/// Sets the frame rate, if possible, and reads it back.
fn set_frame_rate(device: &Device, choice: Choice, layout: Layout) -> NegotiatedMode {
    let mut parameters: sys::v4l2_streamparm = zeroed();
    parameters.type_ = choice.queue.buffer_type();
    // Read first to keep the other parameters. Inputs that follow their signal's rate refuse.
    if device.get_parameters(&mut parameters).is_ok() {
        parameters.parm.capture.timeperframe = choice.interval.fraction();
        if let Err(error) = device.set_parameters(&mut parameters) {
            tracing::debug!("{}: the rate cannot be set: {error}", device.path().display());
        }
    }
    let mut reported: sys::v4l2_streamparm = zeroed();
    reported.type_ = choice.queue.buffer_type();
    let reported = device.get_parameters(&mut reported).ok().and_then(|()| {
        // SAFETY: for a capture queue this member was written, and all its members are integers.
        #[allow(unsafe_code)]
        Interval::new(unsafe { reported.parm.capture.timeperframe })
    });
    NegotiatedMode {
        choice,
        layout,
        interval: reported.filter(|reported| reported.period_ns() < MAX_PERIOD_NS).unwrap_or(choice.interval),
    }
}

/// A rate below one frame in ten seconds is a driver's mistake.
const MAX_PERIOD_NS: u64 = 10_000_000_000;

/// Classifies the camera's connection, as far as it is known.
fn detect_link_speed(path: &Path, capability: &sys::v4l2_capability) -> LinkSpeed {
    const USB_2_MBIT_PER_S: f32 = 480.0;
    if !decode_text(&capability.bus_info).starts_with("usb-") {
        return LinkSpeed::Fast;
    }
    match node::usb_connection(path) {
        Some(usb) if usb.mbit_per_s > USB_2_MBIT_PER_S => LinkSpeed::Fast,
        _ => LinkSpeed::Slow,
    }
}

/// Warns if the size or the rate (by more than 2 %) differs from the requested one.
fn warn_of_mode_differences(device: &Device, negotiated: &NegotiatedMode, request: &ModeRequest) {
    let size = (negotiated.layout.width, negotiated.layout.height);
    let other_size = request.size_px.is_some_and(|wanted| wanted != size);
    let other_rate = request.fps.is_some_and(|wanted| (negotiated.interval.fps() / wanted).ln().abs() > 0.02);
    if other_size || other_rate {
        let name = device.path().display();
        tracing::warn!("{name}: the camera does not support the requested mode and gives {negotiated}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_camera_is_told_apart() {
        let said = |driver: &str, device_caps: u32| {
            let capabilities = sys::V4L2_CAP_DEVICE_CAPS;
            let mut capability = sys::v4l2_capability { capabilities, device_caps, ..zeroed() };
            capability.driver[..driver.len()].copy_from_slice(driver.as_bytes());
            not_camera_reason(&capability)
        };
        let streams = sys::V4L2_CAP_STREAMING;
        assert_eq!(said("uvcvideo", sys::V4L2_CAP_VIDEO_CAPTURE | streams), None);
        assert_eq!(said("uvcvideo", sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE | streams), None);
        assert_eq!(said("uvcvideo", sys::V4L2_CAP_VIDEO_CAPTURE), Some("it does not stream"));
        assert_eq!(
            said("uvcvideo", sys::V4L2_CAP_META_CAPTURE),
            Some("it gives metadata about the pictures of another node")
        );
        assert_eq!(said("vivid", sys::V4L2_CAP_VBI_CAPTURE | streams), Some("it captures no pictures"));
        let unwritten = Some("it is a virtual camera, and nothing writes to it");
        assert_eq!(said(LOOPBACK_DRIVER, sys::V4L2_CAP_VIDEO_OUTPUT), unwritten);
        assert_eq!(said("codec", sys::V4L2_CAP_VIDEO_M2M | streams), Some("it converts pictures"));
    }
}
