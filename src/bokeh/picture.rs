//! A picture in memory, on a device, or both.

use crate::compute::DevicePicture;
use crate::frame::{ColorImage, YuyvImage};
use crate::link::pool::Pooled;

/// A picture in memory, on the device that made it, or in both; or only as YUYV in memory.
pub struct Picture {
    /// Always has the picture's size; its pixels are valid only if `in_memory`.
    image: Pooled<ColorImage>,
    in_memory: bool,
    device: Option<Pooled<DevicePicture>>,
    yuyv: Option<Pooled<YuyvImage>>,
}

impl Picture {
    /// Wraps a picture in memory.
    pub fn from_memory(image: Pooled<ColorImage>) -> Self {
        Self { image, in_memory: true, device: None, yuyv: None }
    }

    /// Wraps a picture on the device, also in memory if `in_memory`; `image` has its size in any case.
    pub fn from_device(device: Pooled<DevicePicture>, image: Pooled<ColorImage>, in_memory: bool) -> Self {
        Self { image, in_memory, device: Some(device), yuyv: None }
    }

    /// Wraps a YUYV picture; `image` has its size.
    pub fn from_yuyv(yuyv: Pooled<YuyvImage>, image: Pooled<ColorImage>) -> Self {
        Self { image, in_memory: false, device: None, yuyv: Some(yuyv) }
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        self.image.size()
    }

    /// Returns the picture if it is in memory.
    pub fn memory(&self) -> Option<&ColorImage> {
        self.in_memory.then_some(&*self.image)
    }

    /// Returns the picture for writing if it is in memory; a copy on a device does not change with it.
    pub fn memory_mut(&mut self) -> Option<&mut ColorImage> {
        self.in_memory.then_some(&mut *self.image)
    }

    /// Returns the picture on the device, if it is there.
    pub fn device(&self) -> Option<&DevicePicture> {
        self.device.as_deref()
    }

    /// Returns the YUYV picture, if it is one.
    pub fn yuyv_mut(&mut self) -> Option<&mut YuyvImage> {
        self.yuyv.as_deref_mut()
    }
}
