//! GPU device loss, hangs and out-of-memory during a run: the CPU takes over, and no frame is lost. A Vulkan layer
//! (gpu_faults/layer.c) injects the faults; a test under it runs in a separate process.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;
mod runs;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::gpu::run_self_test;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{self, Bokeh, BokehError, Job};
use bokehcam::compute::Backend;
use bokehcam::compute::device::Device;
use bokehcam::depth::matting::Matting;
use bokehcam::depth::refine::Refiner;
use bokehcam::depth::stereo::{self, Effort, Pair};
use bokehcam::frame::{ColorImage, DisparityMap, GrayImage, MixedPixel, YuyvImage};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam_live::sink::yuyv;
use common::{coc, noise, settings, three_depths};
use tempfile::TempDir;

const SIZE: (u32, u32) = (96, 64);
/// Maximum difference between the executors, in 8-bit codes.
const CODES: u8 = 4;
const FRAMES: u64 = 8;

fn device() -> Device {
    Device::open(false, None).expect("a Vulkan adapter, software included")
}

fn layer() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let source = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/gpu_faults/layer.c"));
    let library = folder.path().join("layer.so");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(source);
    assert!(compiler.status().expect("a C compiler").success());
    let manifest = serde_json::json!({
        "file_format_version": "1.1.2",
        "layer": {
            "name": "VK_LAYER_bokehcam_faults",
            "type": "GLOBAL",
            "library_path": library,
            "api_version": "1.3.0",
            "implementation_version": "1",
            "description": "faults",
        },
    });
    fs::write(folder.path().join("layer.json"), manifest.to_string()).unwrap();
    folder
}

fn under<'a>(layer: &TempDir, fault: &str, command: &'a mut Command) -> &'a mut Command {
    command.env("VK_LAYER_PATH", layer.path()).env("VK_INSTANCE_LAYERS", "VK_LAYER_bokehcam_faults");
    command.env("FAULT", fault)
}

/// Runs a test of this file in a separate process under the layer; returns its output.
fn test_under(layer: &TempDir, fault: &str, test: &str) -> String {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", &format!("gpu_faults::{test}"), "--nocapture"]);
    let output = under(layer, fault, &mut command).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{fault}: {told}");
    told
}

/// Asserts which executors a test reports when run under the layer with this fault.
fn assert_ran(layer: &TempDir, fault: &str, test: &str, ran: &str) {
    let told = test_under(layer, fault, test);
    let line = told.lines().find_map(|line| line.find("ran on").map(|at| &line[at..]));
    assert_eq!(line, Some(ran), "{fault}: {told}");
}

/// Opens a device, and runs `run_self_test` on it.
fn tried(run_self_test: impl FnOnce(&Arc<Device>)) -> Arc<Device> {
    let device = Arc::new(device());
    run_self_test(&device);
    impatient(device)
}

/// Shortens the timeout of a device, after its self-test, whose compilation of the shaders could exceed it. Only one
/// that is to hang gets less than a busy machine may take for a frame.
fn impatient(device: Arc<Device>) -> Arc<Device> {
    let hangs = std::env::var("FAULT").is_ok_and(|fault| fault.starts_with("hang"));
    let timeout = Duration::from_secs(if hangs { 1 } else { 20 });
    Arc::new(Arc::into_inner(device).expect("nobody else has it").with_hang_timeout(timeout))
}

/// Creates a frame; every other one requests YUYV output.
fn job(ticket: u64) -> Job {
    let (color, depth) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
    let yuyv = (ticket % 2 == 1).then(|| Pooled::detached(YuyvImage::default()));
    let job = Job::new(Pooled::detached(color), Some(Pooled::detached(depth)), coc(CocKind::Depth, SIZE.1));
    Job { ticket, yuyv, ..job }
}

