//! Puts the window's content on the screen, with two equivalent presenters.
//!
//! `gpu` draws on the device that blurs, so that blurred pictures need not be read back; `soft` draws on the CPU into
//! memory shared with the display server, if there is no GPU.

mod fallback;
pub mod gpu;
pub mod soft;
mod split;
mod visible_region;

use std::sync::Arc;

pub use split::Split;
pub use visible_region::{VisibleRegion, fitted_area, zoomed_area};
use winit::window::Window;

use bokehcam::compute::device::{Device, DevicePicture};
use bokehcam::frame::ColorImage;

/// A rectangle of the window, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Area {
    /// Offset from the left; the area lies within the window.
    pub x: u32,
    /// Offset from the top.
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// A picture, in memory or on a GPU.
#[derive(Clone, Copy, Debug)]
pub enum Image<'a> {
    Memory(&'a ColorImage),
    /// On a GPU; only a presenter that [supports](Presenter::supports) it can show it.
    Device(&'a DevicePicture),
}

impl Image<'_> {
    pub fn size(&self) -> (u32, u32) {
        match self {
            Self::Memory(picture) => picture.size(),
            Self::Device(picture) => picture.size(),
        }
    }
}

/// The content below the controls.
#[derive(Clone, Copy, Debug)]
pub struct Drawing<'a> {
    /// Area of the picture, which is scaled to fill it; the rest of the window is background.
    pub area: Area,
    /// Visible part of a zoomed picture, which fills the area with unscaled square pixels instead.
    pub visible_region: Option<VisibleRegion>,
    pub picture: Image<'a>,
    /// A picture of the same size to show left of this fraction of the displayed width.
    pub before: Option<(&'a ColorImage, f32)>,
    /// Whether pictures are mirrored; the split is not.
    pub mirror: bool,
    /// Whether pictures are shown grey and dim, because no new ones arrive.
    pub stale: bool,
    /// Background colour, sRGB.
    pub background: [u8; 3],
}

/// Weights of a stale picture, grey and dim: each channel is `(r * R + g * G + b * B) / 2^FRACTION_BITS`.
pub struct StaleTone;

impl StaleTone {
    /// Weights of red, green and blue: luma (BT.601) times 0.6.
    pub const LUMA_WEIGHTS: [u32; 3] = [11_757, 23_082, 4_483];
    /// Fractional bits of the weights.
    pub const FRACTION_BITS: u32 = 16;
}

/// Updated controls from egui.
#[derive(Clone)]
pub struct Controls {
    pub primitives: Vec<egui::ClippedPrimitive>,
    /// Textures to set before drawing and to free after.
    pub textures: egui::TexturesDelta,
    /// Window pixels per point.
    pub pixels_per_point: f32,
}

/// Shows pictures and controls in a window.
pub trait Presenter {
    /// Sets the window's size in pixels; with zero size, nothing is shown.
    fn resize(&mut self, size: (u32, u32));

    /// Replaces the controls.
    fn set_controls(&mut self, controls: Controls);

    /// Shows the drawing with the controls over it.
    ///
    /// # Errors
    /// Fails if the window cannot be drawn to any more.
    fn present(&mut self, drawing: &Drawing) -> Result<(), PresentError>;

    /// Whether it can show this picture directly from the GPU; otherwise the picture must be in memory.
    fn supports(&self, picture: &DevicePicture) -> bool {
        let _ = picture;
        false
    }

    /// Whether it draws with a GPU, so that blurred pictures may stay there.
    fn uses_gpu(&self) -> bool {
        false
    }
}

/// The window cannot be drawn to.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw to the window: {0}")]
pub struct PresentError(pub String);

/// Creates a presenter for `window`: on the GPU if there is a `device`; on the CPU without one, if the device cannot
/// draw to the window, or once it fails.
///
/// # Errors
/// Fails if neither can draw to it.
pub fn create_presenter(window: Arc<Window>, device: Option<Arc<Device>>) -> Result<Box<dyn Presenter>, PresentError> {
    if let Some(device) = device {
        match gpu::GpuPresenter::new(Arc::clone(&window), device) {
            Ok(gpu) => {
                return Ok(Box::new(fallback::FallbackPresenter::new(Box::new(gpu), |painter| {
                    create_cpu_presenter(window, painter)
                })));
            }
            Err(error) => tracing::info!("drawing on the CPU: {error}"),
        }
    }
    create_cpu_presenter(window, soft::Painter::new())
}

fn create_cpu_presenter(window: Arc<Window>, painter: soft::Painter) -> Result<Box<dyn Presenter>, PresentError> {
    Ok(Box::new(soft::CpuPresenter::new(window, painter)?))
}
