//! A picture, wherever it is.

use crate::compute::DevicePicture;
use crate::frame::{ColorImage, YuyvImage};
use crate::link::pool::Pooled;

/// A picture in memory, on the device that made it, or in both; or as YUYV in memory, and nowhere else.
pub struct Picture {
    /// Has the picture's size; its pixels only where `in_memory`.
    image: Pooled<ColorImage>,
    in_memory: bool,
    device: Option<Pooled<DevicePicture>>,
    yuyv: Option<Pooled<YuyvImage>>,
}

impl Picture {
    /// A picture in memory.
    pub fn in_memory(image: Pooled<ColorImage>) -> Self {
        Self { image, in_memory: true, device: None, yuyv: None }
    }

    /// A picture on the device, and in memory where `in_memory`; `image` has its size in any case.
    pub fn on_device(device: Pooled<DevicePicture>, image: Pooled<ColorImage>, in_memory: bool) -> Self {
        Self { image, in_memory, device: Some(device), yuyv: None }
    }

    /// A picture as YUYV; `image` has its size.
    pub fn as_yuyv(yuyv: Pooled<YuyvImage>, image: Pooled<ColorImage>) -> Self {
        Self { image, in_memory: false, device: None, yuyv: Some(yuyv) }
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        self.image.size()
    }

    /// The picture, where it is in memory.
    pub fn memory(&self) -> Option<&ColorImage> {
        self.in_memory.then_some(&*self.image)
    }

    /// The picture to be changed, where it is in memory; a copy on a device does not change with it.
    pub fn memory_mut(&mut self) -> Option<&mut ColorImage> {
        self.in_memory.then_some(&mut *self.image)
    }

    /// The picture on the device, where it is there.
    pub fn device(&self) -> Option<&DevicePicture> {
        self.device.as_deref()
    }

    /// The picture as YUYV, where it is that.
    pub fn yuyv_mut(&mut self) -> Option<&mut YuyvImage> {
        self.yuyv.as_deref_mut()
    }

    /// The picture's memory, where it is in memory.
    pub fn into_memory(self) -> Option<Pooled<ColorImage>> {
        self.in_memory.then_some(self.image)
    }
}
