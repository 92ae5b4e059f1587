//! Rectifies pairs on the device that matches them: on a GPU, or on the CPU, which takes over when the GPU fails.

use std::sync::Arc;

use super::gpu::rectifier::GpuRectifier;
use crate::calibration::rectifier::Rectifier;
use crate::compute::Device;
use crate::compute::with_fallback::WithFallback;
use crate::frame::{ColorImage, GrayImage};

/// Rectifies both pictures of a pair; CPU and GPU agree to the bit.
pub(super) struct PairRectifier {
    rectifier: Rectifier,
    gpu: WithFallback<Option<GpuRectifier>>,
}

impl PairRectifier {
    /// Creates a rectifier on the CPU.
    pub fn new(rectifier: Rectifier) -> Self {
        Self { rectifier, gpu: WithFallback::default() }
    }

    /// Moves the rectification to `device` if its results are exact; otherwise logs why it stays on the CPU.
    pub fn with_device(self, device: Option<Arc<Device>>) -> Self {
        let gpu = device.and_then(|device| match GpuRectifier::new(&device, self.rectifier.maps()) {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                tracing::warn!("{error}; the CPU rectifies from now on");
                None
            }
        });
        Self { gpu: WithFallback::new(gpu, ()), ..self }
    }

    /// Rectifies the left picture into `into`.
    pub fn rectify_left(&mut self, from: &ColorImage, into: &mut ColorImage) {
        if self.gpu.try_run("rectifies", |gpu| gpu.rectify_left(from, into)) {
            return;
        }
        self.rectifier.rectify_left(from, into);
    }

    /// Rectifies the right picture into `into`.
    pub fn rectify_right(&mut self, from: &GrayImage, into: &mut GrayImage) {
        if self.gpu.try_run("rectifies", |gpu| gpu.rectify_right(from, into)) {
            return;
        }
        self.rectifier.rectify_right(from, into);
    }
}
