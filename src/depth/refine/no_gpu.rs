//! Refinement on the GPU in a build without GPU support.

use std::sync::Arc;

use crate::compute::GpuError;
use crate::compute::device::{Device, DeviceFrame, SelfTest, absent};
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;

absent! { GpuRefiner {
    fn new(_: &Arc<Device>) -> Self;
    fn reset(&mut self) -> ();
    fn device_frame(&self) -> Option<DeviceFrame>;
    fn take_copy(&mut self) -> Option<Pooled<DeviceFrame>>;
    fn refine(&mut self, _: &mut DepthMap, _: &ColorImage, _: u64, _: f32) -> Result<(), GpuError>;
} fn run_self_test(_: &Arc<Device>) -> Result<SelfTest, GpuError>; }
