//! Allocations of the element: none for a picture, and none that remain from one start to the next.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use gst::prelude::*;

/// Counts allocations of a picture's size or more: GStreamer's own bookkeeping has small ones for each buffer and event.
struct Counting;

static LARGE: AtomicU64 = AtomicU64::new(0);
const LARGE_BYTES: usize = 4096;

// SAFETY: every call is forwarded to the system's allocator.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGE.fetch_add(u64::from(layout.size() >= LARGE_BYTES), Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of `GlobalAlloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller upholds the contract of `GlobalAlloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs one test at a time, because they measure the whole process.
static ALONE: Mutex<()> = Mutex::new(());

fn pipeline(line: &str) -> gst::Pipeline {
    gst::init().unwrap();
    let _ = gstbokehcam::plugin_register_static();
    gst::parse::launch(line).unwrap().downcast().unwrap()
}

fn wait_for(pipeline: &gst::Pipeline, kind: gst::MessageType) {
    let bus = pipeline.bus().unwrap();
    let message = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &[kind, gst::MessageType::Error]).unwrap();
    assert_eq!(message.type_(), kind, "{message:?}");
}

/// The check whether depth fits the pictures runs in some of the first 300, and allocates.
const SETTLED: usize = 300;
const PICTURES: usize = 350;

const RAW: &str = "width=160,height=120,framerate=25/1";

#[test]
fn a_picture_allocates_nothing_of_its_size() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for format in ["RGB", "RGBx", "NV12", "I420", "YUY2"] {
        let pipeline = pipeline(&format!(
            "bokeh name=b ! fakesink name=end \
             videotestsrc num-buffers={PICTURES} ! video/x-raw,format={format},{RAW} ! queue ! b.sink \
             videotestsrc num-buffers={PICTURES} pattern=gradient ! video/x-raw,format=GRAY16_LE,{RAW} ! queue ! b.depth"
        ));
        let counts = std::sync::Arc::new(Mutex::new(Vec::with_capacity(PICTURES)));
        let noted = counts.clone();
        let pad = pipeline.by_name("end").unwrap().static_pad("sink").unwrap();
        pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
            noted.lock().unwrap().push(LARGE.load(Ordering::Relaxed));
            gst::PadProbeReturn::Ok
        });
        pipeline.set_state(gst::State::Playing).unwrap();
        wait_for(&pipeline, gst::MessageType::Eos);
        pipeline.set_state(gst::State::Null).unwrap();
        let counts = counts.lock().unwrap();
        assert_eq!(counts.len(), PICTURES);
        assert_eq!(counts[PICTURES - 1] - counts[SETTLED], 0, "{format}: {:?}", &counts[SETTLED..]);
    }
}

/// Returns the bytes that the process has from `malloc`, and its number of threads. Resident memory says less: the C
/// library keeps freed memory in a pool for each thread.
fn held() -> (usize, usize) {
    // SAFETY: it only reads the allocator's own counts.
    #[allow(unsafe_code)]
    let allocator = unsafe { libc::mallinfo2() };
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let threads = status.lines().find_map(|line| line.strip_prefix("Threads:")).unwrap();
    (allocator.uordblks + allocator.hblkhd, threads.trim().parse().unwrap())
}

#[test]
fn a_thousand_changes_of_state_leave_nothing_behind() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let pipeline = pipeline(&format!(
        "bokeh name=b ! fakesink async=true \
         videotestsrc ! video/x-raw,format=RGB,{RAW} ! queue ! b.sink \
         videotestsrc pattern=gradient ! video/x-raw,format=GRAY16_LE,{RAW} ! queue ! b.depth"
    ));
    let mut before = (0, 0);
    for start in 0..250 {
        // To a first picture and back: four state changes.
        pipeline.set_state(gst::State::Paused).unwrap();
        wait_for(&pipeline, gst::MessageType::AsyncDone);
        pipeline.set_state(gst::State::Null).unwrap();
        if start == 49 {
            before = held();
        }
    }
    let after = held();
    let grown = after.0.saturating_sub(before.0);
    println!("200 starts: {before:?}, then {after:?}");
    // 1 kB a start, where a leaked picture each would be 58.
    assert!(grown < 200_000, "200 starts left {grown} bytes");
    // GLib keeps idle threads for a while.
    assert!(after.1 < before.1 + 20, "{} threads, then {}", before.1, after.1);
}
