//! A PipeWire camera, which recovers from disappearing and from coming back with another size.

use std::mem;

use super::pixels::Decoder;
use super::v4l2::MediaTime;
use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, MAX_WAIT, SourceInfo};
use crate::layout::{Family, LayoutError, MAX_PLANES, Plane};
use crate::pipewire::mode::{Mode, NegotiatedFormat, Offer};
use crate::pipewire::reader::{Frame, PictureHandler, Reader};
use crate::stats::DropCause;
use crate::v4l2::live::ModeRequest;
use crate::v4l2::live::negotiate::{self, LinkSpeed};
use crate::v4l2::modes::{FormatModes, Interval, QueueKind, Rates, SizeModes, Sizes};
use crate::v4l2::queue::Losses;
use crate::v4l2::{FourCc, Layout};
use bokehcam::clock::Clock;
use bokehcam::frame::fit::Letterbox;
use bokehcam::frame::{ColorImage, Stamp};
use bokehcam::link::pool::{Pool, Pooled};
use bokehcam::link::{self, Received, Receiver, Sender};

/// Maximum number of pictures in flight: one being decoded, one waiting, and one being received.
const PICTURES: usize = 3;

/// A PipeWire camera. All its frames have one size: if it comes back with another one, its pictures are scaled into the
/// first size.
pub struct PipeWireCamera {
    reader: Reader,
    receiver: Receiver<Picture>,
    /// A received picture whose losses have to be reported first.
    pending: Option<Picture>,
    info: SourceInfo,
    clock: Clock,
    waited_ns: u64,
    times: MediaTime,
    /// Number of frames delivered.
    delivered: u64,
}

/// A decoded picture on its way from the reader's thread.
struct Picture {
    color: Pooled<ColorImage>,
    captured_ns: u64,
    /// Frames lost since the previous picture.
    losses: Losses,
}

impl PipeWireCamera {
    /// Opens the camera that `name` refers to, in the mode closest to `request`, and starts it. It does not end by
    /// itself; `frames` are to be delivered ([`SourceInfo::frames`]). With `filters`, its pictures go to the clients that
    /// requested this camera, and arrive while there are any.
    ///
    /// # Errors
    /// The camera does not exist, or cannot be used.
    pub fn open(name: &str, filters: bool, request: ModeRequest, frames: Option<u64>) -> Result<Self, CaptureError> {
        let (sender, receiver) = link::live();
        let picture_decoder = PictureDecoder::new(request, sender);
        // Blocks until the camera has announced its format.
        let (reader, camera, negotiated) =
            Reader::new(name, filters, picture_decoder).map_err(|error| CaptureError::Camera(error.into()))?;
        let interval = Interval { numerator: negotiated.rate.1, denominator: negotiated.rate.0 };
        let ((width, height), fourcc) = (negotiated.size, FourCc(negotiated.fourcc));
        let info = SourceInfo {
            name: format!("pipewire:{} ({}), {width}x{height} {fourcc} at {interval} fps", camera.name, camera.label),
            size: negotiated.size,
            period_ns: interval.period_ns(),
            frames,
            live: true,
            frame_data: FrameData::Color,
        };
        let (clock, times) = (Clock::system(), MediaTime::default());
        Ok(Self { reader, receiver, pending: None, info, clock, waited_ns: 0, times, delivered: 0 })
    }
}

impl Camera for PipeWireCamera {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.pending.is_none() {
            self.reader.set_wanted(true);
            let began_ns = self.clock.now_ns();
            let received = self.receiver.recv_timeout(MAX_WAIT);
            self.waited_ns = self.clock.now_ns() - began_ns;
            match received {
                Received::Item(picture) => self.pending = Some(picture),
                Received::Nothing => return Ok(Captured::Waiting),
                // The reader's thread has panicked, which was printed.
                Received::Ended => return Ok(Captured::End),
            }
        }
        if let Some(lost) = self.pending.as_mut().and_then(|picture| next_loss(&mut picture.losses)) {
            return Ok(lost);
        }
        let Some(mut picture) = self.pending.take() else { return Ok(Captured::Waiting) };
        mem::swap(buffers.color, &mut picture.color);
        let index = self.delivered as usize;
        self.delivered += 1;
        let (captured_ns, time_ns) = (picture.captured_ns, self.times.since_first_ns(picture.captured_ns));
        Ok(Captured::Frame(Stamp { index, time_ns, captured_ns: Some(captured_ns) }))
    }

    fn waited_ns(&mut self) -> u64 {
        self.waited_ns
    }

    fn suspend(&mut self) {
        self.reader.set_wanted(false);
        // Pictures from before the pause are outdated when a client watches again.
        self.pending = None;
        self.receiver.try_recv();
    }
}

