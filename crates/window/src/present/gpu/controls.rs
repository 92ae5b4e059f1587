//! The controls, drawn by egui's own renderer.

use egui::TextureId;
use egui::epaint::ClippedPrimitive;
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};

use crate::present::Controls;
use bokehcam::compute::device::Device;

/// The overlay with the controls.
pub struct Overlay {
    renderer: Renderer,
    primitives: Vec<ClippedPrimitive>,
    pixels_per_point: f32,
    /// Textures to free when the controls are replaced.
    freed: Vec<TextureId>,
    /// Whether the controls must be uploaded.
    outdated: bool,
    /// Size of the target at the last upload, in pixels.
    size: (u32, u32),
}

impl Overlay {
    /// Creates an overlay for textures of `format`.
    pub fn new(device: &Device, format: wgpu::TextureFormat) -> Self {
        // Without dithering, so that a still picture stays identical.
        let options = RendererOptions { dithering: false, ..RendererOptions::default() };
        Self {
            renderer: Renderer::new(&device.device, format, options),
            primitives: Vec::new(),
            pixels_per_point: 1.0,
            freed: Vec::new(),
            outdated: true,
            size: (0, 0),
        }
    }

    /// Replaces the controls.
    pub fn set_controls(&mut self, device: &Device, controls: Controls) {
        let Controls { primitives, mut textures, pixels_per_point } = controls;
        // Only the replaced controls still used these.
        self.freed.drain(..).for_each(|id| self.renderer.free_texture(&id));
        for (&id, changes) in &textures.set {
            for change in changes {
                self.renderer.update_texture(&device.device, &device.queue, id, change);
            }
        }
        self.freed.extend(&textures.free);
        textures.clear();
        (self.primitives, self.pixels_per_point, self.outdated) = (primitives, pixels_per_point, true);
    }

    /// Uploads the controls if they or the size changed. Returns the commands to submit before those of `encoder`.
    pub fn upload(
        &mut self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        size: (u32, u32),
    ) -> Vec<wgpu::CommandBuffer> {
        if !std::mem::take(&mut self.outdated) && self.size == size {
            return Vec::new();
        }
        self.size = size;
        let screen = self.screen_descriptor();
        self.renderer.update_buffers(&device.device, &device.queue, encoder, &self.primitives, &screen)
    }

    pub fn draw(&self, pass: &mut wgpu::RenderPass<'static>) {
        self.renderer.render(pass, &self.primitives, &self.screen_descriptor());
    }

    fn screen_descriptor(&self) -> ScreenDescriptor {
        ScreenDescriptor { size_in_pixels: self.size.into(), pixels_per_point: self.pixels_per_point }
    }
}
