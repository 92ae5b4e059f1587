//! The window: winit's events in, pictures and controls out.
//!
//! Its thread does nothing that can take long. A frame that comes is shown at once with the controls as they are;
//! controls are laid out anew when something happened to them, and five times a second while instruments are shown.

mod app;
mod desktop;
mod gfx;
mod memory;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use egui_winit::accesskit_winit;
use winit::event_loop::EventLoop;

use app::App;
pub use memory::{Memory, Size};

use super::session;
use super::state::State;
use bokehcam::compute::device::Device;
use bokehcam::control::Claim;
use bokehcam::controller::Rules;
use bokehcam::stats::Report;

bokehcam::names::named! {
    /// The window's colours.
    pub enum ThemeChoice default Auto {
        /// As the desktop's other windows
        Auto = "auto",
        /// Dark text on light
        Light = "light",
        /// Light text on dark
        Dark = "dark",
    }
}

/// What the window's thread is woken for.
#[derive(Debug)]
enum Call {
    /// The session has told something.
    Session,
    /// A screen reader came, went, or wants something done.
    Access(accesskit_winit::Event),
    /// The desktop has these colours now.
    Theme(egui::Theme),
    /// The system has a font for a text.
    Fonts,
    /// Somebody asks for something from outside.
    Control,
}

impl From<accesskit_winit::Event> for Call {
    fn from(event: accesskit_winit::Event) -> Self {
        Self::Access(event)
    }
}

/// The name that others control a preview by, and what they are understood and allowed to.
pub struct Control {
    pub claim: Claim,
    pub rules: Arc<dyn Rules>,
}

/// What a preview begins with.
pub struct Preview {
    /// What the window shows first.
    pub state: State,
    /// What the session starts with.
    pub session: session::Start,
    /// Its colours.
    pub theme: ThemeChoice,
    /// The GPU to draw with, if any.
    pub device: Option<Arc<Device>>,
    /// Close the window when the source ends.
    pub close_at_end: bool,
    /// What is remembered of the preview before, and where.
    pub memory: Memory,
    pub memory_file: Option<PathBuf>,
    /// By what others control it, or the line that says why they cannot.
    pub control: Result<Control, String>,
    /// Once set, the window closes.
    pub stop: Arc<AtomicBool>,
}

/// How a preview ended.
#[derive(Clone, Debug, Default)]
pub struct Ended {
    /// The report of the last run.
    pub report: Option<Report>,
    /// Why there were no frames (any more), where that was so when the window closed.
    pub lost: Option<String>,
    /// Why an output failed, if one did.
    pub unwritten: Option<String>,
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// No display server, or one that refuses.
    #[error("there can be no window: {0}; without one, `bokehcam stream SOURCE --to SINK` does the same")]
    NoWindow(String),
    /// It cannot be drawn to.
    #[error(transparent)]
    Present(#[from] super::present::PresentError),
    /// The system gives no thread.
    #[error("cannot start the session's thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Shows the window until it is closed.
///
/// # Errors
/// There is no display, or the window cannot be drawn to.
pub fn show(preview: Preview) -> Result<Ended, WindowError> {
    let mut events = event_loop()?;
    let proxy = events.create_proxy();
    let mut app = App::new(preview, proxy)?;
    let ran = {
        use winit::platform::run_on_demand::EventLoopExtRunOnDemand;
        events.run_app_on_demand(&mut app)
    };
    let ended = app.end();
    ran.map_err(|error| WindowError::NoWindow(plain(&error)))?;
    ended
}

/// An error's text without the location in its library's source, which winit puts before it.
fn plain(error: &impl std::fmt::Display) -> String {
    let text = error.to_string();
    match text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")) {
        Some((_, what)) => what.to_owned(),
        None => text,
    }
}

/// The event loop. winit panics if a library that the display needs is missing: that becomes an error, too, and the
/// panic hook is silenced meanwhile.
fn event_loop() -> Result<EventLoop<Call>, WindowError> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let made = std::panic::catch_unwind(|| EventLoop::with_user_event().build());
    std::panic::set_hook(hook);
    match made {
        Ok(Ok(events)) => Ok(events),
        Ok(Err(error)) => Err(WindowError::NoWindow(plain(&error))),
        Err(panic) => {
            let why = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
            Err(WindowError::NoWindow(why.unwrap_or("a library is missing").to_owned()))
        }
    }
}
