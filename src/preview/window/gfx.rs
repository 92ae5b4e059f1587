//! The window on the screen, and what draws in it.

use std::sync::Arc;

use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event_loop::ActiveEventLoop;
use winit::window::{Fullscreen, Window};

use super::WindowError;
use super::memory::Size;
use crate::compute::device::Device;
use crate::preview::present::{self, Area, Part, Presenter, enlarged};
use crate::preview::state::Zoom;

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

/// The largest area with the aspect ratio of `size` within `window`, centred.
fn fitted(size: (u32, u32), window: (u32, u32)) -> Area {
    let [width, height, all_width, all_height] = [size.0, size.1, window.0, window.1].map(u64::from);
    if width == 0 || height == 0 || all_width == 0 || all_height == 0 {
        return Area::default();
    }
    // Whichever side limits; the other is rounded to whole pixels.
    let fills_width = all_width * height <= all_height * width;
    let (fit_width, fit_height) = match fills_width {
        true => (all_width, (all_width * height + width / 2) / width),
        false => ((all_height * width + height / 2) / height, all_height),
    };
    let (fit_width, fit_height) = (fit_width.clamp(1, all_width), fit_height.clamp(1, all_height));
    // All four are at most the window's sides.
    let px = |side: u64| u32::try_from(side).unwrap_or(u32::MAX);
    let (x, y) = (px((all_width - fit_width) / 2), px((all_height - fit_height) / 2));
    Area { x, y, width: px(fit_width), height: px(fit_height) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_is_as_large_as_it_fits_and_keeps_its_shape() {
        let area = |x, y, width, height| Area { x, y, width, height };
        assert_eq!(fitted((640, 360), (1280, 720)), area(0, 0, 1280, 720));
        assert_eq!(fitted((640, 480), (1280, 720)), area(160, 0, 960, 720));
        assert_eq!(fitted((640, 360), (300, 720)), area(0, 275, 300, 169));
        assert_eq!(fitted((1, 5000), (300, 200)), area(149, 0, 1, 200));
        assert_eq!(fitted((640, 360), (0, 720)), Area::default());
        assert_eq!(fitted((0, 0), (300, 200)), Area::default());
    }
}
