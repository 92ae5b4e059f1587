//! Processing of pictures: finds the depth map, blurs, and pushes the result.

use std::time::Instant;

use bokehcam::engine::FrameProcessor;
use bokehcam::look::{Change, Effect, Look, LookFacts, Metres};
use bokehcam_media::recording::depth_covers;
use gst::subclass::prelude::*;
use gst_base::prelude::*;

use super::imp::{CATEGORY, DEFAULT_PERIOD, Imp, lock};
use crate::maps::{Found, MapFormat, Maps, Units, running_time};
use crate::pictures::Pictures;
use crate::settings::as_properties;

/// State of the stream.
#[derive(Default)]
pub struct Stream {
    depth_pad: Option<gst_base::AggregatorPad>,
    pictures: Option<Pictures>,
    maps: Maps,
    processor: Option<FrameProcessor>,
    /// Parameters of the processor: the look, the version of the settings, whether there is depth, and whether the
    /// pipeline is live.
    look: Look,
    version: u64,
    has_depth: bool,
    is_live: bool,
    time: MediaTime,
    /// Whether the warning about missing maps was posted.
    has_warned: bool,
}

impl Stream {
    pub fn depth_pad(&self) -> Option<&gst_base::AggregatorPad> {
        self.depth_pad.as_ref()
    }

    pub fn set_depth_pad(&mut self, pad: Option<gst_base::AggregatorPad>) {
        (self.depth_pad, self.maps) = (pad, Maps::default());
    }

    pub fn set_pictures(&mut self, pictures: Pictures) {
        if self.pictures.as_ref().is_none_or(|before| before.size() != pictures.size()) {
            self.processor = None;
        }
        self.pictures = Some(pictures);
    }

    pub fn set_map_format(&mut self, format: Option<MapFormat>) {
        self.maps.format = format;
    }

    /// Returns the caps of the output, which are those of the input.
    pub fn caps(&self) -> Option<gst::Caps> {
        self.pictures.as_ref().map(Pictures::caps)
    }

    /// Discards the state of past pictures, for a seek or a new scene.
    pub fn reset(&mut self) {
        self.processor.iter_mut().for_each(FrameProcessor::clear_history);
        self.reset_maps();
        self.time.reset();
    }

    pub fn reset_maps(&mut self) {
        self.maps.reset();
    }

    /// Discards everything but the pad, at the end of the stream.
    pub fn close(&mut self) {
        *self = Self { depth_pad: self.depth_pad.take(), ..Self::default() };
    }

    fn period(&self) -> gst::ClockTime {
        self.pictures.as_ref().and_then(Pictures::period).unwrap_or(DEFAULT_PERIOD)
    }

    fn find_map(&mut self, due: Option<gst::ClockTime>, is_late: bool) -> Found {
        let period = self.period();
        match &self.depth_pad {
            Some(pad) => self.maps.find(pad, due, period, is_late),
            None => Found::Nothing,
        }
    }
}

/// Time since the first picture, strictly increasing even if seeks reset the running time.
#[derive(Debug, Default)]
struct MediaTime {
    /// Running time minus media time.
    offset_ns: Option<i128>,
    last_ns: Option<u64>,
}

impl MediaTime {
    fn next_ns(&mut self, due: Option<gst::ClockTime>, period: gst::ClockTime) -> u64 {
        let next_ns = self.last_ns.map_or(0, |last_ns| last_ns + period.nseconds());
        let time_ns = due.map_or(next_ns, |due| {
            let due_ns = i128::from(due.nseconds());
            let offset_ns = *self.offset_ns.get_or_insert(due_ns - i128::from(next_ns));
            let later = u64::try_from(due_ns - offset_ns).ok().filter(|&ns| self.last_ns.is_none_or(|last| ns > last));
            later.unwrap_or_else(|| {
                self.offset_ns = Some(due_ns - i128::from(next_ns));
                next_ns
            })
        });
        self.last_ns = Some(time_ns);
        time_ns
    }

    fn reset(&mut self) {
        self.offset_ns = None;
    }
}

