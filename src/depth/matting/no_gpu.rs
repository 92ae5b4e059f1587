//! Matting on the GPU in a build without GPU support.

use std::sync::Arc;

use super::KnownBackground;
use crate::compute::GpuError;
use crate::compute::device::{Device, DeviceFrame, SelfTest, absent};
use crate::frame::{ColorImage, DepthMap};

absent! { GpuMatting {
    fn new(_: &Arc<Device>) -> Self;
    fn find_mixed_pixels(&mut self, _: (&mut DepthMap, &ColorImage), _: Option<DeviceFrame>, _: f32, _: Option<&KnownBackground>) -> Result<usize, GpuError>;
} fn run_self_test(_: &Arc<Device>) -> Result<SelfTest, GpuError>; }
