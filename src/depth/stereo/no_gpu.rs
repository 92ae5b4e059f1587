//! Matching on the GPU in a build without GPU support.

use std::sync::Arc;

use super::cpu::CpuExecutor;
use crate::compute::GpuError;
use crate::compute::device::{Device, absent};

absent! { GpuExecutor {
    fn new(_: &Arc<Device>, _: (usize, usize), _: usize, _: u32) -> Result<CpuExecutor, GpuError>;
} }

pub mod rectifier {
    use super::{Arc, Device, GpuError, absent};
    use crate::calibration::map::RemapTable;
    use crate::frame::{ColorImage, GrayImage};

    absent! { GpuRectifier {
        fn new(_: &Arc<Device>, _: &[RemapTable; 2]) -> Result<Self, GpuError>;
        fn rectify_left(&mut self, _: &ColorImage, _: &mut ColorImage) -> Result<(), GpuError>;
        fn rectify_right(&mut self, _: &GrayImage, _: &mut GrayImage) -> Result<(), GpuError>;
    } }
}
