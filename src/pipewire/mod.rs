//! PipeWire: cameras that the programs of a session share, without a kernel module.
//!
//! A camera is a node of the class `Video/Source` with the role `Camera`; [`node`] makes one, [`graph`] lists those that
//! there are, and [`reader`] reads from one. Everything of PipeWire's belongs to the thread that made it, so each node and
//! each reader has a thread of its own, which is woken by a counter of the kernel's (`wake`): no lock is taken on a frame's
//! way.

mod buffer;
mod error;
pub mod graph;
pub mod mode;
pub mod node;
mod param;
mod quiet;
pub mod reader;
mod session;
mod wake;

pub use error::PipeWireError;

/// The group of the nodes that this program filters a camera with: what is in it is not given the filter itself.
fn group() -> String {
    format!("bokehcam-{}", std::process::id())
}

/// Whether there is a socket where the daemon of this session is looked for.
pub fn is_there() -> bool {
    std::path::Path::new(&session::socket()).exists()
}
