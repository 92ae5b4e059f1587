//! The icon in the desktop's tray: a StatusNotifierItem, by
//! <https://www.freedesktop.org/wiki/Specifications/StatusNotifierItem/>. A click switches the camera off and on.

use std::thread;

use zbus::blocking::{Connection, Proxy};
use zbus::interface;
use zbus::zvariant::ObjectPath;

use super::Camera;
use crate::control::Request;

/// Where trays look for items.
pub(super) const PATH: &str = "/StatusNotifierItem";
const INTERFACE: &str = "org.kde.StatusNotifierItem";
/// Who collects the items.
const WATCHER: &str = "org.kde.StatusNotifierWatcher";
/// Of the package, and of every icon theme.
const ON: &str = "bokehcam";
const OFF: &str = "camera-disabled-symbolic";

/// The icon.
pub(super) struct Item(pub Camera);

/// A picture: columns, rows, bytes. There are none: icons have names.
type Pixmap = (i32, i32, Vec<u8>);

#[interface(name = "org.kde.StatusNotifierItem")]
impl Item {
    /// A click.
    fn activate(&self, _x: i32, _y: i32) {
        self.press();
    }

    /// A click with the middle button.
    fn secondary_activate(&self, _x: i32, _y: i32) {
        self.press();
    }

    /// There is no menu.
    fn context_menu(&self, _x: i32, _y: i32) {}

    /// The next preset, or the one before.
    fn scroll(&self, delta: i32, _orientation: &str) {
        let seen = self.0.seen().clone();
        let Some(count) = std::num::NonZeroUsize::new(seen.presets.len()) else { return };
        let at = seen.presets.iter().position(|name| *name == seen.preset);
        let next = match (at, delta > 0) {
            (None, _) => 0,
            (Some(at), true) => (at + count.get() - 1) % count,
            (Some(at), false) => (at + 1) % count,
        };
        if let Err(error) = self.0.ask(Request::Preset { name: seen.presets[next].clone() }) {
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
        if self.0.seen().is_on { ON } else { OFF }
    }

    #[zbus(property)]
    fn icon_pixmap(&self) -> Vec<Pixmap> {
        Vec::new()
    }

    /// Icon, its pixmaps, title and text.
    #[zbus(property)]
    fn tool_tip(&self) -> (String, Vec<Pixmap>, String, String) {
        let seen = self.0.seen();
        let is = if seen.is_on { "on; a click switches it off" } else { "off; a click switches it on" };
        let look = if seen.preset.is_empty() { String::new() } else { format!(", {}", seen.preset) };
        (String::new(), Vec::new(), format!("{}{look}", seen.source), format!("The camera is {is}"))
    }

    #[zbus(property)]
    fn item_is_menu(&self) -> bool {
        false
    }

    /// As trays know one that has none.
    #[zbus(property)]
    fn menu(&self) -> ObjectPath<'_> {
        ObjectPath::from_static_str_unchecked("/NO_DBUSMENU")
    }
}

impl Item {
    fn press(&self) {
        if let Err(error) = self.0.ask(Request::Toggle) {
            tracing::warn!("{error}");
        }
    }
}

/// Tells trays to look again.
pub(super) fn changed(bus: &Connection) -> zbus::Result<()> {
    for signal in ["NewIcon", "NewToolTip"] {
        bus.emit_signal(None::<&str>, PATH, INTERFACE, signal, &())?;
    }
    Ok(())
}

/// Tells the collector of the icon, and each later one, as desktops start theirs anew.
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
    // First of all, so that none is missed.
    let owners = daemon.receive_signal_with_args("NameOwnerChanged", &[(0, WATCHER)])?;
    tell(bus);
    for change in owners {
        let Ok((_, _, new)) = change.body().deserialize::<(String, String, String)>() else { continue };
        if !new.is_empty() {
            tell(bus);
        }
    }
    Ok(())
}

fn tell(bus: &Connection) {
    let own = bus.unique_name().map(|name| name.as_str().to_owned()).unwrap_or_default();
    let path = "/StatusNotifierWatcher";
    if let Err(error) = bus.call_method(Some(WATCHER), path, Some(WATCHER), "RegisterStatusNotifierItem", &own) {
        tracing::debug!("no tray: {error}");
    }
}
