//! Sources that are found, offered and chosen while the session goes on.

use std::sync::mpsc;
use std::time::Duration;

use super::Host;
use crate::services::Browse;
use crate::session::Order;
use crate::state::{Request, Update};
use bokehcam::files::whole;
use bokehcam::look::BehindName;

/// So often, at most, it is seen which devices there are, and how large a recording is.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

impl Host {
    /// The next order; meanwhile, looks which devices there are. `None` where nobody is left to give orders.
    pub(super) fn next(&mut self, inbox: &mpsc::Receiver<Order>) -> Option<Order> {
        loop {
            match inbox.recv_timeout(LOOK_PERIOD) {
                Ok(order) => return Some(order),
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    self.tell_size();
                    self.look_for_devices();
                }
                Err(mpsc::RecvTimeoutError::Disconnected) => return None,
            }
        }
    }

    /// Tells how large the recording is by now.
    fn tell_size(&self) {
        let recording = self.start.outputs.iter().find(|output| !output.is_camera);
        let bytes = recording.and_then(|output| whole::bytes_so_far(output.name.as_ref()));
        bytes.into_iter().for_each(|bytes| self.news.tell(Update::Recorded(bytes)));
    }

    pub(super) fn tell_choices(&mut self) {
        let sources = self.start.services.sources();
        let virtual_cameras = self.start.services.virtual_cameras();
        self.news.tell(Update::Choices { sources, virtual_cameras });
        self.news.tell(Update::Presets(self.start.services.settings().presets()));
    }

    /// Tells which sources there are, if those of the system are others by now, and opens the one that was missing.
    fn look_for_devices(&mut self) {
        if !self.start.services.devices_changed() {
            return;
        }
        self.tell_choices();
        let is_there = self.start.services.sources().iter().any(|choice| choice.name == self.start.source);
        if self.live.is_none() && is_there && self.start.source.starts_with("/dev/") {
            self.open();
        }
    }

    /// Tells the window to open a source that somebody offers, unless that cannot be one: then what runs goes on.
    pub(super) fn offer(&self, name: String) {
        match self.start.services.check(&name) {
            Ok(()) => self.news.tell(Update::Offered(name)),
            Err(line) => self.news.note(line),
        }
    }

    /// Asks the person for a file or folder, on a thread of its own.
    pub(super) fn browse(&self, what: Browse) {
        let (orders, news) = (self.orders.clone(), self.news.clone());
        let pick = self.start.services.browse(what);
        let asked = std::thread::Builder::new().name("dialog".into()).spawn(move || match pick() {
            Ok(Some(file)) if what == Browse::Behind => match BehindName::Image(file.into()).load() {
                Ok(behind) => news.tell(Update::Behind(behind)),
                Err(error) => news.note(error.to_string()),
            },
            Ok(Some(name)) => drop(orders.send(Order::Do(Request::Offer(name)))),
            Ok(None) => {}
            Err(line) => news.note(line),
        });
        if let Err(error) = asked {
            self.news.note(format!("there is no dialog: {error}"));
        }
    }

    /// Opens the camera again with other pictures.
    pub(super) fn set_mode(&mut self, size: (u32, u32), fps: f64) {
        self.start.services.choose_mode(&self.start.source, size, fps);
        self.stop();
        self.open();
    }
}
