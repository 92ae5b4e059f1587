//! Depth maps in GStreamer's memory, and their assignment to pictures.

use bokehcam::frame::DepthMap;
use bokehcam_live::layout::MAX_SIDE_PX;
use gst::prelude::*;
use gst_base::prelude::*;

/// Returns the caps of the pad `depth`. `GRAY_F32LE` exists since GStreamer 1.30; an application can send it in any
/// version, as no other element inspects it.
pub fn caps() -> gst::Caps {
    let sides = gst::IntRange::new(1, MAX_SIDE_PX as i32);
    gst::Caps::builder("video/x-raw")
        .field("format", gst::List::new(["GRAY16_LE", "GRAY16_BE", "GRAY_F32LE"]))
        .field("width", sides)
        .field("height", sides)
        .field("framerate", gst::FractionRange::new(gst::Fraction::new(0, 1), gst::Fraction::new(i32::MAX, 1)))
        .build()
}

/// Conversion of stored numbers to metres.
#[derive(Clone, Copy, Debug)]
pub struct Units {
    pub per_m: f32,
    pub invalid: u16,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Units16 { big_endian: bool },
    Metres,
}

/// Format of a stream of maps.
#[derive(Clone, Copy, Debug)]
pub struct MapFormat {
    kind: Kind,
    /// Width and height, in pixels.
    pub size: (u32, u32),
    /// Frame period, if constant.
    period: Option<gst::ClockTime>,
}

impl MapFormat {
    /// Parses caps; returns `None` if they do not match [`caps`].
    pub fn from_caps(caps: &gst::CapsRef) -> Option<Self> {
        let fields = caps.structure(0)?;
        let side = |name: &str| fields.get::<i32>(name).ok().and_then(|side| u32::try_from(side).ok());
        let kind = match fields.get::<&str>("format").ok()? {
            "GRAY16_LE" => Kind::Units16 { big_endian: false },
            "GRAY16_BE" => Kind::Units16 { big_endian: true },
            "GRAY_F32LE" => Kind::Metres,
            _ => return None,
        };
        let fps = fields.get::<gst::Fraction>("framerate").ok().filter(|fps| fps.numer() > 0);
        let period = fps.and_then(|fps| gst::ClockTime::SECOND.mul_div_round(fps.denom() as u64, fps.numer() as u64));
        Some(Self { kind, size: (side("width")?, side("height")?), period })
    }

    /// Decodes a map into `map`, resized to fit.
    ///
    /// # Errors
    /// Fails if the memory is too small.
    fn read(&self, buffer: &gst::BufferRef, units: Units, map: &mut DepthMap) -> Result<(), String> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let row_bytes = width * if matches!(self.kind, Kind::Metres) { 4 } else { 2 };
        let (offset, stride) = match buffer.meta::<gst_video::VideoMeta>() {
            Some(meta) => (meta.offset()[0], usize::try_from(meta.stride()[0]).unwrap_or(0)),
            // GStreamer's default stride.
            None => (0, row_bytes.next_multiple_of(4)),
        };
        let memory = buffer.map_readable().map_err(|error| error.to_string())?;
        let needed = offset + stride * (height - 1) + row_bytes;
        if stride < row_bytes || memory.len() < needed {
            return Err(format!("a depth map is cut short: {} of {needed} bytes", memory.len()));
        }
        map.resize(self.size.0, self.size.1);
        let rows = memory[offset..].chunks(stride).zip(map.metres.chunks_exact_mut(width));
        match self.kind {
            Kind::Units16 { big_endian: false } => read_units(rows, u16::from_le_bytes, units),
            Kind::Units16 { big_endian: true } => read_units(rows, u16::from_be_bytes, units),
            Kind::Metres => {
                for (row, metres) in rows {
                    for (metres, bytes) in metres.iter_mut().zip(row.as_chunks().0) {
                        *metres = known_or_zero(f32::from_le_bytes(*bytes));
                    }
                }
            }
        }
        Ok(())
    }
}

