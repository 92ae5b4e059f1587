//! Rectification on a device. Its results equal those of the twin [`RemapTable`] to the bit.

use std::sync::Arc;

use super::shaders::{self, linear_workgroups};
use crate::calibration::map::RemapTable;
use crate::compute::GpuError;
use crate::compute::device::{Device, Pass, Readback, Recorder};
use crate::frame::{ColorImage, GrayImage};

/// Rectifies pictures of one size on a GPU.
pub struct GpuRectifier {
    device: Arc<Device>,
    size: (u32, u32),
    /// Left in colour, right in grey.
    cameras: [CameraRectifier; 2],
}

/// Resources for the pictures of one camera.
struct CameraRectifier {
    raw: wgpu::Buffer,
    pass: Pass,
    rectified: wgpu::Buffer,
    readback: Readback,
}

impl CameraRectifier {
    fn new(device: &Device, map: &RemapTable, channels: usize) -> Self {
        use wgpu::BufferUsages as Usage;
        let (width, height) = map.size();
        let (stride, bytes) = (channels * width as usize, channels * width as usize * height as usize);
        let [starts, fractions] = map.packed_words().map(|words| {
            let buffer = device.create_buffer("sources", 4 * words.len(), Usage::STORAGE | Usage::COPY_DST);
            device.upload(&buffer, 0, bytemuck::cast_slice(words));
            buffer
        });
        let raw = device.create_buffer("raw", bytes, Usage::STORAGE | Usage::COPY_DST);
        let rectified = device.create_buffer("rectified", bytes, Usage::STORAGE | Usage::COPY_SRC);
        let constants = shaders::rectify_constants(bytes, stride, channels);
        let buffers = [&starts, &fractions, &raw, &rectified].map(wgpu::Buffer::as_entire_buffer_binding);
        let pass = Pass::new(device, shaders::RECTIFY, &constants, buffers, linear_workgroups(bytes.div_ceil(4)));
        Self { raw, pass, readback: Readback::new(device, "rectified back", bytes), rectified }
    }

    fn rectify(&mut self, device: &Device, from: &[u8], into: &mut [u8]) -> Result<(), GpuError> {
        device.check()?;
        device.upload(&self.raw, 0, from);
        let mut recorder = Recorder::new(device, None);
        recorder.record(&self.pass);
        let (rectified, length) = (&self.rectified, into.len());
        recorder.submit_and_read(device, &mut self.readback, rectified, rectified.size(), |bytes| {
            into.copy_from_slice(&bytes[..length]);
        })
    }
}

impl GpuRectifier {
    /// Uploads the maps of the left and the right camera.
    ///
    /// # Errors
    /// Fails if the device lacks memory, fails, or its result differs from the CPU's.
    pub fn new(device: &Arc<Device>, maps: &[RemapTable; 2]) -> Result<Self, GpuError> {
        let cameras = device.with_error_scope(|| {
            [CameraRectifier::new(device, &maps[0], 3), CameraRectifier::new(device, &maps[1], 1)]
        })?;
        let mut made = Self { device: Arc::clone(device), size: maps[0].size(), cameras };
        made.self_test(&maps[1])?;
        device.check()?;
        Ok(made)
    }

    /// Rectifies a test picture and compares it with the CPU's result, to detect driver faults before the first frame.
    fn self_test(&mut self, map: &RemapTable) -> Result<(), GpuError> {
        let (width, height) = map.size();
        let luma = (0..width * height).map(|k| (k.wrapping_mul(0x9e37_79b1) >> 24) as u8).collect();
        let from = GrayImage { width, height, luma };
        let (mut expected, mut found) = (GrayImage::default(), GrayImage::default());
        map.remap_gray(&from, &mut expected);
        self.rectify_right(&from, &mut found)?;
        let name = &self.device.name;
        if found.luma == expected.luma {
            Ok(())
        } else {
            Err(GpuError::Failed(format!(
                "{name}: self-test failed: a picture is rectified wrongly; its driver may be faulty"
            )))
        }
    }

    /// Rectifies the left picture into `into`.
    ///
    /// # Errors
    /// Fails if the device fails.
    ///
    /// # Panics
    /// Panics if `from` does not have the size of the maps.
    pub fn rectify_left(&mut self, from: &ColorImage, into: &mut ColorImage) -> Result<(), GpuError> {
        assert_eq!(from.size(), self.size, "pictures are resampled at one size");
        into.resize(from.width, from.height);
        self.cameras[0].rectify(&self.device, &from.rgb, &mut into.rgb)
    }

    /// Rectifies the right picture into `into`.
    ///
    /// # Errors
    /// Fails if the device fails.
    ///
    /// # Panics
    /// Panics if `from` does not have the size of the maps.
    pub fn rectify_right(&mut self, from: &GrayImage, into: &mut GrayImage) -> Result<(), GpuError> {
        assert_eq!(from.size(), self.size, "pictures are resampled at one size");
        into.resize(from.width, from.height);
        self.cameras[1].rectify(&self.device, &from.luma, &mut into.luma)
    }
}
