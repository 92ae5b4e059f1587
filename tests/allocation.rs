//! A frame allocates nothing once the executor has warmed up.
#![allow(missing_docs, unsafe_code)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::budget::Quality;
use bokehcam::frame::ColorImage;
use common::{EFFECTS, coc, noise, settings, three_depths};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it is; counting touches nothing of it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn a_frame_allocates_nothing() {
    let (width, height) = (160, 120);
    let (image, map) = (noise(width, height), three_depths(width, height));
    for effect in EFFECTS {
        for quality in [Quality::Draft, Quality::Balanced] {
            let plan = Plan::new(&Settings { quality, highlights: 4.0, ..settings(effect) }, width, height);
            let mut cpu = CpuBokeh::new(plan, Some(2));
            let mut out = ColorImage::new(width, height);
            let mut frame = || cpu.blur(&image, Some(&map), &coc(effect, height), &mut out).map(|_| ());
            frame().expect("a first frame");
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            for _ in 0..5 {
                frame().expect("a frame");
            }
            assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "{effect:?} {quality}");
        }
    }
}