fn read_units<'a>(
    rows: impl Iterator<Item = (&'a [u8], &'a mut [f32])>,
    number: impl Fn([u8; 2]) -> u16,
    Units { per_m, invalid }: Units,
) {
    for (row, metres) in rows {
        for (metres, bytes) in metres.iter_mut().zip(row.as_chunks().0) {
            let value = number(*bytes);
            // Bit-identical to the reader of recordings.
            *metres = if value == invalid { 0.0 } else { known_or_zero(f32::from(value) / per_m) };
        }
    }
}

fn known_or_zero(metres: f32) -> f32 {
    if DepthMap::is_known(metres) { metres } else { 0.0 }
}

/// State of the depth map for a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// A map; `is_new` if it differs from the previous picture's.
    Map { is_new: bool },
    /// No map, now or before.
    Nothing,
    /// The map may still arrive.
    Wait,
}

/// Maps received through a pad.
#[derive(Debug, Default)]
pub struct Maps {
    /// Format from the pad's caps.
    pub format: Option<MapFormat>,
    /// The current map.
    last: Option<(gst::Buffer, MapFormat)>,
    /// Whether no picture has used it yet.
    is_new: bool,
}

/// Returns the running time of a buffer on its pad.
pub fn running_time(pad: &gst_base::AggregatorPad, buffer: &gst::BufferRef) -> Option<gst::ClockTime> {
    pad.segment().downcast_ref::<gst::ClockTime>()?.to_running_time(buffer.pts())
}

impl Maps {
    /// Finds the map of a picture due at `due`: the newest one due at most half a `period` later, or the first one if
    /// there is no earlier. It stays current until the next one is due. A map stays queued in its pad while it may also
    /// serve the next picture, so that no picture waits for a map it does not need. Without timestamps, each picture
    /// uses one map. After the deadline (`is_late`), the previous map is used.
    pub fn find(
        &mut self,
        pad: &gst_base::AggregatorPad,
        due: Option<gst::ClockTime>,
        period: gst::ClockTime,
        is_late: bool,
    ) -> Found {
        loop {
            let (Some(buffer), Some(format)) = (pad.peek_buffer(), self.format) else {
                return match &self.last {
                    Some(_) if is_late || pad.is_eos() => self.current(),
                    None if is_late || pad.is_eos() => Found::Nothing,
                    _ => Found::Wait,
                };
            };
            let times = running_time(pad, &buffer).zip(due.map(|due| due + period / 2));
            let Some((begins, due)) = times else {
                pad.drop_buffer();
                self.set_current(buffer, format);
                return self.current();
            };
            if begins >= due && self.last.is_some() {
                return self.current();
            }
            let ends = buffer.duration().or(format.period).map(|duration| begins + duration);
            self.set_current(buffer, format);
            if begins >= due || ends.is_some_and(|ends| ends >= due) {
                return self.current();
            }
            pad.drop_buffer();
        }
    }

    fn set_current(&mut self, buffer: gst::Buffer, format: MapFormat) {
        self.is_new |= self.last.as_ref().is_none_or(|(last, _)| last.as_ptr() != buffer.as_ptr());
        self.last = Some((buffer, format));
    }

    fn current(&mut self) -> Found {
        Found::Map { is_new: std::mem::take(&mut self.is_new) }
    }

    /// Returns width and height of the current map.
    pub fn size(&self) -> Option<(u32, u32)> {
        self.last.as_ref().map(|(_, format)| format.size)
    }

    /// Decodes the current map.
    ///
    /// # Errors
    /// Fails without a current map, or if it is truncated.
    pub fn read(&self, units: Units, map: &mut DepthMap) -> Result<(), String> {
        let (buffer, format) = self.last.as_ref().ok_or("there is no depth map")?;
        format.read(buffer, units, map)
    }

    /// Discards the maps, for a seek or a new scene.
    pub fn reset(&mut self) {
        (self.last, self.is_new) = (None, false);
    }
}
