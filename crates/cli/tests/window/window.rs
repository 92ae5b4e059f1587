//! A program's window on the private screen.

use std::time::{Duration, Instant};

use bokehcam::frame::ColorImage;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConfigureWindowAux, ConnectionExt, EventMask, ImageFormat, MapState, Window as Id,
};

use super::picture;
use super::screen::{Screen, until};

/// The timeout for anything on the screen: long, because the machine may be busy; only a hang exceeds it.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A top-level X window.
pub struct Window<'a> {
    /// The screen that contains the window.
    pub screen: &'a Screen,
    /// The X window id.
    pub id: Id,
}

impl<'a> Window<'a> {
    /// Finds the window of a process.
    pub fn of(screen: &'a Screen, pid: u32) -> Option<Self> {
        let windows = screen.property(screen.root, "_NET_CLIENT_LIST");
        let id = windows.into_iter().find(|window| screen.property(*window, "_NET_WM_PID") == [pid])?;
        Some(Self { screen, id })
    }

    /// Returns the window title.
    pub fn title(&self) -> String {
        let (x, title) = (&self.screen.x, self.screen.atom("_NET_WM_NAME"));
        let asked = x.get_property(false, self.id, title, self.screen.atom("UTF8_STRING"), 0, 1024).unwrap();
        asked.reply().map(|reply| String::from_utf8(reply.value).unwrap()).unwrap_or_default()
    }

    /// Returns width and height of the client area, in pixels.
    pub fn size(&self) -> (u32, u32) {
        let geometry = self.screen.x.get_geometry(self.id).unwrap().reply().unwrap();
        (geometry.width.into(), geometry.height.into())
    }

    /// Returns the screen position of the upper left corner, in pixels.
    pub fn place(&self) -> (i32, i32) {
        let at = self.screen.x.translate_coordinates(self.id, self.screen.root, 0, 0).unwrap().reply().unwrap();
        (at.dst_x.into(), at.dst_y.into())
    }

    /// Requests another size without waiting for it.
    pub fn resize(&self, width: u32, height: u32) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.screen.x.configure_window(self.id, &size).unwrap();
        self.screen.x.flush().unwrap();
    }

    /// Minimises the window, and waits until it is off the screen.
    pub fn minimise(&self) {
        const ICONIC: u32 = 3;
        self.screen.ask_manager(self.id, "WM_CHANGE_STATE", [ICONIC, 0, 0, 0, 0]);
        // Openbox states it before the window is unmapped.
        until("the window is put away", PATIENCE, || {
            self.has_state("_NET_WM_STATE_HIDDEN") && !self.is_on_the_screen()
        });
    }

    fn is_on_the_screen(&self) -> bool {
        let attributes = self.screen.x.get_window_attributes(self.id).unwrap().reply().unwrap();
        attributes.map_state == MapState::VIEWABLE
    }

    /// Restores and raises the window.
    pub fn bring_back(&self) {
        const BY_A_PERSON: u32 = 2;
        self.screen.ask_manager(self.id, "_NET_ACTIVE_WINDOW", [BY_A_PERSON, 0, 0, 0, 0]);
        until("the window is back", PATIENCE, || !self.has_state("_NET_WM_STATE_HIDDEN") && self.is_active());
    }

    /// Whether the window has the keyboard focus.
    pub fn is_active(&self) -> bool {
        self.screen.property(self.screen.root, "_NET_ACTIVE_WINDOW") == [self.id]
    }

    /// Whether the window is in full-screen mode.
    pub fn is_full_screen(&self) -> bool {
        self.has_state("_NET_WM_STATE_FULLSCREEN")
    }

    fn has_state(&self, name: &str) -> bool {
        self.screen.property(self.id, "_NET_WM_STATE").contains(&self.screen.atom(name))
    }

    /// Requests a close, as the button in the window's frame does.
    pub fn close(&self) {
        let (protocols, delete) = (self.screen.atom("WM_PROTOCOLS"), self.screen.atom("WM_DELETE_WINDOW"));
        let message = ClientMessageEvent::new(32, self.id, protocols, [delete, 0, 0, 0, 0]);
        self.screen.x.send_event(false, self.id, EventMask::NO_EVENT, message).unwrap();
        self.screen.x.flush().unwrap();
    }

    /// Captures the window's content; `None` while it is not on the screen.
    pub fn look(&self) -> Option<ColorImage> {
        let (width, height) = self.size();
        let (wide, high) = (u16::try_from(width).unwrap(), u16::try_from(height).unwrap());
        let asked = self.screen.x.get_image(ImageFormat::Z_PIXMAP, self.id, 0, 0, wide, high, u32::MAX).unwrap();
        // The capture fails if the window was resized or minimised meanwhile.
        let reply = asked.reply().ok()?;
        let mut image = ColorImage::new(width, height);
        for (rgb, bgrx) in image.rgb.as_chunks_mut::<3>().0.iter_mut().zip(reply.data.as_chunks::<4>().0) {
            *rgb = [bgrx[2], bgrx[1], bgrx[0]];
        }
        Some(image)
    }

    /// Waits until the captured window satisfies `is`; saves the last picture on timeout.
    #[track_caller]
    pub fn until(&self, what: &str, is: impl FnMut(&ColorImage) -> bool) -> ColorImage {
        self.until_within(what, PATIENCE, is)
    }

    /// Like [`Window::until`], with another timeout.
    #[track_caller]
    pub fn until_within(&self, what: &str, within: Duration, mut is: impl FnMut(&ColorImage) -> bool) -> ColorImage {
        let began = Instant::now();
        let mut last = None;
        while began.elapsed() < within {
            if let Some(image) = self.look() {
                if is(&image) {
                    return image;
                }
                last = Some(image);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let seen = last.map_or("nothing was seen".to_owned(), |image| picture::keep(&image, what));
        panic!("not within {within:?}: {what}; {seen}");
    }
}
