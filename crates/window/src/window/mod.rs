//! The window: handles winit's events, and presents pictures and controls.
//!
//! Its thread never blocks for long. A new frame is presented immediately with the existing controls; the controls are
//! laid out again only after events.

mod app;
mod desktop;
mod gfx;
mod saved_state;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use egui_winit::accesskit_winit;
use winit::event_loop::EventLoop;

use app::App;
pub use saved_state::{SavedState, WindowSize};

use super::session;
use super::state::State;
use bokehcam::compute::device::Device;
use bokehcam::compute::panic_message;
use bokehcam_live::control::Claim;
use bokehcam_live::controller::CommandLine;
use bokehcam_live::stats::Report;

bokehcam::names::named! {
    /// The window's colours.
    pub enum ThemeChoice default Auto {
        /// Like the other windows of the desktop
        Auto = "auto",
        /// Dark text on light
        Light = "light",
        /// Light text on dark
        Dark = "dark",
    }
}

/// User events that wake the window's thread.
#[derive(Debug)]
enum UserEvent {
    /// The session sent an event.
    Session,
    /// A screen reader connected, disconnected, or requests an action.
    Accessibility(accesskit_winit::Event),
    /// The desktop's colour scheme changed.
    Theme(egui::Theme),
    /// A missing font was found.
    Fonts,
    /// Remote control sent a request.
    Control,
}

impl From<accesskit_winit::Event> for UserEvent {
    fn from(event: accesskit_winit::Event) -> Self {
        Self::Accessibility(event)
    }
}

/// Name of remote control, and its presets.
pub struct RemoteConfig {
    pub claim: Claim,
    pub command_line: CommandLine,
}

/// Configuration of a preview.
pub struct Preview {
    /// Initial state of the window.
    pub state: State,
    /// Configuration of the session.
    pub session: session::SessionConfig,
    /// Colour theme.
    pub theme: ThemeChoice,
    /// GPU to draw with, if any.
    pub device: Option<Arc<Device>>,
    /// Whether to close the window when the source ends.
    pub close_at_end: bool,
    /// State saved by the previous preview, and its file.
    pub saved_state: SavedState,
    pub saved_state_file: Option<PathBuf>,
    /// Remote control, or a line with the reason why it is unavailable.
    pub control: Result<RemoteConfig, String>,
    /// Closes the window once set.
    pub stop: Arc<AtomicBool>,
}

/// Result of a preview.
#[derive(Clone, Debug, Default)]
pub struct PreviewOutcome {
    /// Report of the last run.
    pub report: Option<Report>,
    /// Reason why the source delivered no frames when the window closed.
    pub source_error: Option<String>,
    /// Message of the first output that failed.
    pub output_error: Option<String>,
}

/// Reasons why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// There is no display server, or it refused the window.
    #[error("cannot open a window: {0}; without one, use `bokehcam stream SOURCE --to SINK`")]
    NoWindow(String),
    /// The window cannot be drawn to.
    #[error(transparent)]
    Present(#[from] super::present::PresentError),
    /// The session's thread cannot be created.
    #[error("cannot start the session's thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Shows the window until it is closed.
///
/// # Errors
/// Fails if there is no display, or the window cannot be drawn to.
pub fn run_preview(preview: Preview) -> Result<PreviewOutcome, WindowError> {
    let mut events = create_event_loop()?;
    let proxy = events.create_proxy();
    let mut app = App::new(preview, proxy)?;
    let ran = {
        use winit::platform::run_on_demand::EventLoopExtRunOnDemand;
        events.run_app_on_demand(&mut app)
    };
    let outcome = app.finish();
    ran.map_err(|error| WindowError::NoWindow(strip_source_location(&error)))?;
    outcome
}

/// Returns an error's text without the source location that winit puts before it.
fn strip_source_location(error: &impl std::fmt::Display) -> String {
    let text = error.to_string();
    match text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")) {
        Some((_, what)) => what.to_owned(),
        None => text,
    }
}

/// Creates the event loop. winit panics if a library that the display needs is missing: that becomes an error too, and
/// the panic hook is silenced meanwhile.
fn create_event_loop() -> Result<EventLoop<UserEvent>, WindowError> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let made = std::panic::catch_unwind(|| EventLoop::with_user_event().build());
    std::panic::set_hook(hook);
    match made {
        Ok(Ok(events)) => Ok(events),
        Ok(Err(error)) => Err(WindowError::NoWindow(strip_source_location(&error))),
        Err(panic) => Err(WindowError::NoWindow(panic_message(&*panic).to_owned())),
    }
}
