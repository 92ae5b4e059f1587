//! The GPU rectifies pairs like the CPU, to the bit.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;
use crate::on_gpu::device;

use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};
use bokehcam::compute::Backend;
use bokehcam::depth::stereo::gpu::rectifier::GpuRectifier;
use bokehcam::depth::stereo::source::StereoDepth;
use bokehcam::depth::stereo::{self, Effort, Settings};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use common::Numbers;
use glam::{DMat3, DVec2, DVec3};

/// Creates misaligned cameras with lens distortion, whose rectified window exceeds the field of view, so that its
/// corners have no source.
fn rectifier(size: (u32, u32)) -> Rectifier {
    let [width, height] = [size.0, size.1].map(f64::from);
    let eye = |shift: f64| CameraIntrinsics {
        size: Some(size),
        focal_px: DVec2::splat(0.9 * width.max(height)),
        center_px: DVec2::new((0.5 + shift) * width, 0.47 * height),
        distortion: Distortion::RadialTangential([-0.2, 0.05, 1e-3, -2e-3, 0.0, 0.0, 0.0, 0.0]),
    };
    let mut calibration = StereoCalibration {
        cameras: [eye(0.007), eye(-0.013)],
        rotation: DMat3::from_rotation_z(0.06) * DMat3::from_rotation_y(0.02),
        translation_m: DVec3::new(-0.1, 0.002, 0.001),
        stored_rectification: None,
        unit: LengthUnit::Stated,
    };
    let found = Rectification::from_calibration(&calibration, size).expect("such eyes can be");
    calibration.stored_rectification = Some(Rectification { focal_px: 0.7 * found.focal_px, ..found });
    Rectifier::new(&calibration, size).expect("such eyes can be")
}

fn pictures((width, height): (u32, u32), seed: u32) -> (ColorImage, GrayImage) {
    let mut numbers = Numbers(seed.into());
    let mut bytes = |count: u32| (0..count).map(|_| (256.0 * numbers.next()) as u8).collect();
    let color = ColorImage { width, height, rgb: bytes(3 * width * height) };
    (color, GrayImage { width, height, luma: bytes(width * height) })
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn both_eyes_are_the_same_to_the_bit() {
    let device = device();
    for size in [(2, 2), (3, 2), (5, 3), (64, 48), (65, 47), (161, 119), (640, 360)] {
        let cpu = rectifier(size);
        let mut gpu = GpuRectifier::new(&device, cpu.maps()).expect("the device is sound");
        for frame in 0..3 {
            let (color, gray) = pictures(size, 7 + frame);
            let (mut left, mut right) = (ColorImage::default(), GrayImage::default());
            cpu.rectify_left(&color, &mut left);
            cpu.rectify_right(&gray, &mut right);
            let (mut made_left, mut made_right) = (ColorImage::default(), GrayImage::default());
            gpu.rectify_left(&color, &mut made_left).expect("the device is sound");
            gpu.rectify_right(&gray, &mut made_right).expect("the device is sound");
            assert!(made_left == left && made_right == right, "{size:?}, frame {frame}");
        }
    }
    // Pixels without a source were among them.
    let askew = rectifier((64, 48));
    let sees_nothing = |k: u32| askew.maps().iter().any(|map| map.source_px(k % 64, k / 64).is_none());
    assert!((0..64 * 48).any(sees_nothing));
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_source_goes_on_when_the_device_is_gone() {
    let size = (96, 64);
    let matcher = |backend| {
        let settings = Settings { disparities: 16, effort: Effort::Full, size, threads: 1 };
        stereo::create(&settings, backend, None).expect("there is an adapter")
    };
    let on_gpu = matcher(Backend::Gpu);
    let device = on_gpu.device().expect("it runs on a device");
    let source = |matcher| StereoDepth::from_raw("two eyes", rectifier(size), matcher, 16);
    let mut sources = [source(matcher(Backend::Cpu)), source(on_gpu)];
    for frame in 0..4 {
        if frame == 2 {
            device.device.destroy();
        }
        let (color, right) = pictures(size, 40 + frame);
        let stamp = Stamp { index: frame as usize, time_ns: u64::from(frame) * 33_000_000, captured_ns: None };
        let found = sources.each_mut().map(|source| {
            let (mut color, mut map) = (color.clone(), DepthMap::default());
            source.rectify(&mut color);
            let seen = FrameInput { stamp, color: &color, right: Some(&right) };
            source.read(seen, &mut map).expect("a fault costs no frame");
            (color, map)
        });
        let [cpu, gpu] = found;
        // After the fault there is no prior, as the last map was on the device.
        assert_eq!(cpu.0, gpu.0, "frame {frame}");
        assert!(frame >= 2 || cpu.1 == gpu.1, "frame {frame}");
    }
}
