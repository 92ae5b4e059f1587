//! A run on the session's message bus: switches and signals for desktops, and an icon in their tray.
//!
//! `docs/ctl.md` describes the interface. What is asked here goes to the same handler as what comes by the socket, and each
//! change, whoever asked for it, is told as the bus has it: nothing is looked at again and again.

mod tray;

use std::collections::HashMap;
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use zbus::blocking::Connection;
use zbus::blocking::connection::Builder;
use zbus::zvariant::Value;
use zbus::{fdo, interface};

use super::{Answer, Handler, Request, Status};

/// What the run is called on the bus; the next one there is waits until this one has ended.
const NAME: &str = "io.github.bokehcam.bokehcam";
const PATH: &str = "/io/github/bokehcam/bokehcam";

/// What desktops see of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Seen {
    is_on: bool,
    /// The preset that was asked for last, where no setting was changed since.
    preset: String,
    source: String,
    presets: Vec<String>,
}

/// Who answers, until the run ends.
type Slot = Arc<Mutex<Option<Arc<Handler>>>>;

/// The run and what is known of it.
#[derive(Clone)]
struct Camera {
    handler: Slot,
    seen: Arc<Mutex<Seen>>,
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Camera {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        lock(&self.seen)
    }

    fn ask(&self, request: Request) -> fdo::Result<()> {
        let handler = lock(&self.handler).clone();
        let handler = handler.ok_or_else(|| fdo::Error::Failed("it is ending".into()))?;
        match handler(request) {
            Answer::Refused { error, usage: true } => Err(fdo::Error::InvalidArgs(error)),
            Answer::Refused { error, usage: false } => Err(fdo::Error::Failed(error)),
            Answer::Done { .. } | Answer::Saved { .. } => Ok(()),
        }
    }
}

#[interface(name = "io.github.bokehcam.Camera")]
impl Camera {
    /// Off if it is on, else on.
    fn toggle(&self) -> fdo::Result<()> {
        self.ask(Request::Toggle)
    }

    /// Takes the look of a preset.
    fn set_preset(&self, name: String) -> fdo::Result<()> {
        self.ask(Request::Preset { name })
    }

    /// Whether pictures go out; else the still card.
    #[zbus(property)]
    fn active(&self) -> bool {
        self.seen().is_on
    }

    /// The preset that holds; empty where settings hold that are no preset's.
    #[zbus(property)]
    fn preset(&self) -> String {
        self.seen().preset.clone()
    }

    #[zbus(property(emits_changed_signal = "const"))]
    fn presets(&self) -> Vec<String> {
        self.seen().presets.clone()
    }

    #[zbus(property(emits_changed_signal = "const"))]
    fn source(&self) -> String {
        self.seen().source.clone()
    }
}

/// A run on the bus, until this is dropped.
pub struct Bus {
    handler: Slot,
}

/// Puts a run on the bus, which shows these presets. Gives the handler that is to be asked from now on in place of `handler`:
/// it tells of changes.
///
/// # Errors
/// There is no session bus, or it refuses: one line.
pub fn serve(handler: Arc<Handler>, presets: Vec<String>) -> Result<(Bus, Arc<Handler>), String> {
    let seen = Arc::new(Mutex::new(Seen { presets, ..Seen::default() }));
    let (changed, changes) = mpsc::channel();
    let noted = Arc::clone(&seen);
    let handler: Arc<Handler> = Arc::new(move |request: Request| {
        let asked = request.clone();
        let answer = handler(request);
        if let Answer::Done { status, .. } = &answer {
            note(&mut lock(&noted), &asked, status);
            // The bus may have gone.
            let _ = changed.send(());
        }
        answer
    });
    // What is seen at first.
    handler(Request::Status);
    let slot: Slot = Arc::new(Mutex::new(Some(Arc::clone(&handler))));
    let camera = Camera { handler: Arc::clone(&slot), seen: Arc::clone(&seen) };
    let refused = |error: zbus::Error| format!("the session's message bus: {error}");
    let bus = Builder::session()
        .and_then(|builder| builder.serve_at(PATH, camera.clone()))
        .and_then(|builder| builder.serve_at(tray::PATH, tray::Item(camera)))
        .and_then(Builder::build)
        .map_err(refused)?;
    // Without a reply: where another run has the name, this one waits for it.
    bus.call_method(
        Some("org.freedesktop.DBus"),
        "/org/freedesktop/DBus",
        Some("org.freedesktop.DBus"),
        "RequestName",
        &(NAME, 0_u32),
    )
    .map_err(refused)?;
    tray::register(&bus);
    let told = lock(&seen).clone();
    let tell = move || {
        tell(&bus, told, &seen, &changes);
        // Gone from the bus, and from the tray.
        let _ = bus.close();
    };
    thread::Builder::new().name("bus".into()).spawn(tell).map_err(|error| error.to_string())?;
    Ok((Bus { handler: slot }, handler))
}

/// Takes note of what was done.
fn note(seen: &mut Seen, asked: &Request, status: &Status) {
    (seen.is_on, seen.source) = (status.on, status.source.clone());
    match asked {
        Request::Preset { name } => seen.preset.clone_from(name),
        Request::Set { .. } => seen.preset.clear(),
        _ => {}
    }
}

/// Tells the bus of changes, until nobody can ask any more.
fn tell(bus: &Connection, mut told: Seen, seen: &Mutex<Seen>, changes: &Receiver<()>) {
    while let Ok(()) = changes.recv() {
        let now = lock(seen).clone();
        if now == told {
            continue;
        }
        if let Err(error) = told_of(bus, &told, &now) {
            tracing::debug!("the session's message bus: {error}");
        }
        told = now;
    }
}

fn told_of(bus: &Connection, before: &Seen, now: &Seen) -> zbus::Result<()> {
    let mut changed = HashMap::new();
    if before.is_on != now.is_on {
        changed.insert("Active", Value::from(now.is_on));
    }
    if before.preset != now.preset {
        changed.insert("Preset", Value::from(now.preset.as_str()));
    }
    let none: [&str; 0] = [];
    let body = ("io.github.bokehcam.Camera", changed, &none[..]);
    bus.emit_signal(None::<&str>, PATH, "org.freedesktop.DBus.Properties", "PropertiesChanged", &body)?;
    tray::changed(bus)
}

impl Drop for Bus {
    fn drop(&mut self) {
        // The thread that tells of changes ends with the last who can ask for one.
        drop(lock(&self.handler).take());
    }
}
