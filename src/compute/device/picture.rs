//! Pictures and depth maps in a device's memory.

use super::Device;

/// An 8-bit sRGB picture in a device's memory: the bytes of a [`crate::frame::ColorImage`].
#[derive(Debug)]
pub struct DevicePicture {
    device: wgpu::Device,
    size: (u32, u32),
    buffer: wgpu::Buffer,
}

impl DevicePicture {
    /// Allocates a picture of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32)) -> Self {
        use wgpu::BufferUsages as Usage;
        // Whole groups of four pixels: bytes after the last pixel are unspecified.
        let quads = (size.0 as usize * size.1 as usize).div_ceil(4);
        let buffer = device.create_buffer("picture", quads * 12, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST);
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

/// A picture and its depth map of the same size, in a device's memory.
#[derive(Clone, Debug)]
pub struct DeviceFrame {
    device: wgpu::Device,
    size: (u32, u32),
    /// Depth of each pixel, in metres.
    pub metres: wgpu::Buffer,
    /// 8-bit sRGB, 3 bytes a pixel.
    pub rgb: wgpu::Buffer,
}

impl DeviceFrame {
    /// Allocates a frame of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32)) -> Self {
        use wgpu::BufferUsages as Usage;
        let pixels = size.0 as usize * size.1 as usize;
        let buffer = |label, bytes| device.create_buffer(label, bytes, Usage::COPY_SRC | Usage::COPY_DST);
        Self::from_buffers(device, size, &buffer("metres", 4 * pixels), &buffer("rgb", 3 * pixels))
    }

    /// Wraps buffers of `device` with usage `COPY_SRC`; their content is valid until they are overwritten.
    pub fn from_buffers(device: &Device, size: (u32, u32), metres: &wgpu::Buffer, rgb: &wgpu::Buffer) -> Self {
        Self { device: device.device.clone(), size, metres: metres.clone(), rgb: rgb.clone() }
    }

    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Whether the frame is in the memory of `device`.
    pub fn is_on(&self, device: &Device) -> bool {
        self.device == device.device
    }
}
