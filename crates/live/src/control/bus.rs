//! Control of a run over the D-Bus session bus: properties and signals for desktops, and a tray icon.
//!
//! `docs/ctl.md` describes the interface. Requests go to the same handler as those of the socket. Every change,
//! whatever its origin, is emitted as a signal, so that no client has to poll.

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

/// The well-known bus name; if another run has it, this one queues until that has ended.
const NAME: &str = "io.github.bokehcam.bokehcam";
const PATH: &str = "/io/github/bokehcam/bokehcam";

/// The state of a run, as desktops see it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct State {
    is_on: bool,
    /// The preset that was requested last; empty once a setting was changed after it.
    preset: String,
    source: String,
    presets: Vec<String>,
}

/// The request handler; `None` once the run ends.
type HandlerSlot = Arc<Mutex<Option<Arc<Handler>>>>;

/// The run's D-Bus object.
#[derive(Clone)]
struct CameraObject {
    handler: HandlerSlot,
    state: Arc<Mutex<State>>,
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

impl CameraObject {
    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    fn send_request(&self, request: Request) -> fdo::Result<()> {
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
impl CameraObject {
    /// Switches between on and off.
    fn toggle(&self) -> fdo::Result<()> {
        self.send_request(Request::Toggle)
    }

    /// Applies the look of a preset.
    fn set_preset(&self, name: String) -> fdo::Result<()> {
        self.send_request(Request::Preset { name })
    }

    /// Whether pictures are shown; otherwise the still card is.
    #[zbus(property)]
    fn active(&self) -> bool {
        self.state().is_on
    }

    /// The current preset; empty if the settings belong to none.
    #[zbus(property)]
    fn preset(&self) -> String {
        self.state().preset.clone()
    }

    #[zbus(property(emits_changed_signal = "const"))]
    fn presets(&self) -> Vec<String> {
        self.state().presets.clone()
    }

    #[zbus(property(emits_changed_signal = "const"))]
    fn source(&self) -> String {
        self.state().source.clone()
    }
}

/// A run's presence on the bus, until this is dropped.
pub struct Bus {
    handler: HandlerSlot,
}

/// Publishes a run with these presets on the bus. Returns the handler to use from now on in place of `handler`: it also
/// reports changes to the bus.
///
/// # Errors
/// Returns one line if there is no session bus, or it refuses.
pub fn serve(handler: Arc<Handler>, presets: Vec<String>) -> Result<(Bus, Arc<Handler>), String> {
    let state = Arc::new(Mutex::new(State { presets, ..State::default() }));
    let (changed, changes) = mpsc::channel();
    let recorded_state = Arc::clone(&state);
    let handler: Arc<Handler> = Arc::new(move |request: Request| {
        let original_request = request.clone();
        let answer = handler(request);
        if let Answer::Done { status, .. } = &answer {
            record_change(&mut lock(&recorded_state), &original_request, status);
            // The bus thread may have ended.
            let _ = changed.send(());
        }
        answer
    });
    // Fills the initial state.
    handler(Request::Status);
    let slot: HandlerSlot = Arc::new(Mutex::new(Some(Arc::clone(&handler))));
    let camera = CameraObject { handler: Arc::clone(&slot), state: Arc::clone(&state) };
    let refused = |error: zbus::Error| format!("the session's message bus: {error}");
    let bus = Builder::session()
        .and_then(|builder| builder.serve_at(PATH, camera.clone()))
        .and_then(|builder| builder.serve_at(tray::PATH, tray::Item(camera)))
        .and_then(Builder::build)
        .map_err(refused)?;
    // Without waiting for the reply: if another run owns the name, this one is queued.
    bus.call_method(
        Some("org.freedesktop.DBus"),
        "/org/freedesktop/DBus",
        Some("org.freedesktop.DBus"),
        "RequestName",
        &(NAME, 0_u32),
    )
    .map_err(refused)?;
    tray::register(&bus);
    let emitted = lock(&state).clone();
    let emit = move || {
        emit_changes(&bus, emitted, &state, &changes);
        // Leaves the bus and the tray.
        let _ = bus.close();
    };
    thread::Builder::new().name("bus".into()).spawn(emit).map_err(|error| error.to_string())?;
    Ok((Bus { handler: slot }, handler))
}

/// Records what a request has changed.
fn record_change(state: &mut State, original_request: &Request, status: &Status) {
    (state.is_on, state.source) = (status.on, status.source.clone());
    match original_request {
        Request::Preset { name } => state.preset.clone_from(name),
        Request::Set { .. } => state.preset.clear(),
        _ => {}
    }
}

/// Emits a signal for each change of state, until the handler is dropped.
fn emit_changes(bus: &Connection, mut emitted: State, state: &Mutex<State>, changes: &Receiver<()>) {
    while let Ok(()) = changes.recv() {
        let now = lock(state).clone();
        if now == emitted {
            continue;
        }
        if let Err(error) = emit_change(bus, &emitted, &now) {
            tracing::debug!("the session's message bus: {error}");
        }
        emitted = now;
    }
}

fn emit_change(bus: &Connection, before: &State, now: &State) -> zbus::Result<()> {
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
    tray::emit_changed(bus)
}

impl Drop for Bus {
    fn drop(&mut self) {
        // The thread that emits changes ends with the last handler.
        drop(lock(&self.handler).take());
    }
}