/// Removes the next cause of loss to report, and returns it with its count.
fn next_loss(Losses { missed, stale, corrupt }: &mut Losses) -> Option<Captured> {
    let causes = [(missed, DropCause::Driver), (stale, DropCause::Evicted), (corrupt, DropCause::Corrupt)];
    let (count, cause) = causes.into_iter().find(|(count, _)| **count > 0)?;
    Some(Captured::Lost(mem::take(count), cause))
}

/// Decodes pictures on the reader's thread.
struct PictureDecoder {
    request: ModeRequest,
    sender: Sender<Picture>,
    pictures: Pool<ColorImage>,
    decoder: Option<Decoder>,
    negotiated: Option<NegotiatedFormat>,
    /// Size of the first negotiated mode.
    size: Option<(u32, u32)>,
    /// Buffer for decoding pictures of another size.
    scratch: ColorImage,
    fit: Letterbox,
    /// Frames lost since the last picture was sent.
    losses: Losses,
    /// Whether a warning about undecodable pictures was logged.
    warned: bool,
}

impl PictureDecoder {
    fn new(request: ModeRequest, sender: Sender<Picture>) -> Self {
        Self {
            request,
            sender,
            pictures: Pool::new(PICTURES, ColorImage::default),
            decoder: None,
            negotiated: None,
            size: None,
            scratch: ColorImage::default(),
            fit: Letterbox::default(),
            losses: Losses::default(),
            warned: false,
        }
    }

    /// Decodes a frame and sends it; fails if it cannot be decoded.
    fn decode(&mut self, frame: &Frame) -> Result<(), String> {
        let Some((negotiated, size)) = self.negotiated.zip(self.size) else { return Ok(()) };
        let layout = frame_layout(&negotiated, frame).map_err(|error| error.to_string())?;
        let decoder = match self.decoder.take().filter(|decoder| *decoder.layout() == layout) {
            Some(decoder) => decoder,
            None => Decoder::new(&layout).map_err(|error| error.to_string())?,
        };
        let decoder = self.decoder.insert(decoder);
        // All buffers are in flight because the receiver is slow: the newest picture replaces one that waits.
        let Some(mut color) = self.pictures.try_take() else {
            self.losses.stale += 1;
            return Ok(());
        };
        let decoded = if negotiated.size == size {
            decoder.decode(frame.planes, &mut color)
        } else {
            decoder.decode(frame.planes, &mut self.scratch).map(|()| {
                color.resize(size.0, size.1);
                self.fit.fit(&self.scratch, &mut color);
            })
        };
        decoded.map_err(|error| error.to_string())?;
        let picture = Picture { color, captured_ns: frame.captured_ns, losses: mem::take(&mut self.losses) };
        if let Ok(Some(overtaken)) = self.sender.send(picture) {
            // Reported with the next picture.
            let Losses { missed, stale, corrupt } = overtaken.losses;
            self.losses.missed += missed;
            self.losses.stale += stale + 1;
            self.losses.corrupt += corrupt;
        }
        Ok(())
    }
}

impl PictureHandler for PictureDecoder {
    fn choose_mode(&mut self, modes: &[Mode]) -> Result<NegotiatedFormat, String> {
        let modes: Vec<FormatModes> = modes.iter().map(format_modes).collect();
        // Treated as an internal connection, since the real one is unknown.
        let best = negotiate::rank_modes(&modes, &self.request, LinkSpeed::Fast).map_err(|error| error.to_string())?;
        let best = best.first().ok_or("it offers no mode")?;
        let Interval { numerator, denominator } = best.interval;
        Ok(NegotiatedFormat { fourcc: best.fourcc.0, size: best.size_px, rate: (denominator, numerator) })
    }

