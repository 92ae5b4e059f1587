//! The window on the screen, and what draws in it.

use std::sync::Arc;

use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event_loop::ActiveEventLoop;
use winit::window::{Fullscreen, Window};

use super::WindowError;
use super::memory::Size;
use crate::present::{self, Area, Part, Presenter, enlarged, fitted};
use crate::state::Zoom;
use bokehcam::compute::device::Device;

/// The window, egui's input from it, and its presenter.
pub(super) struct Gfx {
    pub window: Arc<Window>,
    pub input: egui_winit::State,
    pub presenter: Box<dyn Presenter>,
}

/// The application id that desktops group windows by.
const CLASS: &str = "bokehcam";
const FIRST_SIZE: LogicalSize<f64> = LogicalSize::new(1280.0, 720.0);
const LEAST_SIZE: LogicalSize<f64> = LogicalSize::new(240.0, 160.0);

impl Gfx {
    /// Opens the window, in the size that is remembered.
    ///
    /// # Errors
    /// The display refuses it, or nothing can draw in it.
    pub fn open(
        events: &ActiveEventLoop,
        ctx: &egui::Context,
        size: Option<Size>,
        full_screen: bool,
        device: Option<Arc<Device>>,
    ) -> Result<Self, WindowError> {
        use winit::platform::{wayland::WindowAttributesExtWayland, x11::WindowAttributesExtX11};
        let inner = size.map_or(FIRST_SIZE, |size| LogicalSize::new(size.width, size.height));
        let wanted = Window::default_attributes()
            .with_title(CLASS)
            .with_inner_size(inner)
            .with_min_inner_size(LEAST_SIZE)
            .with_maximized(size.is_some_and(|size| size.maximized))
            .with_fullscreen(full_screen.then_some(Fullscreen::Borderless(None)));
        let wanted = WindowAttributesExtX11::with_name(wanted, CLASS, CLASS);
        let wanted = WindowAttributesExtWayland::with_name(wanted, CLASS, CLASS);
        let window = events.create_window(wanted).map_err(|error| WindowError::NoWindow(error.to_string()))?;
        let window = Arc::new(window);
        let mut presenter = present::create(Arc::clone(&window), device)?;
        let PhysicalSize { width, height } = window.inner_size();
        presenter.resize((width, height));
        let scale = window.scale_factor() as f32;
        let input = egui_winit::State::new(
            ctx.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(scale),
            window.theme(),
            Some(MOST_TEXTURE_PX),
        );
        Ok(Self { window, input, presenter })
    }

    /// Where a picture of `size` lies in the window, in the `room` at its top left that the panel leaves: centred, as large as fits
    /// or enlarged, and then which part of it is seen.
    pub fn area(&self, size: (u32, u32), room: (u32, u32), zoom: Zoom, mirror: bool) -> (Area, Option<Part>) {
        let PhysicalSize { width, height } = self.window.inner_size();
        // Until the controls are laid out for a new size, the room is of the size before.
        let room = (room.0.min(width), room.1.min(height));
        if zoom.factor == 0 {
            return (fitted(size, room), None);
        }
        let [x, y] = zoom.center;
        let (area, part) = enlarged(size, room, zoom.factor, [if mirror { 1.0 - x } else { x }, y]);
        (area, Some(part))
    }

    /// The size to remember; `None` in full screen, whose size is not the window's own.
    pub fn size(&self) -> Option<Size> {
        let LogicalSize { width, height } = self.window.inner_size().to_logical::<f64>(self.window.scale_factor());
        let maximized = self.window.is_maximized();
        (self.window.fullscreen().is_none() && width > 0.0).then_some(Size { width, height, maximized })
    }
}

/// Any GPU takes textures of this size.
const MOST_TEXTURE_PX: usize = 4096;
