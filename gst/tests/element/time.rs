//! Flushes, seeks, latency, and the behaviour when the pipeline is late or live.

use std::sync::{Arc, Mutex};

use gst::prelude::*;

use crate::common::*;

const SIZE: (u32, u32) = (64, 48);

#[test]
fn after_a_flush_nothing_is_left_of_before() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    let mut near = map(SIZE);
    near.as_chunks_mut::<2>().0.iter_mut().for_each(|units| *units = 700_u16.to_le_bytes());
    let mut next = |index: u64, map: Vec<u8>, at: u64| {
        harness.push(timed(stripes(SIZE, index), at, 1)).unwrap();
        depth.push(timed(map, at, 1)).unwrap();
        let blurred = harness.pull().unwrap();
        assert_eq!(blurred.pts(), Some(at * PERIOD));
        bytes(&blurred)
    };
    let first: Vec<_> = (0..3).map(|index| next(index, map(SIZE), index)).collect();
    // Another scene, which changes the focus and the learned state.
    (3..9).for_each(|index| drop(next(index, near.clone(), index)));
    let flush = |harness: &mut gst_check::Harness| {
        harness.push_event(gst::event::FlushStart::new());
        harness.push_event(gst::event::FlushStop::new(true));
        harness.push_event(gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new()));
    };
    flush(&mut harness);
    flush(&mut depth);
    let mut again = |index: u64| {
        harness.push(timed(stripes(SIZE, index), index, 1)).unwrap();
        depth.push(timed(map(SIZE), index, 1)).unwrap();
        bytes(&harness.pull().unwrap())
    };
    for (index, first) in (0..).zip(&first) {
        assert!(again(index) == *first, "{index}");
    }
}

/// Starts a pipeline that ends in `fakesink name=end`; returns the times of the buffers that arrive there, too.
fn pipeline(line: &str) -> (gst::Pipeline, Arc<Mutex<Vec<gst::ClockTime>>>) {
    init();
    let pipeline = gst::parse::launch(line).unwrap().downcast::<gst::Pipeline>().unwrap();
    let times = Arc::new(Mutex::new(Vec::new()));
    let (noted, pad) = (times.clone(), pipeline.by_name("end").unwrap().static_pad("sink").unwrap());
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        noted.lock().unwrap().push(info.buffer().unwrap().pts().unwrap());
        gst::PadProbeReturn::Ok
    });
    (pipeline, times)
}

fn wait_for(pipeline: &gst::Pipeline, kind: gst::MessageType) -> gst::Message {
    let bus = pipeline.bus().unwrap();
    let message = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &[kind, gst::MessageType::Error]).unwrap();
    assert_eq!(message.type_(), kind, "{message:?}");
    message
}

/// Returns whether no filter can undo the blur of the element `b`.
fn is_private(pipeline: &gst::Pipeline) -> bool {
    pipeline.by_name("b").unwrap().property::<gst::Structure>("stats").get("private").unwrap()
}

#[test]
fn a_seek_goes_to_where_it_says() {
    let raw = "width=64,height=48,framerate=25/1";
    let (pipeline, times) = pipeline(&format!(
        "bokeh name=b ! fakesink name=end sync=false \
         videotestsrc num-buffers=60 ! video/x-raw,format=RGB,{raw} ! queue ! b.sink \
         videotestsrc num-buffers=60 pattern=gradient ! video/x-raw,format=GRAY16_LE,{raw} ! queue ! b.depth"
    ));
    pipeline.set_state(gst::State::Paused).unwrap();
    wait_for(&pipeline, gst::MessageType::AsyncDone);
    let to = gst::ClockTime::from_mseconds(800);
    pipeline.seek_simple(gst::SeekFlags::FLUSH | gst::SeekFlags::ACCURATE, to).unwrap();
    wait_for(&pipeline, gst::MessageType::AsyncDone);
    assert_eq!(pipeline.query_position::<gst::ClockTime>(), Some(to));
    assert_eq!(*times.lock().unwrap(), [gst::ClockTime::ZERO, to]);
    pipeline.set_state(gst::State::Playing).unwrap();
    wait_for(&pipeline, gst::MessageType::Eos);
    let times = times.lock().unwrap();
    assert!(times[1..].windows(2).all(|pair| pair[1] == pair[0] + PERIOD), "{times:?}");
    assert!(!is_private(&pipeline), "no call can see it");
    pipeline.set_state(gst::State::Null).unwrap();
}

#[test]
fn a_live_source_has_a_period_more_of_latency() {
    let caps = "video/x-raw,format=NV12,width=64,height=48,framerate=25/1";
    let (pipeline, times) = pipeline(&format!(
        "videotestsrc is-live=true num-buffers=20 ! {caps} ! bokeh name=b ! fakesink name=end sync=true"
    ));
    pipeline.set_state(gst::State::Playing).unwrap();
    wait_for(&pipeline, gst::MessageType::Eos);
    let mut query = gst::query::Latency::new();
    assert!(pipeline.by_name("b").unwrap().static_pad("src").unwrap().query(&mut query));
    let (live, least, _) = query.result();
    // A test source has a period of its own.
    assert_eq!((live, least), (true, 2 * PERIOD));
    assert!(is_private(&pipeline), "a call may see it");
    assert_eq!(times.lock().unwrap().len(), 20);
    pipeline.set_state(gst::State::Null).unwrap();
}

