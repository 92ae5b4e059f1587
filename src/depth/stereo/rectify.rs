//! Pairs are rectified where they are matched: on a GPU, or on the processor, which takes over when that fails.

#[cfg(feature = "gpu")]
use std::sync::Arc;

#[cfg(feature = "gpu")]
use super::gpu::rectifier::GpuRectifier;
use crate::calibration::rectifier::Rectifier;
#[cfg(feature = "gpu")]
use crate::compute::Device;
#[cfg(feature = "gpu")]
use crate::compute::backed::Backed;
use crate::frame::{ColorImage, GrayImage};

/// Rectifies the pictures of both eyes; the same to the bit wherever it does.
pub(super) struct PairRectifier {
    rectifier: Rectifier,
    #[cfg(feature = "gpu")]
    gpu: Backed<Option<GpuRectifier>>,
}

impl PairRectifier {
    /// On the processor.
    pub fn new(rectifier: Rectifier) -> Self {
        Self {
            rectifier,
            #[cfg(feature = "gpu")]
            gpu: Backed::default(),
        }
    }

    /// On a device, where there is one that does it right: what keeps it from that is said.
    #[cfg(feature = "gpu")]
    pub fn on(self, device: Option<Arc<Device>>) -> Self {
        let gpu = device.and_then(|device| match GpuRectifier::new(&device, self.rectifier.maps()) {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                tracing::warn!("{error}; the CPU rectifies");
                None
            }
        });
        Self { gpu: Backed::new(gpu, ()), ..self }
    }

    /// The left picture, rectified, into `into`.
    pub fn left(&mut self, from: &ColorImage, into: &mut ColorImage) {
        #[cfg(feature = "gpu")]
        if self.gpu.did("rectifies", |gpu| gpu.left(from, into)) {
            return;
        }
        self.rectifier.left(from, into);
    }

    /// The right picture, rectified, into `into`.
    pub fn right(&mut self, from: &GrayImage, into: &mut GrayImage) {
        #[cfg(feature = "gpu")]
        if self.gpu.did("rectifies", |gpu| gpu.right(from, into)) {
            return;
        }
        self.rectifier.right(from, into);
    }
}