/// Blurs frames, and compares each with the CPU's result; calls `before` before each.
fn blur(bokeh: &mut dyn Bokeh, mut before: impl FnMut(u64)) {
    let mut expected = ColorImage::default();
    let Job { color, depth, coc, .. } = job(0);
    let mut cpu = CpuBokeh::new(Plan::new(&settings(CocKind::Depth), SIZE.0, SIZE.1), Some(1));
    cpu.blur(&color, depth.as_deref(), &coc, &mut expected).unwrap();
    let mut expected_yuyv = YuyvImage::new(SIZE.0, SIZE.1);
    yuyv::Encoder::new().encode(&expected, &mut expected_yuyv.bytes);
    let (mut submitted, mut collected) = (0, 0);
    while collected < FRAMES {
        if submitted < FRAMES && bokeh.in_flight() < bokeh.capacity() {
            before(submitted);
            bokeh.submit(job(submitted)).expect("the frame is taken");
            submitted += 1;
            continue;
        }
        let mut finished = bokeh.collect(true).expect("the frame is blurred").expect("a frame is in flight");
        assert_eq!(finished.ticket, collected);
        let size = finished.picture.size();
        let (picture, expected) = match finished.picture.yuyv_mut() {
            Some(picture) => (&picture.bytes, &expected_yuyv.bytes),
            None => (&finished.picture.memory().expect("it is in memory").rgb, &expected.rgb),
        };
        let worst = picture.iter().zip(expected).map(|(&a, &b)| a.abs_diff(b)).max();
        assert!(
            size == SIZE && picture.len() == expected.len() && worst <= Some(CODES),
            "frame {collected}: {worst:?}"
        );
        collected += 1;
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_destroyed_device_is_followed_by_the_cpu() {
    for gone_before in [0, 1, 2, 3, 5] {
        let device = Arc::new(device());
        let mut bokeh =
            bokeh::create_blur(&settings(CocKind::Depth), SIZE, Some(Arc::clone(&device)), Some(1)).unwrap();
        blur(&mut *bokeh, |frame| {
            if frame == gone_before {
                device.device.destroy();
            }
        });
        assert_eq!(bokeh.backends(), "gpu, then cpu");
        assert!(bokeh.describe().contains("then cpu, 1 threads"), "{}", bokeh.describe());
    }
}

/// Creates and drops as many executors as an hour of trying apertures does.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn executors_come_and_go() {
    for _ in 0..40 {
        bokeh::create_blur(&settings(CocKind::Uniform), SIZE, Some(Arc::new(device())), Some(1)).unwrap();
    }
}

/// Also run under the layer, which then injects faults.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn frames_are_blurred_whatever_becomes_of_the_device() {
    let made = Device::open(false, None).map_err(BokehError::from).and_then(|device| {
        let device = Arc::new(device);
        run_self_test(&device)?;
        bokeh::create_blur(&settings(CocKind::Depth), SIZE, Some(impatient(device)), Some(1))
    });
    match made {
        Ok(mut bokeh) => {
            blur(&mut *bokeh, |_| {});
            println!("ran on {}: {}", bokeh.backends(), bokeh.describe());
        }
        Err(error) => println!("not made: {error}"),
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_gpu_that_is_lost_or_hangs_is_followed_by_the_cpu() {
    let layer = layer();
    for (fault, reason) in [
        ("submit:4", "device lost"),
        ("wait:2", "device lost"),
        ("wait:5", "device lost"),
        ("hang:3", "no answer for 1 s"),
    ] {
        let told = test_under(&layer, fault, "frames_are_blurred_whatever_becomes_of_the_device");
        // On a single core, the line starts with the test's name.
        let ran = told.lines().find_map(|line| line.find("ran on").map(|at| &line[at..]));
        let ran = ran.unwrap_or_else(|| panic!("{fault}: {told}"));
        assert!(ran.starts_with("ran on gpu, then cpu: ") && ran.to_lowercase().contains(reason), "{fault}: {ran}");
    }
    let told = test_under(&layer, "submit:1000000", "frames_are_blurred_whatever_becomes_of_the_device");
    assert!(told.contains("ran on gpu: "), "a layer that does nothing: {told}");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_gpu_that_blurs_wrongly_is_not_used() {
    let layer = layer();
    // All passes are skipped, or those from the fifth on.
    for fault in ["idle:1", "idle:5"] {
        let told = test_under(&layer, fault, "frames_are_blurred_whatever_becomes_of_the_device");
        assert!(told.contains("not made: GPU: ") && told.contains("pixel values are wrong"), "{told}");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn memory_that_ends_is_followed_by_the_cpu_or_said_at_the_start() {
    let layer = layer();
    for allocation in 1..=12 {
        let fault = format!("memory:{allocation}");
        let told = test_under(&layer, &fault, "frames_are_blurred_whatever_becomes_of_the_device");
        let outcome = ["ran on gpu: ", "ran on gpu, then cpu: ", "not made: GPU: "];
        assert!(outcome.iter().any(|outcome| told.contains(outcome)), "{fault}: {told}");
    }
}

/// Also run under the layer, which then injects faults.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn pairs_are_matched_whatever_becomes_of_the_device() {
    let (width, height) = SIZE;
    let eye = |shift: u32| {
        let picture = noise(width + 8, height);
        let luma = |x: u32, y: u32| picture.rgb[3 * (y * (width + 8) + x + shift) as usize];
        GrayImage { width, height, luma: (0..width * height).map(|k| luma(k % width, k / width)).collect() }
    };
    let (left, right) = (eye(0), eye(5));
    let settings = stereo::Settings { size: SIZE, disparities: 16, effort: Effort::Full, threads: 1 };
    let matched = |backend, rounds| {
        let mut matcher = stereo::create(&settings, backend, None).unwrap();
        let mut map = DisparityMap::default();
        for _ in 0..rounds {
            matcher.compute_disparity(Pair { left: &left, color: None, right: &right }, &mut map).expect("a match");
        }
        (map.px, matcher.describe())
    };
    let (on_cpu, _) = matched(Backend::Cpu, 4);
    let (found, ran) = matched(Backend::Gpu, 4);
    assert!(found == on_cpu, "to the bit");
    println!("ran on {ran}");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn matching_goes_on_after_the_gpu() {
    let layer = layer();
    for fault in ["submit:2", "wait:3"] {
        let told = test_under(&layer, fault, "pairs_are_matched_whatever_becomes_of_the_device");
        assert!(told.contains("ran on cpu"), "{fault}: {told}");
    }
}

/// Also run under the layer, which then injects faults.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn depth_is_refined_whatever_becomes_of_the_device() {
    let device = tried(|device| drop(Refiner::new().with_device(Some(device))));
    let mut refiner = Refiner::new().with_device(Some(&device));
    let mut cpu = Refiner::new();
    for frame in 0..8 {
        let (color, measured) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
        let [mut made, mut expected] = [measured.clone(), measured];
        refiner.refine(&mut made, &color, frame * 33_000_000);
        cpu.refine(&mut expected, &color, frame * 33_000_000);
        let is_off = |(a, b): &(&f32, &f32)| (*a - *b).abs() > 1e-3 * *b;
        let off = made.metres.iter().zip(&expected.metres).filter(is_off).count();
        assert!(made.size() == SIZE && off * 100 <= made.metres.len(), "frame {frame}: {off} are off");
    }
    println!("ran on {}", refiner.backends());
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn refining_goes_on_after_the_gpu() {
    let layer = layer();
    for (fault, ran) in [
        // During the self-test, and later.
        ("submit:2", "ran on cpu"),
        ("submit:6", "ran on gpu, then cpu"),
        ("wait:6", "ran on gpu, then cpu"),
        ("hang:6", "ran on gpu, then cpu"),
        // Skipped passes.
        ("idle:1", "ran on cpu"),
        ("idle:30", "ran on cpu"),
        ("submit:1000000", "ran on gpu"),
    ] {
        assert_ran(&layer, fault, "depth_is_refined_whatever_becomes_of_the_device", ran);
    }
}

/// Also run under the layer, which then injects faults.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn mattes_are_found_whatever_becomes_of_the_device() {
    let device = tried(|device| drop(Matting::default().with_device(Some(device))));
    let mut matting = Matting::default().with_device(Some(&device));
    let mut cpu = Matting::default();
    for frame in 0..8 {
        let (color, measured) = (noise(SIZE.0, SIZE.1), three_depths(SIZE.0, SIZE.1));
        let [mut made, mut expected] = [measured.clone(), measured];
        matting.find_mixed_pixels(&mut made, &color, 0.05);
        cpu.find_mixed_pixels(&mut expected, &color, 0.05);
        let (made, expected) = (made.matte.pixels, expected.matte.pixels);
        let is_same = |(a, b): &(&MixedPixel, &MixedPixel)| a.at == b.at && (a.alpha - b.alpha).abs() < 1e-3;
        let same = made.iter().zip(&expected).filter(is_same).count();
        assert!(same > 50 && same == made.len() && same == expected.len(), "frame {frame}: {same}");
    }
    println!("ran on {}", matting.backends());
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn matting_goes_on_after_the_gpu() {
    let layer = layer();
    for (fault, ran) in [
        // During the self-test, and later.
        ("submit:2", "ran on cpu"),
        ("submit:6", "ran on gpu, then cpu"),
        ("wait:7", "ran on gpu, then cpu"),
        ("hang:7", "ran on gpu, then cpu"),
        // Skipped passes.
        ("idle:1", "ran on cpu"),
        ("idle:40", "ran on cpu"),
        ("submit:1000000", "ran on gpu"),
    ] {
        assert_ran(&layer, fault, "mattes_are_found_whatever_becomes_of_the_device", ran);
    }
}
