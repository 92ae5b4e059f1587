//! Presents with the GPU, on the device that blurs.

mod canvas;
mod controls;

use std::sync::Arc;

pub use canvas::{Canvas, PRESENT, WindowUniform};
use winit::window::Window;

use super::{Controls, Drawing, PresentError, Presenter};
use bokehcam::compute::device::{Device, DevicePicture};

/// The GPU presenter.
pub struct GpuPresenter {
    device: Arc<Device>,
    window: Arc<Window>,
    /// `None` only during `drop`.
    surface: Option<wgpu::Surface<'static>>,
    config: wgpu::SurfaceConfiguration,
    /// Whether the surface is configured; false while the window has zero size.
    configured: bool,
    canvas: Canvas,
}

impl GpuPresenter {
    /// Creates a presenter for a window.
    ///
    /// # Errors
    /// Fails if the device cannot draw to it.
    pub fn new(window: Arc<Window>, device: Arc<Device>) -> Result<Self, PresentError> {
        let surface = create_surface(&window, &device)?;
        let capabilities = surface.get_capabilities(&device.adapter);
        // Pictures and controls are already sRGB-encoded: prefer a format that does not encode them again.
        let plain = |format: &wgpu::TextureFormat| {
            matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Rgba8Unorm)
        };
        let format = capabilities.formats.iter().copied().find(plain).or_else(|| capabilities.formats.first().copied());
        let Some(format) = format else {
            return Err(PresentError(format!("{} has no pixel format for it", device.name)));
        };
        let has_mailbox = capabilities.present_modes.contains(&wgpu::PresentMode::Mailbox);
        let config = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format,
            color_space: wgpu::SurfaceColorSpace::default(),
            width: 0,
            height: 0,
            present_mode: if has_mailbox { wgpu::PresentMode::Mailbox } else { wgpu::PresentMode::Fifo },
            desired_maximum_frame_latency: 1,
            alpha_mode: wgpu::CompositeAlphaMode::Auto,
            view_formats: Vec::new(),
        };
        // An error here must not count as a device failure: the device continues to blur while the CPU draws.
        let made = device.with_error_scope(|| {
            let canvas = Canvas::new(Arc::clone(&device), format);
            let size = window.inner_size();
            let surface = Some(surface);
            let mut gpu = Self { device: Arc::clone(&device), window, surface, config, configured: false, canvas };
            gpu.resize((size.width, size.height));
            gpu
        });
        made.map_err(to_present_error)
    }

    /// Configures the surface with `config`, unless the window has zero size.
    fn configure(&mut self) {
        self.configured = self.config.width > 0 && self.config.height > 0;
        if let Some(surface) = self.surface.as_ref().filter(|_| self.configured) {
            surface.configure(&self.device.device, &self.config);
        }
    }

    /// Returns the next texture to draw to; `None` while the window is not visible.
    fn next_texture(&mut self) -> Result<Option<wgpu::SurfaceTexture>, PresentError> {
        use wgpu::CurrentSurfaceTexture as Current;
        // A second attempt after the surface was reconfigured or recreated.
        for _ in 0..2 {
            let Some(surface) = &self.surface else { return Ok(None) };
            match surface.get_current_texture() {
                Current::Success(texture) | Current::Suboptimal(texture) => return Ok(Some(texture)),
                Current::Timeout | Current::Occluded => return Ok(None),
                Current::Outdated => self.configure(),
                Current::Lost => {
                    self.device.check().map_err(to_present_error)?;
                    self.surface = Some(create_surface(&self.window, &self.device)?);
                    self.configure();
                }
                Current::Validation => self.device.check().map_err(to_present_error)?,
            }
        }
        Ok(None)
    }
}

fn to_present_error(error: impl std::fmt::Display) -> PresentError {
    PresentError(error.to_string())
}

impl Drop for GpuPresenter {
    fn drop(&mut self) {
        // Freeing the surface of a hung device would block forever, so it is leaked.
        if self.device.check().is_err() {
            std::mem::forget(self.surface.take());
        }
    }
}

fn create_surface(window: &Arc<Window>, device: &Device) -> Result<wgpu::Surface<'static>, PresentError> {
    let surface = device.instance.create_surface(Arc::clone(window)).map_err(to_present_error)?;
    if !device.adapter.is_surface_supported(&surface) {
        return Err(PresentError(format!("{} cannot draw to windows of this display", device.name)));
    }
    Ok(surface)
}

impl Presenter for GpuPresenter {
    fn resize(&mut self, (width, height): (u32, u32)) {
        if (self.config.width, self.config.height) == (width, height) && self.configured {
            return;
        }
        let max_side = self.device.device.limits().max_texture_dimension_2d;
        (self.config.width, self.config.height) = (width.min(max_side), height.min(max_side));
        self.configure();
    }

    fn set_controls(&mut self, controls: Controls) {
        self.canvas.set_controls(controls);
    }

    fn present(&mut self, drawing: &Drawing) -> Result<(), PresentError> {
        self.device.check().map_err(to_present_error)?;
        if !self.configured {
            return Ok(());
        }
        let Some(texture) = self.next_texture()? else { return Ok(()) };
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.canvas.draw(&view, (self.config.width, self.config.height), drawing);
        self.window.pre_present_notify();
        self.device.queue.present(texture);
        self.device.check().map_err(to_present_error)
    }

    fn uses_gpu(&self) -> bool {
        true
    }

    fn supports(&self, picture: &DevicePicture) -> bool {
        picture.is_on(&self.device)
    }
}