impl Imp {
    /// Returns the next output picture, `None` if one is dropped. With `is_late`, the deadline for waiting has passed.
    ///
    /// # Errors
    /// Returns `Eos`, `NEED_DATA` if the input is incomplete, or `Error` after posting an error message.
    pub(super) fn next_picture(&self, is_late: bool) -> Result<Option<gst::Buffer>, gst::FlowError> {
        let Some(input) = self.sink.peek_buffer() else {
            return Err(match self.sink.is_eos() {
                true => gst::FlowError::Eos,
                false => gst_base::AGGREGATOR_FLOW_NEED_DATA,
            });
        };
        let stream = &mut *lock(&self.stream);
        let (due, period) = (running_time(&self.sink, &input), stream.period());
        let found = stream.find_map(due, is_late);
        if found == Found::Wait {
            return Err(gst_base::AGGREGATOR_FLOW_NEED_DATA);
        }
        self.sink.drop_buffer();
        if let Some(position) = input.pts() {
            self.obj().set_position(position);
        }
        self.count_map(found);
        // A depth pad that ends before its first map counts as unlinked.
        if found == Found::Nothing && stream.depth_pad.as_ref().is_some_and(|pad| !pad.is_eos()) {
            lock(&self.counts).without_map += 1;
            if !std::mem::replace(&mut stream.has_warned, true) {
                const WHY: &str = "pictures are dropped until the first depth map arrives at the pad depth";
                gst::element_imp_warning!(self, gst::StreamError::Failed, ("{WHY}"));
            }
            return Ok(None);
        }
        if lock(&self.lateness).is_too_late(due, Instant::now()) {
            self.drop_late(&input, due);
            return Ok(None);
        }
        self.sync_controllers(&input);
        self.update_processor(stream, found != Found::Nothing)?;
        self.blur(stream, input, due, period).map_err(|fault| {
            gst::element_imp_error!(self, gst::StreamError::Failed, ("{}", as_properties(&fault)));
            gst::FlowError::Error
        })
    }

    fn count_map(&self, found: Found) {
        let mut counts = lock(&self.counts);
        counts.pictures += 1;
        match found {
            Found::Map { is_new: true } => counts.maps += 1,
            Found::Map { is_new: false } => counts.shared += 1,
            Found::Nothing | Found::Wait => {}
        }
    }

    /// Updates the properties with active controllers.
    fn sync_controllers(&self, input: &gst::BufferRef) {
        if self.obj().has_active_control_bindings() {
            let segment = self.sink.segment();
            let time = segment.downcast_ref::<gst::ClockTime>().and_then(|segment| segment.to_stream_time(input.pts()));
            if let Some(time) = time {
                // Fails only for a broken binding, which GStreamer logs.
                let _ = self.obj().sync_values(time);
            }
        }
    }

    /// Applies changed settings to the processor, or creates it.
    fn update_processor(&self, stream: &mut Stream, has_depth: bool) -> Result<(), gst::FlowError> {
        // Only a live pipeline has a latency.
        let is_live = self.obj().latency().is_some();
        let values = {
            let values = lock(&self.values);
            let made_for = (stream.version, stream.has_depth, stream.is_live);
            if stream.processor.is_some() && made_for == (values.version, has_depth, is_live) {
                return Ok(());
            }
            values.clone()
        };
        if stream.has_depth != has_depth {
            stream.processor = None;
        }
        (stream.version, stream.has_depth, stream.is_live) = (values.version, has_depth, is_live);
        let size = stream.pictures.as_ref().map(Pictures::size).ok_or(gst::FlowError::NotNegotiated)?;
        let followed = values.look(&stream.look).and_then(|look| {
            let metres = Metres::Known;
            let facts = LookFacts { has_depth, metres, size, is_for_call: is_live, ..LookFacts::default() };
            let (fitting, _) = look.change(&Change::default(), &facts).map_err(|error| error.to_string())?;
            if let Some(small) = fitting.small_blur(size) {
                gst::element_imp_info!(self, gst::LibraryError::Settings, ("{}", as_properties(&small.to_string())));
            }
            let done = match &mut stream.processor {
                Some(processor) => processor.set_look(&fitting),
                None => {
                    if look.effect == Effect::Auto && !has_depth {
                        const WHY: &str = "without depth, the whole picture is blurred evenly: link a depth map to the \
                                           pad depth, or set the property effect";
                        gst::element_imp_info!(self, gst::StreamError::Failed, ("{WHY}"));
                    }
                    let made = FrameProcessor::new(&fitting, size, has_depth, true, values.computing());
                    made.map(|processor| stream.processor = Some(processor))
                }
            };
            stream.look = look;
            lock(&self.counts).private = fitting.is_private();
            done.map_err(|error| error.to_string())
        });
        match followed {
            Ok(()) => Ok(()),
            // The previous look stays in use.
            Err(fault) if stream.processor.is_some() => {
                gst::element_imp_warning!(self, gst::LibraryError::Settings, ("{}", as_properties(&fault)));
                Ok(())
            }
            Err(fault) => {
                gst::element_imp_error!(self, gst::LibraryError::Settings, ("{}", as_properties(&fault)));
                Err(gst::FlowError::Error)
            }
        }
    }