    fn set_format(&mut self, negotiated: &NegotiatedFormat) {
        self.negotiated = Some(*negotiated);
        let size = *self.size.get_or_insert(negotiated.size);
        if size != negotiated.size {
            let ((width, height), (into_width, into_height)) = (negotiated.size, size);
            tracing::warn!("the camera now gives {width}x{height}: fitted into {into_width}x{into_height}");
        }
    }

    fn handle_frame(&mut self, frame: &Frame) {
        if let Err(error) = self.decode(frame) {
            self.losses.corrupt += 1;
            if !mem::replace(&mut self.warned, true) {
                tracing::warn!("{error}; such frames are skipped");
            }
        }
    }

    fn add_losses(&mut self, missed: u64, stale: u64, corrupt: u64) {
        self.losses.missed += missed;
        self.losses.stale += stale;
        self.losses.corrupt += corrupt;
    }
}

/// Computes a frame's memory layout: formats of several components arrive in one plane, or in one per component.
fn frame_layout(negotiated: &NegotiatedFormat, frame: &Frame) -> Result<Layout, LayoutError> {
    let apart = match (&negotiated.fourcc, frame.planes.len()) {
        (_, 0 | 1) => negotiated.fourcc,
        (b"NV12", _) => *b"NM12",
        (b"NV21", _) => *b"NM21",
        (b"YU12", _) => *b"YM12",
        (b"YV12", _) => *b"YM21",
        (other, _) => *other,
    };
    let (width, height) = negotiated.size;
    let whole = Layout::with_stride(FourCc(negotiated.fourcc), width, height, frame.strides_bytes[0])?;
    let mut planes = [Plane::default(); MAX_PLANES];
    let given = frame.strides_bytes.iter().zip(frame.planes);
    for ((plane, component), (&stride_bytes, bytes)) in planes.iter_mut().zip(whole.components()).zip(given) {
        // libcamera states luma's stride for all planes, although rows of chroma may be shorter.
        let end_bytes = stride_bytes.saturating_mul(component.rows - 1).saturating_add(component.row_bytes);
        let is_its_own = stride_bytes > 0 && end_bytes <= bytes.len();
        plane.stride_bytes = if is_its_own { stride_bytes } else { component.stride_bytes };
    }
    let count = FourCc(apart).family().map_or(1, Family::memory_plane_count);
    Layout::new(FourCc(apart), negotiated.size, &planes[..count], None)
}

/// Converts a mode to V4L2's representation.
pub fn format_modes(mode: &Mode) -> FormatModes {
    let interval = |&(num, denom): &(u32, u32)| Interval { numerator: denom, denominator: num };
    let is_rate = |(num, denom): &&(u32, u32)| *num > 0 && *denom > 0;
    let rates = match &mode.rates {
        Offer::Unknown => Rates::Unknown,
        Offer::These(rates) => {
            let mut rates: Vec<Interval> = rates.iter().filter(is_rate).map(interval).collect();
            rates.sort_by_key(|interval| interval.period_ns());
            if rates.is_empty() { Rates::Unknown } else { Rates::Discrete(rates) }
        }
        Offer::Range { min, max } => match [max, min].map(|rate| Some(rate).filter(is_rate).map(interval)) {
            [Some(shortest), Some(longest)] => Rates::Range { shortest, longest },
            // A minimum rate of 0 allows arbitrarily slow rates.
            [Some(shortest), None] => Rates::Range { shortest, longest: Interval { numerator: 1, denominator: 1 } },
            _ => Rates::Unknown,
        },
    };
    let sizes = match mode.sizes.clone() {
        Offer::Unknown => Sizes::Unknown,
        Offer::These(sizes) => {
            Sizes::Discrete(sizes.into_iter().map(|size_px| SizeModes { size_px, rates: rates.clone() }).collect())
        }
        Offer::Range { min, max } => Sizes::Range { min_px: min, max_px: max, step_px: (2, 2), rates },
    };
    let (fourcc, description) = (FourCc(mode.fourcc), String::new());
    FormatModes { queue: QueueKind::SinglePlanar, fourcc, description, emulated: false, sizes }
}

#[cfg(test)]
mod tests;
