//! The tray icon, a StatusNotifierItem (<https://www.freedesktop.org/wiki/Specifications/StatusNotifierItem/>). A click
//! switches the camera off and on.

use std::thread;

use zbus::blocking::{Connection, Proxy};
use zbus::interface;
use zbus::zvariant::ObjectPath;

use super::CameraObject;
use crate::control::Request;

/// The object path at which trays expect items.
pub(super) const PATH: &str = "/StatusNotifierItem";
const INTERFACE: &str = "org.kde.StatusNotifierItem";
/// The service that collects the items.
const WATCHER: &str = "org.kde.StatusNotifierWatcher";
/// Icon names: `bokehcam` is installed with the package, the other one is in every icon theme.
const ON: &str = "bokehcam";
const OFF: &str = "camera-disabled-symbolic";

/// The tray item.
pub(super) struct Item(pub CameraObject);

/// A picture as width, height and bytes; always an empty list here, as icons are given by name.
type Pixmap = (i32, i32, Vec<u8>);

#[interface(name = "org.kde.StatusNotifierItem")]
impl Item {
    /// Handles a click.
    fn activate(&self, _x: i32, _y: i32) {
        self.toggle();
    }

    /// Handles a click with the middle button.
    fn secondary_activate(&self, _x: i32, _y: i32) {
        self.toggle();
    }

    /// Does nothing: there is no menu.
    fn context_menu(&self, _x: i32, _y: i32) {}

    /// Selects the next preset, or the previous one.
    fn scroll(&self, delta: i32, _orientation: &str) {
        let state = self.0.state().clone();
        let Some(count) = std::num::NonZeroUsize::new(state.presets.len()) else { return };
        let at = state.presets.iter().position(|name| *name == state.preset);
        let next = match (at, delta > 0) {
            (None, _) => 0,
            (Some(at), true) => (at + count.get() - 1) % count,
            (Some(at), false) => (at + 1) % count,
        };
        if let Err(error) = self.0.send_request(Request::Preset { name: state.presets[next].clone() }) {
            tracing::warn!("{error}");
        }
    }

    #[zbus(property)]
    fn category(&self) -> &str {
        "Hardware"
    }

    #[zbus(property)]
    fn id(&self) -> &str {
        "bokehcam"
    }

    #[zbus(property)]
    fn title(&self) -> &str {
        "bokehcam"
    }

    #[zbus(property)]
    fn status(&self) -> &str {
        "Active"
    }

    #[zbus(property)]
    fn window_id(&self) -> i32 {
        0
    }

    #[zbus(property)]
    fn icon_name(&self) -> &str {
        if self.0.state().is_on { ON } else { OFF }
    }

    #[zbus(property)]
    fn icon_pixmap(&self) -> Vec<Pixmap> {
        Vec::new()
    }

    /// Returns icon, pixmaps, title and text.
    #[zbus(property)]
    fn tool_tip(&self) -> (String, Vec<Pixmap>, String, String) {
        let state = self.0.state();
        let is = if state.is_on { "on; a click switches it off" } else { "off; a click switches it on" };
        let look = if state.preset.is_empty() { String::new() } else { format!(", {}", state.preset) };
        (String::new(), Vec::new(), format!("{}{look}", state.source), format!("The camera is {is}"))
    }

    #[zbus(property)]
    fn item_is_menu(&self) -> bool {
        false
    }

    /// Returns the path that stands for "no menu".
    #[zbus(property)]
    fn menu(&self) -> ObjectPath<'_> {
        ObjectPath::from_static_str_unchecked("/NO_DBUSMENU")
    }
}

impl Item {
    fn toggle(&self) {
        if let Err(error) = self.0.send_request(Request::Toggle) {
            tracing::warn!("{error}");
        }
    }
}

/// Signals trays to reload the icon and its text.
pub(super) fn emit_changed(bus: &Connection) -> zbus::Result<()> {
    for signal in ["NewIcon", "NewToolTip"] {
        bus.emit_signal(None::<&str>, PATH, INTERFACE, signal, &())?;
    }
    Ok(())
}

/// Registers the icon with the watcher, and again with each later one, as desktops may restart theirs.
pub(super) fn register(bus: &Connection) {
    let bus = bus.clone();
    let listen = move || {
        if let Err(error) = keep_registered(&bus) {
            tracing::debug!("the tray: {error}");
        }
    };
    if let Err(error) = thread::Builder::new().name("tray".into()).spawn(listen) {
        tracing::debug!("the tray: {error}");
    }
}

fn keep_registered(bus: &Connection) -> zbus::Result<()> {
    let daemon = Proxy::new(bus, "org.freedesktop.DBus", "/org/freedesktop/DBus", "org.freedesktop.DBus")?;
    // Subscribe before the first registration, so that no new owner is missed.
    let owners = daemon.receive_signal_with_args("NameOwnerChanged", &[(0, WATCHER)])?;
    register_item(bus);
    for change in owners {
        let Ok((_, _, new)) = change.body().deserialize::<(String, String, String)>() else { continue };
        if !new.is_empty() {
            register_item(bus);
        }
    }
    Ok(())
}

fn register_item(bus: &Connection) {
    let own = bus.unique_name().map(|name| name.as_str().to_owned()).unwrap_or_default();
    let path = "/StatusNotifierWatcher";
    if let Err(error) = bus.call_method(Some(WATCHER), path, Some(WATCHER), "RegisterStatusNotifierItem", &own) {
        tracing::debug!("no tray: {error}");
    }
}
