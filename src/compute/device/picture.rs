//! Pictures and their depth in a device's memory.

use super::Device;

/// An 8-bit sRGB picture in a device's memory: the bytes of a [`crate::frame::ColorImage`].
#[derive(Debug)]
pub struct DevicePicture {
    device: wgpu::Device,
    size: (u32, u32),
    buffer: wgpu::Buffer,
}

impl DevicePicture {
    /// Memory for a picture of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32)) -> Self {
        use wgpu::BufferUsages as Usage;
        // Whole quads of pixels: what follows the last pixel is unspecified.
        let quads = (size.0 as usize * size.1 as usize).div_ceil(4);
        let buffer = device.buffer("picture", quads * 12, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST);
        Self { device: device.device.clone(), size, buffer }
    }

    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Whether the picture is in the memory of `device`.
    pub fn is_on(&self, device: &Device) -> bool {
        self.device == device.device
    }
}

/// A depth map as large as its picture, and that picture, in a device's memory, until the next ones take their place.
#[derive(Clone, Debug)]
pub struct DeviceFrame {
    device: wgpu::Device,
    /// Depth of each pixel, in metres.
    pub metres: wgpu::Buffer,
    /// 8-bit sRGB, 3 bytes a pixel.
    pub rgb: wgpu::Buffer,
}

impl DeviceFrame {
    /// Buffers of `device`, which can be copied from.
    pub fn new(device: &Device, metres: &wgpu::Buffer, rgb: &wgpu::Buffer) -> Self {
        Self { device: device.device.clone(), metres: metres.clone(), rgb: rgb.clone() }
    }

    /// Whether it is in the memory of `device`.
    pub fn is_on(&self, device: &Device) -> bool {
        self.device == device.device
    }
}