#[test]
fn live_pictures_do_not_wait_for_maps_that_are_late() {
    let raw = "width=64,height=48,framerate=25/1";
    // Every map is later than the previous one by a fifth of a second, so the delay accumulates.
    let (pipeline, times) = pipeline(&format!(
        "bokeh name=b ! fakesink name=end sync=true \
         videotestsrc is-live=true num-buffers=30 ! video/x-raw,format=RGB,{raw} ! queue ! b.sink \
         videotestsrc is-live=true num-buffers=30 pattern=gradient ! video/x-raw,format=GRAY16_LE,{raw} ! \
         identity sleep-time=200000 ! queue ! b.depth"
    ));
    let began = std::time::Instant::now();
    pipeline.set_state(gst::State::Playing).unwrap();
    wait_for(&pipeline, gst::MessageType::Eos);
    let took_ms = began.elapsed().as_millis() as u64;
    let element = pipeline.by_name("b").unwrap();
    let [pictures, maps, shared, late, without] =
        ["pictures", "maps", "shared-maps", "late", "without-map"].map(|name| stat(&element, name));
    // Thirty maps alone would take six seconds.
    assert!(took_ms < 5500, "{took_ms} ms");
    assert_eq!(pictures, 30);
    // How many come late depends on the machine, but not that each map takes its time.
    let has_maps = (1..=took_ms / 200 + 2).contains(&maps);
    assert!(has_maps && shared > 0 && without < 25, "{maps} {shared} {without} in {took_ms} ms");
    assert_eq!(times.lock().unwrap().len() as u64, pictures - without - late, "every picture is accounted for");
    pipeline.set_state(gst::State::Null).unwrap();
}

/// Pushes pictures at `fps` through an element whose sink reports that they use the fraction `load` of the available
/// time; returns the quality levels.
fn qualities(harness: &mut gst_check::Harness, fps: i32, load: f64) -> Vec<String> {
    let size = (256, 192);
    let mut caps = caps("RGB", size);
    caps.make_mut().set("framerate", gst::Fraction::new(fps, 1));
    harness.set_src_caps(caps);
    let mut next = |index: u64| {
        harness.push(timed(stripes(size, index), index, 1)).unwrap();
        harness.pull().unwrap();
        let event = gst::event::Qos::builder(gst::QOSType::Underflow, load, 0).timestamp(index * PERIOD).build();
        harness.push_upstream_event(event);
        harness.element().unwrap().property::<gst::Structure>("stats").get("quality").unwrap()
    };
    (0..40).map(&mut next).collect()
}

#[test]
fn who_hears_that_it_is_late_blurs_more_coarsely_if_it_may() {
    // A millisecond for each picture, of which other work takes four: nothing is left for the blur.
    let mut late = harness();
    late.element().unwrap().set_property_from_str("effect", "blur");
    let found = qualities(&mut late, 1000, 4.0);
    assert_eq!((found[0].as_str(), found[39].as_str()), ("balanced", "draft"), "{found:?}");
    let mut fixed = harness();
    fixed.element().unwrap().set_property_from_str("quality", "best");
    assert!(qualities(&mut fixed, 1000, 4.0).iter().all(|quality| quality == "best"));
    // A second for each picture: enough on a busy machine, too.
    let mut in_time = harness();
    assert!(qualities(&mut in_time, 1, 0.5).iter().all(|quality| quality == "balanced"));
    let mut deaf = harness();
    deaf.element().unwrap().set_property("qos", false);
    assert!(qualities(&mut deaf, 1000, 4.0).iter().all(|quality| quality == "balanced"));
}

#[test]
fn pictures_that_come_too_late_are_left_out_and_said_to_be() {
    let mut harness = harness();
    let bus = gst::Bus::new();
    harness.element().unwrap().set_bus(Some(&bus));
    harness.set_src_caps(caps("RGB", SIZE));
    harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    harness.pull().unwrap();
    let late =
        gst::event::Qos::builder(gst::QOSType::Underflow, 2.0, 60_000_000).timestamp(gst::ClockTime::ZERO).build();
    harness.push_upstream_event(late);
    // Two times 60 ms and a period: 160 ms, which is the time of the fifth picture.
    for index in 1..5 {
        harness.push(timed(stripes(SIZE, index), index, 1)).unwrap();
    }
    assert_eq!(harness.pull().unwrap().pts(), Some(4 * PERIOD));
    assert_eq!(stat(&harness.element().unwrap(), "late"), 3);
    let message = bus.timed_pop_filtered(gst::ClockTime::SECOND, &[gst::MessageType::Qos]);
    assert!(message.is_some());
}
