//! Control of a run by other programs: one line of JSON as request, one as answer, over a socket in the user's runtime
//! folder.
//!
//! `docs/ctl.md` describes the protocol. Every run has a name and listens at `$XDG_RUNTIME_DIR/bokehcam/NAME.sock`
//! ([`claim_name`]); [`client`] sends requests. Separate threads serve them: nothing here waits for a frame, and no frame
//! waits for anything here.

#[cfg_attr(not(feature = "desktop"), path = "no_bus.rs")]
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
pub use server::{CLIENT_TIMEOUT, Claim, Handler, MAX_CLIENTS, Server, claim_name};

/// An error that prevents the control of a run.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The user has no folder for sockets.
    #[error("{0}")]
    NoFolder(String),
    /// Another run has this name.
    #[error("another run is called {0} already: choose another --name")]
    NameTaken(Name),
    /// A file that is not a run's socket has this name.
    #[error("{} exists and does not belong to a run: choose another --name", .0.display())]
    NotASocket(PathBuf),
    /// There is no run.
    #[error("no stream or preview is running: start one with `bokehcam stream` or `bokehcam preview`")]
    NoRuns,
    /// There are several runs, and no name was given.
    #[error("several are running: {}; choose one with --name", .0.join(", "))]
    SeveralRuns(Vec<String>),
    /// There is no run with this name.
    #[error("no run is called {name}: {}", if there.is_empty() { "nothing is running".into() } else { format!("there is {}", there.join(", ")) })]
    NoSuchRun { name: Name, there: Vec<String> },
    /// The run did not answer in time, or the answer is malformed.
    #[error("{name} does not answer: {why}")]
    NoAnswer { name: String, why: String },
}
