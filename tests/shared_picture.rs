//! What refinement has on a device, the blur takes from there.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

mod common;

use std::sync::Arc;

use bokehcam::bokeh::gpu::GpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Bokeh, Job};
use bokehcam::compute::{Device, DevicePicture};
use bokehcam::depth::refine::Refiner;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use common::{coc, color, noise, settings, three_depths};

fn blurred(
    gpu: &mut GpuBokeh,
    color: &ColorImage,
    map: &DepthMap,
    on_device: Option<Pooled<DevicePicture>>,
) -> ColorImage {
    let (given, map) = (Pooled::detached(color.clone()), Pooled::detached(map.clone()));
    let job = Job::new(given, Some(map), coc(CocKind::Depth, color.height));
    gpu.submit(Job { on_device, ..job }).expect("room for a frame");
    let finished = gpu.collect(true).expect("the GPU blurs").expect("a frame comes back");
    finished.picture.memory().expect("in memory").clone()
}

/// A picture that is on the executor's device is taken from there, and one of another size or device is not: told by another
/// picture there.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_picture_on_the_device_need_not_go_up() {
    let (width, height) = (97, 71);
    let plan = Plan::new(&settings(CocKind::Depth), width, height);
    let device = || Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"));
    let (own, other) = (device(), device());
    let mut gpu = GpuBokeh::on(&plan, Arc::clone(&own)).expect("room for the picture");
    let (map, there) = (three_depths(width, height), noise(width, height));
    let given = color(width, height, |x, y| [x as u8, 200, y as u8]);
    let mut made = |color: &ColorImage, on_device: Option<(&Device, (u32, u32))>| {
        let on_device = on_device.map(|(device, size)| {
            let picture = DevicePicture::new(device, size);
            device.upload(picture.buffer(), 0, &there.rgb[..3 * (size.0 * size.1) as usize]);
            Pooled::detached(picture)
        });
        blurred(&mut gpu, color, &map, on_device)
    };
    let [of_given, of_there] = [made(&given, None), made(&there, None)];
    assert!(of_given != of_there);
    assert!(made(&given, Some((&own, (width, height)))) == of_there);
    assert!(made(&given, Some((&own, (width, height - 1)))) == of_given, "it has another size");
    assert!(made(&given, Some((&other, (width, height)))) == of_given, "it is on another device");
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_refined_frame_gives_its_own_picture_once() {
    let device = Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"));
    let (width, height) = (97, 71);
    let plan = Plan::new(&settings(CocKind::Depth), width, height);
    let mut gpu = GpuBokeh::on(&plan, Arc::clone(&device)).expect("room for the picture");
    let mut refiner = Refiner::new().on(Some(&device));
    assert!(refiner.take_picture().is_none());
    // More pictures than there are copies, all of which come home.
    for frame in 0..9 {
        let color = color(width, height, |x, y| [(x * 3 + frame * 20) as u8, (y * 2) as u8, frame as u8]);
        let mut map = three_depths(width, height);
        refiner.refine(&mut map, &color, u64::from(frame) * 33_000_000);
        let picture = refiner.take_picture();
        assert!(picture.is_some() && refiner.take_picture().is_none(), "frame {frame}");
        let expected = blurred(&mut gpu, &color, &map, None);
        assert!(blurred(&mut gpu, &color, &map, picture) == expected, "frame {frame}");
    }
    assert_eq!(refiner.backends(), "gpu");
}
