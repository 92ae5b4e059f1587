//! Control of a run by others: one line of JSON asks, one line answers, over a socket in the user's runtime folder.
//!
//! `docs/ctl.md` is the description for those who speak it. Every run has a name, and listens at
//! `$XDG_RUNTIME_DIR/bokehcam/NAME.sock` ([`claim`]); [`client`] asks. Threads of its own serve it: nothing here waits for
//! a frame, and no frame waits for anything here.

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
pub use protocol::{Answer, MOST_REQUEST_BYTES, Request, Status};
pub use server::{Claim, Handler, MOST_CLIENTS, PATIENCE, Server, claim};

/// Why a run cannot be controlled.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The user has no folder for sockets.
    #[error("{0}")]
    NoFolder(String),
    /// Another run has this name.
    #[error("another run is called {0} already: choose another --name")]
    Taken(Name),
    /// Something that is no run of ours has this name.
    #[error("{} is in the way, and is not of a run: choose another --name", .0.display())]
    InTheWay(PathBuf),
    /// Nothing runs.
    #[error("nothing runs that can be controlled: begin with `bokehcam stream` or `bokehcam preview`")]
    Nothing,
    /// None of several runs was chosen.
    #[error("several run: {}; choose one with --name", .0.join(", "))]
    Several(Vec<String>),
    /// No run is called so.
    #[error("no run is called {name}: {}", if there.is_empty() { "nothing runs".into() } else { format!("there is {}", there.join(", ")) })]
    NoSuch { name: Name, there: Vec<String> },
    /// It did not answer in time, or not in the way that was expected.
    #[error("{name} does not answer: {why}")]
    Silent { name: String, why: String },
}
