//! The executor on the GPU in a build without GPU support.

use std::sync::Arc;

use super::BokehError;
use super::cpu::BandedBokeh;
use super::plan::Plan;
use crate::compute::device::{Device, absent};

absent! { GpuBokeh {
    fn with_device(_: &Plan, _: Arc<Device>) -> Result<BandedBokeh, BokehError>;
} fn run_self_test(_: &Arc<Device>) -> Result<(), BokehError>; }
