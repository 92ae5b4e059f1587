//! Per-frame work does not allocate after the warm-up.
#![allow(missing_docs, unsafe_code)]

#[path = "../../../../tests/common/mod.rs"]
mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::slices::{Radii, SliceBlur};
use bokehcam::budget::{Governor, Quality, Sample};
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};
use bokehcam::compute::Backend;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::depth::matting::Matting;
use bokehcam::depth::refine::Refiner;
use bokehcam::depth::stereo::source::StereoDepth;
use bokehcam::depth::stereo::{self, Effort};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::link::live;
use bokehcam::link::pool::{Pool, Pooled};
use bokehcam::optics::CocKind;
use common::{COC_KINDS, coc, noise, settings, three_depths};
use glam::{DMat3, DVec2, DVec3};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is forwarded to the system's allocator; the counter does not touch its memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller upholds the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A single test, because parallel tests would be counted as well.
#[test]
fn a_frame_allocates_nothing() {
    blur();
    slices();
    levels();
    refinement();
    two_eyes();
    rectification();
    hand_over();
    window();
}

/// A frame in the window: its depth, and painting unscaled and scaled.
fn window() {
    use bokehcam_window::present::{Area, Drawing, Image, soft::Painter};
    use bokehcam_window::views::DepthView;

    let (color, depth) = (noise(160, 90), three_depths(160, 90));
    let mut depth_view = DepthView::default();
    let mut painter = Painter::new();
    painter.resize((320, 200));
    let mut pixels = vec![0; 320 * 200];
    let mut frame = |at: u64| {
        let picture = depth_view.draw(&depth, color.size());
        let areas = [Area { x: 80, y: 55, width: 160, height: 90 }, Area { x: 0, y: 10, width: 320, height: 180 }];
        for area in areas {
            let drawing = Drawing {
                area,
                visible_region: None,
                picture: Image::Memory(picture),
                before: Some((&color, 0.4)),
                mirror: at.is_multiple_of(2),
                stale: at.is_multiple_of(3),
                background: [1, 2, 3],
            };
            painter.paint(&mut pixels, &drawing);
        }
    };
    // All combinations of sizes, mirrored or not, stale or not.
    (0..12).for_each(&mut frame);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    (12..40).for_each(frame);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "a window's frame");
}

