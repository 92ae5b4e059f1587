//! A camera of PipeWire's: frames as they come, also after it has gone, or come back with another size.

use std::mem;

use super::pixels::Decoder;
use super::v4l2::MediaTime;
use super::{Brings, Camera, CaptureError, Captured, PATIENCE, Shot, SourceInfo};
use crate::clock::Clock;
use crate::frame::fit::Fit;
use crate::frame::{ColorImage, Stamp};
use crate::link::pool::{Pool, Pooled};
use crate::link::{self, Received, Receiver, Sender};
use crate::pipewire::mode::{Agreed, Mode, Offer};
use crate::pipewire::reader::{Frame, Reader, Take};
use crate::stats::Cause;
use crate::v4l2::live::Wish;
use crate::v4l2::live::negotiate::{self, Wire};
use crate::v4l2::modes::{FormatModes, Interval, QueueKind, Rates, SizeModes, Sizes};
use crate::v4l2::queue::Losses;
use crate::v4l2::{FourCc, Layout};

/// Pictures that are under way at most: one being decoded, one that waits, and one being taken over.
const PICTURES: usize = 3;

/// A camera of PipeWire's. Its frames have one size from beginning to end: where it comes back with another one, they are
/// fitted into the first.
pub struct PipeWireCamera {
    reader: Reader,
    from: Receiver<Picture>,
    /// Came, and its losses are to be reported before.
    pending: Option<Picture>,
    info: SourceInfo,
    clock: Clock,
    waited_ns: u64,
    times: MediaTime,
    /// Frames given so far.
    given: u64,
}

/// A decoded picture on its way from the reader's thread.
struct Picture {
    color: Pooled<ColorImage>,
    captured_ns: u64,
    /// What was lost since the one before.
    losses: Losses,
}

impl PipeWireCamera {
    /// Opens the camera that `name` means, in the mode next to `wish`, and starts it. It ends after so many frames, those
    /// that were lost not included; with `None` never. With `filters`, its pictures go to those who asked for this camera,
    /// and come while there are any.
    ///
    /// # Errors
    /// There is none, or it cannot be used.
    pub fn open(name: &str, filters: bool, wish: Wish, frames: Option<u64>) -> Result<Self, CaptureError> {
        let (to, from) = link::live();
        let taker = Taker {
            wish,
            to,
            pictures: Pool::new(PICTURES, ColorImage::default),
            decoder: None,
            agreed: None,
            size: None,
            scratch: ColorImage::default(),
            fit: Fit::default(),
            losses: Losses::default(),
            complained: false,
        };
        let (reader, camera, agreed) = Reader::new(name, filters, taker)?;
        let interval = Interval { numerator: agreed.rate.1, denominator: agreed.rate.0 };
        let ((width, height), fourcc) = (agreed.size, FourCc(agreed.fourcc));
        let info = SourceInfo {
            name: format!("pipewire:{} ({}), {width}x{height} {fourcc} at {interval} fps", camera.name, camera.label),
            size: agreed.size,
            period_ns: interval.period_ns(),
            frames,
            live: true,
            brings: Brings::Color,
        };
        let (clock, times) = (Clock::system(), MediaTime::default());
        Ok(Self { reader, from, pending: None, info, clock, waited_ns: 0, times, given: 0 })
    }
}

impl Camera for PipeWireCamera {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
        if self.info.frames.is_some_and(|frames| self.given >= frames) {
            return Ok(Captured::End);
        }
        if self.pending.is_none() {
            self.reader.want(true);
            let began_ns = self.clock.now_ns();
            let received = self.from.recv_timeout(PATIENCE);
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
        mem::swap(shot.color, &mut picture.color);
        let index = self.given as usize;
        self.given += 1;
        let (captured_ns, time_ns) = (picture.captured_ns, self.times.since_first_ns(picture.captured_ns));
        Ok(Captured::Frame(Stamp { index, time_ns, captured_ns: Some(captured_ns) }))
    }

    fn waited_ns(&self) -> u64 {
        self.waited_ns
    }

    fn rest(&mut self) {
        self.reader.want(false);
        // What came before the rest is old by the time somebody watches again.
        self.pending = None;
        self.from.try_recv();
    }
}

/// Takes the next cause of loss that is to be reported, with its count.
fn next_loss(Losses { missed, stale, corrupt }: &mut Losses) -> Option<Captured> {
    let causes = [(missed, Cause::Driver), (stale, Cause::Evicted), (corrupt, Cause::Corrupt)];
    let (count, cause) = causes.into_iter().find(|(count, _)| **count > 0)?;
    Some(Captured::Lost(mem::take(count), cause))
}

/// Decodes pictures on the reader's thread.
struct Taker {
    wish: Wish,
    to: Sender<Picture>,
    pictures: Pool<ColorImage>,
    decoder: Option<Decoder>,
    agreed: Option<Agreed>,
    /// That of the first agreement.
    size: Option<(u32, u32)>,
    /// Where pictures of another size are decoded.
    scratch: ColorImage,
    fit: Fit,
    /// Since the picture that was handed on last.
    losses: Losses,
    /// Whether a warning about pictures that cannot be decoded was logged.
    complained: bool,
}

