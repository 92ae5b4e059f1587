//! The desktop's colour scheme, as its portal tells it: light and dark follow the desktop while the window is open.
//!
//! The interface is <https://flatpak.github.io/xdg-desktop-portal/docs/doc-org.freedesktop.portal.Settings.html>.

use std::thread;

use egui::Theme;
use zbus::blocking::{Connection, Proxy};
use zbus::zvariant::{OwnedValue, Value};

const NAMESPACE: &str = "org.freedesktop.appearance";
const KEY: &str = "color-scheme";

/// Calls `tell` with the desktop's theme, and with each later one until that gives back false; from a thread of its own,
/// since a portal may have to be started first. Where there is no session bus or no portal, it is never called.
pub(super) fn follow(tell: impl Fn(Theme) -> bool + Send + 'static) {
    let asked = thread::Builder::new().name("desktop".into()).spawn(move || {
        if let Err(error) = listen(&tell) {
            tracing::debug!("the desktop tells no colour scheme: {error}");
        }
    });
    if let Err(error) = asked {
        tracing::debug!("the desktop is not asked for its colour scheme: {error}");
    }
}

fn listen(tell: &impl Fn(Theme) -> bool) -> zbus::Result<()> {
    let bus = Connection::session()?;
    let (name, path) = ("org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop");
    let portal = Proxy::new(&bus, name, path, "org.freedesktop.portal.Settings")?;
    // First of all, so that no change is missed.
    let changes = portal.receive_signal("SettingChanged")?;
    // `Read` is what old portals have; it wraps the value once more.
    let asked = portal.call("ReadOne", &(NAMESPACE, KEY)).or_else(|_| portal.call("Read", &(NAMESPACE, KEY)));
    let now: OwnedValue = asked?;
    if !tell(theme(&now)) {
        return Ok(());
    }
    for change in changes {
        let Ok((namespace, key, value)) = change.body().deserialize::<(String, String, OwnedValue)>() else { continue };
        if (namespace.as_str(), key.as_str()) == (NAMESPACE, KEY) && !tell(theme(&value)) {
            break;
        }
    }
    Ok(())
}

/// The theme of a colour scheme: 1 prefers dark, 2 light, and all else has no preference, which is dark here, as pictures
/// are judged best in dark surroundings.
fn theme(scheme: &Value) -> Theme {
    match scheme {
        Value::Value(inner) => theme(inner),
        Value::U32(2) => Theme::Light,
        _ => Theme::Dark,
    }
}
