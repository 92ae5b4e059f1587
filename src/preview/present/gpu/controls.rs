//! The controls, by egui's own renderer.

use egui::TextureId;
use egui::epaint::ClippedPrimitive;
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};

use crate::compute::device::Device;
use crate::preview::present::Controls;

/// The controls over a window.
pub struct Overlay {
    renderer: Renderer,
    primitives: Vec<ClippedPrimitive>,
    pixels_per_point: f32,
    /// Textures that only these controls still need.
    freed: Vec<TextureId>,
    /// Whether the device has other controls, or for another size.
    outdated: bool,
    size: (u32, u32),
}

impl Overlay {
    /// For textures of `format`.
    pub fn new(device: &Device, format: wgpu::TextureFormat) -> Self {
        // Without noise, so that a picture that stays stays the same.
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

    /// Other controls from now on.
    pub fn set(&mut self, device: &Device, controls: Controls) {
        let Controls { primitives, mut textures, pixels_per_point } = controls;
        // The controls so far were the last to need these.
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

    /// Brings what changed to the device; gives back what is to be submitted before.
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
        let screen = self.screen();
        self.renderer.update_buffers(&device.device, &device.queue, encoder, &self.primitives, &screen)
    }

    pub fn draw(&self, pass: &mut wgpu::RenderPass<'static>) {
        self.renderer.render(pass, &self.primitives, &self.screen());
    }

    fn screen(&self) -> ScreenDescriptor {
        ScreenDescriptor { size_in_pixels: self.size.into(), pixels_per_point: self.pixels_per_point }
    }
}