    /// Blurs a picture by its depth map.
    fn blur(
        &self,
        stream: &mut Stream,
        input: gst::Buffer,
        due: Option<gst::ClockTime>,
        period: gst::ClockTime,
    ) -> Result<Option<gst::Buffer>, String> {
        let Stream { processor: Some(processor), pictures: Some(pictures), maps, time, .. } = stream else {
            return Err("a picture came before its format".to_owned());
        };
        if let Some(budget_ns) = lock(&self.lateness).budget_ns(processor.expected_blur_ns()) {
            processor.set_budget(budget_ns);
        }
        let Some(quality) = processor.quality() else { return Ok(Some(input)) };
        let needs_depth = processor.needs_depth();
        let (color, depth) = processor.frame_buffers();
        pictures.read(&input, color)?;
        if needs_depth {
            let (found, size) = (maps.size().unwrap_or_default(), pictures.size());
            if !depth_covers(found, size) {
                return Err(format!(
                    "a depth map of {}x{} pixels does not cover pictures of {}x{}: it must show the same view, with \
                     the same number of pixels or fewer",
                    found.0, found.1, size.0, size.1
                ));
            }
            let units = {
                let values = lock(&self.values);
                Units { per_m: values.depth_scale, invalid: values.depth_invalid }
            };
            maps.read(units, depth)?;
        }
        let blurred = processor.process(time.next_ns(due, period)).map_err(|error| error.to_string())?;
        let pool = self.obj().buffer_pool().ok_or("there is no pool of buffers")?;
        // The base class leaves activation to the caller.
        if !pool.is_active() {
            pool.set_active(true).map_err(|error| error.to_string())?;
        }
        let mut output = pool.acquire_buffer(None).map_err(|error| format!("no buffer: {error}"))?;
        {
            let output = output.get_mut().ok_or("a new buffer is in use")?;
            pictures.write(blurred, output)?;
            let copied = input.copy_into(output, gst::BufferCopyFlags::FLAGS | gst::BufferCopyFlags::TIMESTAMPS, ..);
            copied.map_err(|error| error.to_string())?;
        }
        lock(&self.counts).quality = quality.name();
        if let Some(remark) = processor.take_warning() {
            gst::element_imp_warning!(self, gst::StreamError::Failed, ("{}", as_properties(&remark)));
        }
        Ok(Some(output))
    }

    /// Counts a late picture, and posts a QoS message.
    fn drop_late(&self, input: &gst::BufferRef, due: Option<gst::ClockTime>) {
        let (done, late) = {
            let mut counts = lock(&self.counts);
            counts.late += 1;
            (counts.pictures - counts.late - counts.without_map, counts.late)
        };
        gst::debug!(CATEGORY, imp = self, "dropped, as it is late: {due:?}");
        let message = gst::message::Qos::builder(false)
            .running_time(due)
            .timestamp(input.pts())
            .duration(input.duration())
            .stats(gst::format::Buffers::from_u64(done), gst::format::Buffers::from_u64(late))
            .src(&*self.obj())
            .build();
        // Fails only without a bus.
        let _ = self.obj().post_message(message);
    }
}