/// Rectification of both pictures of a stereo pair.
fn rectification() {
    let eye = |shift_px: f64| CameraIntrinsics {
        size: Some((160, 120)),
        focal_px: DVec2::splat(140.0),
        center_px: DVec2::new(80.0 + shift_px, 60.0),
        distortion: Distortion::RadialTangential([-0.2, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    };
    let calibration = StereoCalibration {
        cameras: [eye(0.0), eye(3.0)],
        rotation: DMat3::from_rotation_z(0.01),
        translation_m: DVec3::new(-0.06, 0.0, 0.001),
        stored_rectification: None,
        unit: LengthUnit::Stated,
    };
    let rectifier = Rectifier::new(&calibration, (160, 120)).unwrap();
    let left = noise(160, 120);
    let mut right = GrayImage::default();
    right.set_luma_from(&left);
    let (mut into_left, mut into_right) = (ColorImage::default(), GrayImage::default());
    let mut before = 0;
    for frame in 0..4 {
        if frame == 1 {
            before = ALLOCATIONS.load(Ordering::Relaxed);
        }
        rectifier.rectify_left(&left, &mut into_left);
        rectifier.rectify_right(&right, &mut into_right);
    }
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
}

/// Passing buffers between threads and back to their pool, with both ends blocking occasionally.
fn hand_over() {
    const READ: usize = 1_000;
    let pool = Pool::new(2, || ColorImage::new(16, 16));
    let (mut to, mut from) = live::<Pooled<ColorImage>>();
    let allocations = thread::scope(|scope| {
        let reader = scope.spawn(move || {
            // Threads allocate when they start; the first sleep and wake-up may, too.
            let mut before = 0;
            for read in 0..READ {
                if read == READ / 5 {
                    before = ALLOCATIONS.load(Ordering::Relaxed);
                }
                if read % 100 < 50 {
                    thread::sleep(Duration::from_micros(20));
                }
                drop(from.recv().expect("a frame"));
            }
            ALLOCATIONS.load(Ordering::Relaxed) - before
        });
        // With a slow reader both buffers are in use, and this end blocks. It continues until the reader is gone.
        for frame in 0.. {
            if to.send(pool.take()).is_err() {
                break;
            }
            if frame % 100 >= 50 {
                thread::sleep(Duration::from_micros(20));
            }
        }
        reader.join().expect("the reader")
    });
    assert_eq!(allocations, 0, "over {READ} frames");
}

fn refinement() {
    let (width, height) = (160, 120);
    let image = noise(width, height);
    for share in [1, 4] {
        let mut measured = three_depths(width / share, height / share);
        measured.metres.iter_mut().step_by(7).for_each(|z_m| *z_m = 0.0);
        let (mut refiner, mut map) = (Refiner::new(), DepthMap::default());
        let (mut matting, mut workers) = (Matting::default(), ThreadPool::new("depth", 2));
        let mut frame = |index: u64| {
            map.resize(measured.width, measured.height);
            map.metres.copy_from_slice(&measured.metres);
            refiner.refine_with_workers(&mut workers, &mut map, &image, index * 33_000_000);
            matting.find_with_background(&mut workers, (&mut map, &image), 0.05, None);
        };
        frame(0);
        frame(1);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        (2..7).for_each(&mut frame);
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "depth of 1/{share} of the size");
    }
}

/// Rectification and stereo matching on the CPU, with changing effort.
fn two_eyes() {
    let size = (160, 120);
    let eye = |center_y_px| CameraIntrinsics {
        size: Some(size),
        focal_px: DVec2::splat(150.0),
        center_px: DVec2::new(80.0, center_y_px),
        distortion: Distortion::RadialTangential([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    };
    let calibration = StereoCalibration {
        cameras: [eye(60.0), eye(57.0)],
        rotation: DMat3::IDENTITY,
        translation_m: DVec3::new(-0.1, 0.0, 0.0),
        stored_rectification: None,
        unit: LengthUnit::Stated,
    };
    let rectifier = Rectifier::new(&calibration, size).expect("maps");
    let settings = stereo::Settings { size, disparities: 16, effort: Effort::Full, threads: 2 };
    let matcher = stereo::create(&settings, Backend::Cpu, None).expect("a matcher");
    let mut depth = StereoDepth::from_raw("two eyes", rectifier, matcher, 16);
    let (raw, mut right, mut map) = (noise(size.0, size.1), GrayImage::default(), DepthMap::default());
    right.set_luma_from(&raw);
    let mut color = raw.clone();
    let mut frame = |index: usize| {
        depth.rectify(&mut color);
        let stamp = Stamp { index, time_ns: index as u64, captured_ns: None };
        depth.set_effort(index % 2);
        depth.read(FrameInput { stamp, color: &color, right: Some(&right) }, &mut map).expect("depth");
    };
    // The first frames are checked for being rectified already.
    (0..6).for_each(&mut frame);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    (6..11).for_each(&mut frame);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "depth from two eyes");
}

fn blur() {
    let (width, height) = (160, 120);
    let (image, map) = (noise(width, height), three_depths(width, height));
    for effect in COC_KINDS {
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

/// Slices of caller-owned memory do not allocate either, for both pixel types.
fn slices() {
    let size = (160, 120);
    let map = three_depths(size.0, size.1);
    let (codes, light) = (noise(size.0, size.1).rgb, vec![0.5f32; map.metres.len() * 3]);
    let radii: Vec<f32> = (0..map.metres.len()).map(|k| (k % 160) as f32 * 0.1 - 6.0).collect();
    let mut slices = SliceBlur::new(&settings(CocKind::Depth), size, Some(2)).expect("radii that are possible");
    let (mut blurred, mut brighter) = (codes.clone(), light.clone());
    let mut frame = || {
        let go_on = || ControlFlow::Continue(());
        assert!(slices.blur(&codes, Radii::Each(&radii), &mut blurred, go_on).expect("a frame").is_continue());
        assert!(slices.blur(&light, Radii::Each(&radii), &mut brighter, go_on).expect("a frame").is_continue());
    };
    frame();
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    (0..5).for_each(|_| frame());
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
}

/// Changing the quality level does not allocate, not even the first time.
fn levels() {
    let (width, height) = (160, 120);
    let (image, map) = (noise(width, height), three_depths(width, height));
    for effect in COC_KINDS {
        let plan = Plan::new(&Settings { adaptive: true, highlights: 4.0, ..settings(effect) }, width, height);
        let mut cpu = CpuBokeh::new(plan, Some(2));
        let mut out = ColorImage::new(width, height);
        cpu.blur(&image, Some(&map), &coc(effect, height), &mut out).expect("a first frame");
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for quality in Quality::ALL.into_iter().chain([Quality::Draft, Quality::Best, Quality::Balanced]) {
            cpu.set_quality(quality);
            cpu.blur(&image, Some(&map), &coc(effect, height), &mut out).expect("a frame");
            assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "{effect:?} {quality}");
        }
    }
    let mut governor = Governor::new(&[1.0, 2.0], 1);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for at_ns in 0..2000 {
        let took_ns = if at_ns / 500 % 2 == 0 { 3_000 } else { 300 };
        governor.record(Sample { level: governor.level(), took_ns, at_ns }, 1_000);
    }
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before, "governor");
}
