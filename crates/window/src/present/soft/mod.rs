//! Presents on the CPU, through memory shared with the display server.

mod blend;
mod controls;
mod painter;
mod picture;
mod texture;
mod triangle;

use std::num::NonZeroU32;
use std::sync::Arc;

pub use painter::Painter;
use softbuffer::{Context, SoftBufferError, Surface};
use winit::window::Window;

use super::{Controls, Drawing, PresentError, Presenter};

/// The CPU presenter.
pub struct CpuPresenter {
    window: Arc<Window>,
    surface: Surface<Arc<Window>, Arc<Window>>,
    /// `None` while the window has zero size.
    size: Option<(NonZeroU32, NonZeroU32)>,
    painter: Painter,
}

impl CpuPresenter {
    /// Creates a presenter for a window; `painter` may already have controls.
    ///
    /// # Errors
    /// Fails if the display server does not support shared-memory buffers.
    pub fn new(window: Arc<Window>, painter: Painter) -> Result<Self, PresentError> {
        let context = Context::new(Arc::clone(&window)).map_err(to_present_error)?;
        let surface = Surface::new(&context, Arc::clone(&window)).map_err(to_present_error)?;
        let size = window.inner_size();
        let mut soft = Self { window, surface, size: None, painter };
        soft.resize((size.width, size.height));
        Ok(soft)
    }
}

fn to_present_error(error: SoftBufferError) -> PresentError {
    PresentError(error.to_string())
}

impl Presenter for CpuPresenter {
    fn resize(&mut self, size: (u32, u32)) {
        self.size = NonZeroU32::new(size.0).zip(NonZeroU32::new(size.1));
        self.painter.resize(size);
    }

    fn set_controls(&mut self, controls: Controls) {
        self.painter.set_controls(controls);
    }

    fn present(&mut self, drawing: &Drawing) -> Result<(), PresentError> {
        let Some((width, height)) = self.size else { return Ok(()) };
        self.surface.resize(width, height).map_err(to_present_error)?;
        let mut buffer = self.surface.buffer_mut().map_err(to_present_error)?;
        // The buffer may be longer than the window.
        let pixels = width.get() as usize * height.get() as usize;
        if let Some(pixels) = buffer.get_mut(..pixels) {
            self.painter.paint(pixels, drawing);
        }
        self.window.pre_present_notify();
        buffer.present().map_err(to_present_error)
    }
}
