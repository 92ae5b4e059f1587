//! Helpers for tests on a GPU: a device, pseudorandom numbers, and pass times.
#![allow(dead_code, missing_docs)]

use std::sync::Arc;
use std::time::Duration;

use bokehcam::compute::{Device, PassTimes};

pub fn device() -> Arc<Device> {
    Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"))
}

/// Returns a pseudorandom number, 0 to 1, that depends on `k` and the frame alone.
pub fn chance(k: usize, frame: usize) -> f32 {
    let mixed = (k as u32 ^ (frame as u32).rotate_left(18)).wrapping_mul(0x9e37_79b1);
    ((mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / (1 << 24) as f32
}

/// Returns the size of pictures whose passes are timed: `BOKEHCAM_SIZE=1280x720`, or a small one.
pub fn size_of_timed() -> (u32, u32) {
    let wanted = std::env::var("BOKEHCAM_SIZE").unwrap_or_else(|_| "160x120".to_owned());
    let (width, height) = wanted.split_once('x').expect("BOKEHCAM_SIZE: COLUMNSxROWS");
    let [width, height] = [width, height].map(|side| side.parse().expect("BOKEHCAM_SIZE: COLUMNSxROWS"));
    (width, height)
}

/// Prints the pass times of a frame, and checks that they sum up to no more than its total time.
pub fn tell_of_passes(device: &Device, whole: Duration, passes: &PassTimes) {
    eprintln!("{}: {whole:?} {:?}", device.name, passes.iter().collect::<Vec<_>>());
    assert!(passes.iter().map(|(_, time)| time).sum::<Duration>() <= whole);
    assert_eq!(passes.iter().count() > 0, device.timestamps);
}
