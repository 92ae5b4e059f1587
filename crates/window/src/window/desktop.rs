//! Follows the desktop's colour scheme, light or dark, through its portal.
//!
//! The interface is <https://flatpak.github.io/xdg-desktop-portal/docs/doc-org.freedesktop.portal.Settings.html>.

use std::thread;

use egui::Theme;
use zbus::blocking::{Connection, Proxy};
use zbus::zvariant::{OwnedValue, Value};

const NAMESPACE: &str = "org.freedesktop.appearance";
const KEY: &str = "color-scheme";

/// Calls `on_theme` with the desktop's theme and each later one until it returns false; on its own thread, because a
/// portal may have to be started first. Never called without a session bus or a portal.
pub(super) fn watch_theme(on_theme: impl Fn(Theme) -> bool + Send + 'static) {
    let asked = thread::Builder::new().name("desktop".into()).spawn(move || {
        if let Err(error) = watch_portal(&on_theme) {
            tracing::debug!("the desktop does not report a colour scheme: {error}");
        }
    });
    if let Err(error) = asked {
        tracing::debug!("the desktop cannot be asked for its colour scheme: {error}");
    }
}

fn watch_portal(on_theme: &impl Fn(Theme) -> bool) -> zbus::Result<()> {
    let bus = Connection::session()?;
    let (name, path) = ("org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop");
    let portal = Proxy::new(&bus, name, path, "org.freedesktop.portal.Settings")?;
    // Subscribes first, so that no change is missed.
    let changes = portal.receive_signal("SettingChanged")?;
    // Old portals have only `Read`, which wraps the value once more.
    let asked = portal.call("ReadOne", &(NAMESPACE, KEY)).or_else(|_| portal.call("Read", &(NAMESPACE, KEY)));
    let now: OwnedValue = asked?;
    if !on_theme(parse_theme(&now)) {
        return Ok(());
    }
    for change in changes {
        let Ok((namespace, key, value)) = change.body().deserialize::<(String, String, OwnedValue)>() else { continue };
        if (namespace.as_str(), key.as_str()) == (NAMESPACE, KEY) && !on_theme(parse_theme(&value)) {
            break;
        }
    }
    Ok(())
}

/// Returns the theme for a colour scheme: 1 prefers dark, 2 light, others have no preference. The default is dark,
/// because pictures are judged best in dark surroundings.
fn parse_theme(scheme: &Value) -> Theme {
    match scheme {
        Value::Value(inner) => parse_theme(inner),
        Value::U32(2) => Theme::Light,
        _ => Theme::Dark,
    }
}
