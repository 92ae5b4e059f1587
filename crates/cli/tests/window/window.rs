//! A program's window on the screen.

use std::time::{Duration, Instant};

use bokehcam::frame::ColorImage;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConfigureWindowAux, ConnectionExt, EventMask, ImageFormat, Window as Id,
};

use super::picture;
use super::screen::{Screen, until};

/// How long anything on the screen may take; a machine with other work is slow, a program that hangs takes for ever.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A window.
pub struct Window<'a> {
    /// Where it is.
    pub screen: &'a Screen,
    /// Its number.
    pub id: Id,
}

impl<'a> Window<'a> {
    /// The window of a process, if it has one.
    pub fn of(screen: &'a Screen, pid: u32) -> Option<Self> {
        let windows = screen.property(screen.root, "_NET_CLIENT_LIST");
        let id = windows.into_iter().find(|window| screen.property(*window, "_NET_WM_PID") == [pid])?;
        Some(Self { screen, id })
    }

    /// What is written above it.
    pub fn title(&self) -> String {
        let (x, title) = (&self.screen.x, self.screen.atom("_NET_WM_NAME"));
        let asked = x.get_property(false, self.id, title, self.screen.atom("UTF8_STRING"), 0, 1024).unwrap();
        asked.reply().map(|reply| String::from_utf8(reply.value).unwrap()).unwrap_or_default()
    }

    /// Width and height of what the program draws, in pixels.
    pub fn size(&self) -> (u32, u32) {
        let geometry = self.screen.x.get_geometry(self.id).unwrap().reply().unwrap();
        (geometry.width.into(), geometry.height.into())
    }

    /// Where its upper left corner is on the screen.
    pub fn place(&self) -> (i32, i32) {
        let at = self.screen.x.translate_coordinates(self.id, self.screen.root, 0, 0).unwrap().reply().unwrap();
        (at.dst_x.into(), at.dst_y.into())
    }

    /// Asks for another size, and does not wait for it.
    pub fn resize(&self, width: u32, height: u32) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.screen.x.configure_window(self.id, &size).unwrap();
        self.screen.x.flush().unwrap();
    }

    /// Puts it away.
    pub fn minimise(&self) {
        const ICONIC: u32 = 3;
        self.screen.ask_manager(self.id, "WM_CHANGE_STATE", [ICONIC, 0, 0, 0, 0]);
        until("the window is put away", PATIENCE, || self.has_state("_NET_WM_STATE_HIDDEN"));
    }

    /// Brings it back, and to the front.
    pub fn bring_back(&self) {
        const BY_A_PERSON: u32 = 2;
        self.screen.ask_manager(self.id, "_NET_ACTIVE_WINDOW", [BY_A_PERSON, 0, 0, 0, 0]);
        until("the window is back", PATIENCE, || !self.has_state("_NET_WM_STATE_HIDDEN") && self.is_active());
    }

    /// Whether keys go to it.
    pub fn is_active(&self) -> bool {
        self.screen.property(self.screen.root, "_NET_ACTIVE_WINDOW") == [self.id]
    }

    /// Whether it fills the screen.
    pub fn is_full_screen(&self) -> bool {
        self.has_state("_NET_WM_STATE_FULLSCREEN")
    }

    fn has_state(&self, name: &str) -> bool {
        self.screen.property(self.id, "_NET_WM_STATE").contains(&self.screen.atom(name))
    }

    /// Asks the program to close it, as the button in its frame does.
    pub fn close(&self) {
        let (protocols, delete) = (self.screen.atom("WM_PROTOCOLS"), self.screen.atom("WM_DELETE_WINDOW"));
        let message = ClientMessageEvent::new(32, self.id, protocols, [delete, 0, 0, 0, 0]);
        self.screen.x.send_event(false, self.id, EventMask::NO_EVENT, message).unwrap();
        self.screen.x.flush().unwrap();
    }

    /// What is seen of it now; nothing while it is not on the screen.
    pub fn look(&self) -> Option<ColorImage> {
        let (width, height) = self.size();
        let (wide, high) = (u16::try_from(width).unwrap(), u16::try_from(height).unwrap());
        let asked = self.screen.x.get_image(ImageFormat::Z_PIXMAP, self.id, 0, 0, wide, high, u32::MAX).unwrap();
        // Resized meanwhile, or put away.
        let reply = asked.reply().ok()?;
        let mut image = ColorImage::new(width, height);
        for (rgb, bgrx) in image.rgb.as_chunks_mut::<3>().0.iter_mut().zip(reply.data.as_chunks::<4>().0) {
            *rgb = [bgrx[2], bgrx[1], bgrx[0]];
        }
        Some(image)
    }

    /// Waits until it looks so; a picture of what it looked like is kept otherwise.
    #[track_caller]
    pub fn until(&self, what: &str, is: impl FnMut(&ColorImage) -> bool) -> ColorImage {
        self.until_within(what, PATIENCE, is)
    }

    /// As [`Window::until`].
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
