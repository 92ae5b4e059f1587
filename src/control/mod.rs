//! Control of a run by other programs: one line of JSON as request, one as answer, over a socket in the user's runtime
//! folder.
//!
//! `docs/ctl.md` describes the protocol. Every run has a name and listens at `$XDG_RUNTIME_DIR/bokehcam/NAME.sock`
//! ([`claim`]); [`client`] sends requests. Separate threads serve them: nothing here waits for a frame, and no frame
//! waits for anything here.

#[cfg(feature = "desktop")]
pub mod bus;
pub mod client;
mod folder;
mod name;
mod protocol;
mod server;
mod socket;

use std::path::PathBuf;

pub use name::Name;
pub use protocol::{Answer, MAX_REQUEST_BYTES, Request, Status};
pub use server::{Claim, Handler, MAX_CLIENTS, PATIENCE, Server, claim};

/// An error that prevents the control of a run.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The user has no folder for sockets.
    #[error("{0}")]
    NoFolder(String),
    /// Another run has this name.
    #[error("another run is called {0} already: choose another --name")]
    Taken(Name),
    /// A file that is not a run's socket has this name.
    #[error("{} is in the way, and is not of a run: choose another --name", .0.display())]
    InTheWay(PathBuf),
    /// There is no run.
    #[error("nothing runs that can be controlled: begin with `bokehcam stream` or `bokehcam preview`")]
    Nothing,
    /// There are several runs, and no name was given.
    #[error("several run: {}; choose one with --name", .0.join(", "))]
    Several(Vec<String>),
    /// There is no run with this name.
    #[error("no run is called {name}: {}", if there.is_empty() { "nothing runs".into() } else { format!("there is {}", there.join(", ")) })]
    NoSuch { name: Name, there: Vec<String> },
    /// The run did not answer in time, or the answer is malformed.
    #[error("{name} does not answer: {why}")]
    Silent { name: String, why: String },
}
