//! Pads, properties, events and queries of the element. `stream` processes the pictures.

use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use gst::glib;
use gst::subclass::prelude::*;
use gst_base::prelude::*;
use gst_base::subclass::prelude::*;

use super::stream::Stream;
use crate::lateness::Lateness;
use crate::maps::{self, MapFormat, running_time};
use crate::pictures::{self, Pictures, decide_pool};
use crate::settings::{PARAM_SPECS, PROPERTIES, Values};

pub(super) static CATEGORY: LazyLock<gst::DebugCategory> =
    LazyLock::new(|| gst::DebugCategory::new("bokeh", gst::DebugColorFlags::empty(), Some("bokehcam's element")));

/// Default frame period, without a frame rate in the caps: 30 pictures a second.
pub(super) const DEFAULT_PERIOD: gst::ClockTime = gst::ClockTime::from_nseconds(33_333_333);

pub struct Imp {
    pub(super) sink: gst_base::AggregatorPad,
    pub(super) values: Mutex<Values>,
    pub(super) lateness: Mutex<Lateness>,
    pub(super) counts: Mutex<Counts>,
    /// Locked while a picture is blurred; nothing that must not block needs it.
    pub(super) stream: Mutex<Stream>,
}

/// Statistics of pictures and maps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    /// Pictures received.
    pub pictures: u64,
    /// Maps used for the first time.
    pub maps: u64,
    /// Pictures blurred with an earlier picture's map.
    pub shared: u64,
    /// Pictures dropped because they were late.
    pub late: u64,
    /// Pictures dropped before the first map.
    pub without_map: u64,
    pub quality: &'static str,
    /// Whether the blur of what is behind cannot be undone.
    pub private: bool,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The next picture overwrites any half-written state.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[glib::object_subclass]
impl ObjectSubclass for Imp {
    const NAME: &'static str = "GstBokeh";
    type Type = super::Bokeh;
    type ParentType = gst_base::Aggregator;

    fn with_class(class: &Self::Class) -> Self {
        let template = class.pad_template("sink").expect("the class has this template");
        Self {
            sink: gst::PadBuilder::<gst_base::AggregatorPad>::from_template(&template).build(),
            values: Mutex::default(),
            lateness: Mutex::new(Lateness::new(DEFAULT_PERIOD)),
            counts: Mutex::default(),
            stream: Mutex::default(),
        }
    }
}

impl ObjectImpl for Imp {
    fn properties() -> &'static [glib::ParamSpec] {
        &PARAM_SPECS
    }

    fn set_property(&self, id: usize, value: &glib::Value, _: &glib::ParamSpec) {
        let set = lock(&self.values).parse_into(PROPERTIES[id - 1], value);
        if let Err(fault) = set {
            gst::element_imp_warning!(self, gst::LibraryError::Settings, ("{fault}"));
        }
    }

    fn property(&self, id: usize, spec: &glib::ParamSpec) -> glib::Value {
        let kept = lock(&self.values).get(PROPERTIES[id - 1], spec);
        kept.unwrap_or_else(|| {
            let Counts { pictures, maps, shared, late, without_map, quality, private } = *lock(&self.counts);
            gst::Structure::builder("stats")
                .field("pictures", pictures)
                .field("maps", maps)
                .field("shared-maps", shared)
                .field("late", late)
                .field("without-map", without_map)
                .field("quality", quality)
                .field("private", private)
                .build()
                .to_value()
        })
    }

    fn constructed(&self) {
        self.parent_constructed();
        self.obj().add_pad(&self.sink).expect("a new element has no pad of this name");
    }
}

impl GstObjectImpl for Imp {}

impl ElementImpl for Imp {
    fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
        static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
            gst::subclass::ElementMetadata::new(
                "Background blur",
                "Filter/Effect/Video",
                "Blurs the background like a lens, with discs and other apertures: by depth, if the pad depth is \
                 linked, else the whole picture evenly",
                "The bokehcam maintainers",
            )
        });
        Some(&METADATA)
    }

    fn pad_templates() -> &'static [gst::PadTemplate] {
        static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> = LazyLock::new(|| {
            let pad = gst_base::AggregatorPad::static_type();
            let template = |name, direction, presence, caps: &gst::Caps| {
                gst::PadTemplate::with_gtype(name, direction, presence, caps, pad).expect("names and caps are valid")
            };
            vec![
                template("src", gst::PadDirection::Src, gst::PadPresence::Always, &pictures::caps()),
                template("sink", gst::PadDirection::Sink, gst::PadPresence::Always, &pictures::caps()),
                template("depth", gst::PadDirection::Sink, gst::PadPresence::Request, &maps::caps()),
            ]
        });
        &TEMPLATES
    }

    fn release_pad(&self, pad: &gst::Pad) {
        self.parent_release_pad(pad);
        lock(&self.stream).set_depth_pad(None);
    }
}

