//! The window, its input, and its presenter.

use std::sync::Arc;

use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event_loop::ActiveEventLoop;
use winit::window::{Fullscreen, Window};

use super::WindowError;
use super::saved_state::WindowSize;
use crate::present::{self, Area, Presenter, VisibleRegion, fitted_area, zoomed_area};
use crate::state::Zoom;
use bokehcam::compute::device::Device;

/// The window, egui's input from it, and its presenter.
pub(super) struct Gfx {
    pub window: Arc<Window>,
    pub input: egui_winit::State,
    pub presenter: Box<dyn Presenter>,
}

/// Application id by which desktops group windows.
const APP_ID: &str = "bokehcam";
const DEFAULT_SIZE: WindowSize = WindowSize { width: 1280.0, height: 720.0, maximized: false };
const MIN_SIZE: LogicalSize<f64> = LogicalSize::new(240.0, 160.0);

impl Gfx {
    /// Opens the window with the saved size, limited to the screen.
    ///
    /// # Errors
    /// Fails if the display refuses the window, or no presenter can draw to it.
    pub fn open(
        events: &ActiveEventLoop,
        ctx: &egui::Context,
        size: Option<WindowSize>,
        full_screen: bool,
        device: Option<Arc<Device>>,
    ) -> Result<Self, WindowError> {
        use winit::platform::{wayland::WindowAttributesExtWayland, x11::WindowAttributesExtX11};
        // Wayland names no primary screen, and its compositor limits the window itself.
        let screen = events.primary_monitor().or_else(|| events.available_monitors().next());
        let screen = screen.map(|screen| screen.size().to_logical::<f64>(screen.scale_factor()));
        let size = size.unwrap_or(DEFAULT_SIZE);
        let size = screen.map_or(size, |screen| size.limited_to((screen.width, screen.height)));
        let attributes = Window::default_attributes()
            .with_title(APP_ID)
            .with_inner_size(LogicalSize::new(size.width, size.height))
            .with_min_inner_size(MIN_SIZE)
            .with_maximized(size.maximized)
            .with_fullscreen(full_screen.then_some(Fullscreen::Borderless(None)));
        // X11 and Wayland set the application id separately.
        let attributes = WindowAttributesExtX11::with_name(attributes, APP_ID, APP_ID);
        let attributes = WindowAttributesExtWayland::with_name(attributes, APP_ID, APP_ID);
        let window = events.create_window(attributes).map_err(|error| WindowError::NoWindow(error.to_string()))?;
        let window = Arc::new(window);
        let mut presenter = present::create_presenter(Arc::clone(&window), device)?;
        let PhysicalSize { width, height } = window.inner_size();
        presenter.resize((width, height));
        let scale = window.scale_factor() as f32;
        let input = egui_winit::State::new(
            ctx.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(scale),
            window.theme(),
            Some(MAX_TEXTURE_PX),
        );
        Ok(Self { window, input, presenter })
    }

    /// Returns the picture's area within `available`, the part of the window that the panel leaves at its top left: centred,
    /// fitted or zoomed, with the visible part if zoomed.
    pub fn picture_area(
        &self,
        size: (u32, u32),
        available: (u32, u32),
        zoom: Zoom,
        mirror: bool,
    ) -> (Area, Option<VisibleRegion>) {
        let PhysicalSize { width, height } = self.window.inner_size();
        // Until the next layout, the available area may be that of a previous, larger window.
        let available = (available.0.min(width), available.1.min(height));
        if zoom.factor == 0 {
            return (fitted_area(size, available), None);
        }
        let [x, y] = zoom.center;
        let (area, visible_region) = zoomed_area(size, available, zoom.factor, [if mirror { 1.0 - x } else { x }, y]);
        (area, Some(visible_region))
    }

    /// Returns the size to save; `None` in full screen, which is not the window's own size.
    pub fn size_to_save(&self) -> Option<WindowSize> {
        let LogicalSize { width, height } = self.window.inner_size().to_logical::<f64>(self.window.scale_factor());
        let maximized = self.window.is_maximized();
        (self.window.fullscreen().is_none() && width > 0.0).then_some(WindowSize { width, height, maximized })
    }
}

/// Maximum texture side; every GPU supports it.
const MAX_TEXTURE_PX: usize = 4096;