impl Taker {
    /// Decodes a frame, and hands it on; returns whether that was possible.
    fn decode(&mut self, frame: &Frame) -> Result<(), String> {
        let Some((agreed, size)) = self.agreed.zip(self.size) else { return Ok(()) };
        let layout = layout(&agreed, frame)?;
        let decoder = match self.decoder.take().filter(|decoder| *decoder.layout() == layout) {
            Some(decoder) => decoder,
            None => Decoder::new(&layout).map_err(|error| error.to_string())?,
        };
        let decoder = self.decoder.insert(decoder);
        // All are on their way where the other end is slow: the newest picture takes the place of one that waits.
        let Some(mut color) = self.pictures.try_take() else {
            self.losses.stale += 1;
            return Ok(());
        };
        let decoded = if agreed.size == size {
            decoder.decode(frame.planes, &mut color)
        } else {
            decoder.decode(frame.planes, &mut self.scratch).map(|()| {
                color.resize(size.0, size.1);
                self.fit.fit(&self.scratch, &mut color);
            })
        };
        decoded.map_err(|error| error.to_string())?;
        let picture = Picture { color, captured_ns: frame.captured_ns, losses: mem::take(&mut self.losses) };
        if let Ok(Some(overtaken)) = self.to.send(picture) {
            // Told with the next one.
            let Losses { missed, stale, corrupt } = overtaken.losses;
            self.losses.missed += missed;
            self.losses.stale += stale + 1;
            self.losses.corrupt += corrupt;
        }
        Ok(())
    }
}

impl Take for Taker {
    fn choose(&mut self, modes: &[Mode]) -> Result<Agreed, String> {
        let modes: Vec<FormatModes> = modes.iter().map(format_modes).collect();
        // Inside of the machine, as far as anybody can tell.
        let best = negotiate::ranked(&modes, &self.wish, Wire::Wide).map_err(|error| error.to_string())?;
        let best = best.first().ok_or("it offers nothing")?;
        let Interval { numerator, denominator } = best.interval;
        Ok(Agreed { fourcc: best.fourcc.0, size: best.size_px, rate: (denominator, numerator) })
    }

    fn begin(&mut self, agreed: &Agreed) {
        self.agreed = Some(*agreed);
        let size = *self.size.get_or_insert(agreed.size);
        if size != agreed.size {
            let ((width, height), (into_width, into_height)) = (agreed.size, size);
            tracing::warn!("the camera now gives {width}x{height}: fitted into {into_width}x{into_height}");
        }
    }

    fn frame(&mut self, frame: &Frame) {
        if let Err(error) = self.decode(frame) {
            self.losses.corrupt += 1;
            if !mem::replace(&mut self.complained, true) {
                tracing::warn!("{error}; going on without such frames");
            }
        }
    }

    fn lost(&mut self, missed: u64, stale: u64, corrupt: u64) {
        self.losses.missed += missed;
        self.losses.stale += stale;
        self.losses.corrupt += corrupt;
    }
}

/// How a frame lies in memory: formats of several components come in one plane, or in one for each.
fn layout(agreed: &Agreed, frame: &Frame) -> Result<Layout, String> {
    let apart = match (&agreed.fourcc, frame.planes.len()) {
        (_, 0 | 1) => agreed.fourcc,
        (b"NV12", _) => *b"NM12",
        (b"NV21", _) => *b"NM21",
        (b"YU12", _) => *b"YM12",
        (b"YV12", _) => *b"YM21",
        (other, _) => *other,
    };
    let (width, height) = agreed.size;
    let layout = Layout::strided(FourCc(apart), width, height, frame.stride_bytes);
    layout.map_err(|error| error.to_string())
}

/// A mode as V4L2 has them.
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
            // From 0 on: as slow as one likes.
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
mod tests {
    use super::*;

    #[test]
    fn modes_are_ranked_as_those_of_other_cameras() {
        let mode = |fourcc: &[u8; 4], sizes, rates| Mode { fourcc: *fourcc, sizes, rates };
        let modes = [
            mode(b"MJPG", Offer::These(vec![(1920, 1080), (1280, 720)]), Offer::These(vec![(30, 1), (60, 1)])),
            mode(b"YUYV", Offer::These(vec![(640, 480), (1280, 720)]), Offer::These(vec![(15, 1), (30, 1)])),
            mode(b"NV12", Offer::Range { min: (2, 2), max: (4096, 4096) }, Offer::Range { min: (0, 1), max: (120, 1) }),
        ];
        let chosen = |wish: Wish| {
            let (to, _from) = link::live();
            let mut taker = Taker {
                wish,
                to,
                pictures: Pool::new(0, ColorImage::default),
                decoder: None,
                agreed: None,
                size: None,
                scratch: ColorImage::default(),
                fit: Fit::default(),
                losses: Losses::default(),
                complained: false,
            };
            let Agreed { fourcc, size, rate } = taker.choose(&modes).unwrap();
            format!("{} {size:?} {}/{}", FourCc(fourcc), rate.0, rate.1)
        };
        let any = Wish::any(crate::layout::Content::Color);
        let format = |fourcc: &str| Wish { fourcc: Some(fourcc.parse().unwrap()), ..any };
        assert_eq!(chosen(format("YUYV")), "YUYV (1280, 720) 30/1");
        assert_eq!(chosen(format("NV12")), "NV12 (1280, 720) 30/1");
        assert_eq!(
            chosen(Wish { size_px: Some((1920, 1080)), fps: Some(60.0), ..format("MJPG") }),
            "MJPG (1920, 1080) 60/1"
        );
        assert_eq!(chosen(Wish { size_px: Some((640, 360)), ..any }), "NV12 (640, 360) 30/1");
    }
}