impl AggregatorImpl for Imp {
    fn create_new_pad(
        &self,
        template: &gst::PadTemplate,
        _: Option<&str>,
        _: Option<&gst::Caps>,
    ) -> Option<gst_base::AggregatorPad> {
        let mut stream = lock(&self.stream);
        if template.name() != "depth" || stream.depth_pad().is_some() {
            gst::warning!(CATEGORY, imp = self, "the only pad depth is already in use");
            return None;
        }
        let pad: gst_base::AggregatorPad = gst::PadBuilder::from_template(template).name("depth").build();
        stream.set_depth_pad(Some(pad.clone()));
        Some(pad)
    }

    fn start(&self) -> Result<(), gst::ErrorMessage> {
        let values = lock(&self.values).clone();
        if let Some(fault) = values.fault() {
            return Err(gst::error_msg!(gst::LibraryError::Settings, ("{fault}")));
        }
        values
            .look(&bokehcam::look::Look::default())
            .map_err(|fault| gst::error_msg!(gst::LibraryError::Settings, ("{fault}")))?;
        *lock(&self.counts) = Counts::default();
        Ok(())
    }

    fn stop(&self) -> Result<(), gst::ErrorMessage> {
        lock(&self.stream).close();
        lock(&self.lateness).reset();
        Ok(())
    }

    fn flush(&self) -> Result<gst::FlowSuccess, gst::FlowError> {
        lock(&self.stream).reset();
        lock(&self.lateness).reset();
        self.parent_flush()
    }

    fn sink_event(&self, pad: &gst_base::AggregatorPad, event: gst::Event) -> bool {
        let is_picture = *pad == self.sink;
        match event.view() {
            gst::EventView::Caps(caps) if is_picture => {
                let pictures = match Pictures::new(caps.caps_owned()) {
                    Ok(pictures) => pictures,
                    Err(fault) => {
                        gst::element_imp_error!(self, gst::CoreError::Caps, ("{fault}"));
                        return false;
                    }
                };
                // The latency is one period: a picture that takes longer is late.
                let period = pictures.period().unwrap_or(DEFAULT_PERIOD);
                lock(&self.stream).set_pictures(pictures);
                lock(&self.lateness).period = period;
                self.obj().set_latency(period, Some(period));
                self.obj().src_pad().mark_reconfigure();
            }
            gst::EventView::Caps(caps) => lock(&self.stream).set_map_format(MapFormat::from_caps(caps.caps())),
            // Output keeps the timestamps of the input.
            gst::EventView::Segment(segment) if is_picture => {
                if let Some(segment) = segment.segment().downcast_ref::<gst::ClockTime>() {
                    self.obj().update_segment(segment);
                }
            }
            gst::EventView::FlushStop(_) if is_picture => lock(&self.stream).reset(),
            gst::EventView::FlushStop(_) => lock(&self.stream).reset_maps(),
            _ => {}
        }
        self.parent_sink_event(pad, event)
    }

    fn sink_query(&self, pad: &gst_base::AggregatorPad, query: &mut gst::QueryRef) -> bool {
        match query.view_mut() {
            // Output has the format of the input.
            gst::QueryViewMut::Caps(caps) if *pad == self.sink => {
                let template = pad.pad_template_caps();
                let wanted = caps.filter().map_or_else(
                    || template.clone(),
                    |filter| filter.intersect_with_mode(&template, gst::CapsIntersectMode::First),
                );
                caps.set_result(&self.obj().src_pad().peer_query_caps(Some(&wanted)));
                true
            }
            _ => self.parent_sink_query(pad, query),
        }
    }

    fn src_event(&self, event: gst::Event) -> bool {
        if let (gst::EventView::Qos(qos), true) = (event.view(), lock(&self.values).qos) {
            lock(&self.lateness).record(qos.get());
        }
        self.parent_src_event(event)
    }

    fn next_time(&self) -> Option<gst::ClockTime> {
        // In live pipelines, this is the deadline for waiting for the depth map.
        let picture = self.sink.peek_buffer()?;
        running_time(&self.sink, &picture)
    }

    fn update_src_caps(&self, _: &gst::Caps) -> Result<gst::Caps, gst::FlowError> {
        lock(&self.stream).caps().ok_or(gst_base::AGGREGATOR_FLOW_NEED_DATA)
    }

    fn propose_allocation(
        &self,
        _: &gst_base::AggregatorPad,
        _: Option<&gst::query::Allocation>,
        query: &mut gst::query::Allocation,
    ) -> Result<(), gst::LoggableError> {
        // Any row stride is supported.
        query.add_allocation_meta::<gst_video::VideoMeta>(None);
        Ok(())
    }

    fn decide_allocation(&self, query: &mut gst::query::Allocation) -> Result<(), gst::LoggableError> {
        decide_pool(query).map_err(|fault| gst::loggable_error!(CATEGORY, "{fault}"))
    }

    fn aggregate(&self, is_late: bool) -> Result<gst::FlowSuccess, gst::FlowError> {
        match self.next_picture(is_late)? {
            Some(picture) => self.obj().finish_buffer(picture),
            None => Ok(gst::FlowSuccess::Ok),
        }
    }
}
