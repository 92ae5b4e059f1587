//! The blur reads a refined frame from the copy on the device.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use crate::common;
use crate::on_gpu::device;

use std::sync::Arc;

use bokehcam::bokeh::gpu::GpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Bokeh, Job};
use bokehcam::compute::{Device, DeviceFrame};
use bokehcam::depth::refine::Refiner;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use common::{coc, codes_apart, color, noise, settings, three_depths};

/// CoC computed on the device from metres may round differently: GPU divisions are accurate to a few ULPs only.
const CODES: u8 = 1;

fn blurred(
    gpu: &mut GpuBokeh,
    color: &ColorImage,
    map: &DepthMap,
    on_device: Option<Pooled<DeviceFrame>>,
) -> ColorImage {
    let (given, map) = (Pooled::detached(color.clone()), Pooled::detached(map.clone()));
    let job = Job::new(given, Some(map), coc(CocKind::Depth, color.height));
    gpu.submit(Job { on_device, ..job }).expect("room for a frame");
    let finished = gpu.collect(true).expect("the GPU blurs").expect("a frame comes back");
    finished.picture.memory().expect("in memory").clone()
}

/// The executor uses a frame on its own device, but not one of another size or device: the test puts another picture
/// and other depths there to tell them apart.
#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_frame_on_the_device_need_not_go_up() {
    let (width, height) = (97, 71);
    let plan = Plan::new(&settings(CocKind::Depth), width, height);
    let (own, other) = (device(), device());
    let mut gpu = GpuBokeh::with_device(&plan, Arc::clone(&own)).expect("room for the picture");
    let given = (color(width, height, |x, y| [x as u8, 200, y as u8]), three_depths(width, height));
    let mut there = (noise(width, height), three_depths(width, height));
    there.1.metres.reverse();
    // Depths that are not positive finite numbers count as infinitely far on the device, too.
    there.1.metres[5 * width as usize..][..4].copy_from_slice(&[0.0, -1.0, f32::NAN, f32::INFINITY]);
    let mut made = |(color, map): &(ColorImage, DepthMap), on_device: Option<(&Device, (u32, u32))>| {
        let on_device = on_device.map(|(device, size)| {
            let (frame, pixels) = (DeviceFrame::new(device, size), (size.0 * size.1) as usize);
            device.upload(&frame.rgb, 0, &there.0.rgb[..3 * pixels]);
            device.upload(&frame.metres, 0, bytemuck::cast_slice(&there.1.metres[..pixels]));
            Pooled::detached(frame)
        });
        blurred(&mut gpu, color, map, on_device)
    };
    let [of_given, of_there] = [made(&given, None), made(&there, None)];
    assert!(codes_apart(&of_given, &of_there) > 50);
    let apart = codes_apart(&made(&given, Some((&own, (width, height)))), &of_there);
    assert!(apart <= CODES, "{apart}");
    assert!(made(&given, Some((&own, (width, height - 1)))) == of_given, "it has another size");
    assert!(made(&given, Some((&other, (width, height)))) == of_given, "it is on another device");
    // A map of another size is not the one there.
    let mut small = given.1.clone();
    small.resize(width / 2, height / 2);
    small.metres.fill(2.0);
    let expected = made(&(there.0.clone(), small.clone()), None);
    assert!(made(&(given.0, small), Some((&own, (width, height)))) == expected);
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_refined_frame_is_given_once() {
    let device = device();
    let (width, height) = (97, 71);
    let plan = Plan::new(&settings(CocKind::Depth), width, height);
    let mut gpu = GpuBokeh::with_device(&plan, Arc::clone(&device)).expect("room for the picture");
    let mut refiner = Refiner::new().with_device(Some(&device));
    assert!(refiner.take_copy().is_none());
    // More frames than there are copies: every copy returns to the pool.
    for frame in 0..9 {
        let color = color(width, height, |x, y| [(x * 3 + frame * 20) as u8, (y * 2) as u8, frame as u8]);
        let mut map = three_depths(width, height);
        refiner.refine(&mut map, &color, u64::from(frame) * 33_000_000);
        let copy = refiner.take_copy();
        assert!(copy.is_some() && refiner.take_copy().is_none(), "frame {frame}");
        let expected = blurred(&mut gpu, &color, &map, None);
        let apart = codes_apart(&blurred(&mut gpu, &color, &map, copy), &expected);
        assert!(apart <= CODES, "frame {frame}: {apart}");
    }
    assert_eq!(refiner.backends(), "gpu");
}
