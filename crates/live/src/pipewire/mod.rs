//! PipeWire: cameras shared by the programs of a session, without a kernel module.
//!
//! A camera is a node of the class `Video/Source` with the role `Camera`; [`node`] creates one, [`graph`] lists them,
//! [`watch`] tells when they come and go, and [`reader`] reads from one. PipeWire's objects belong to the thread that created them, so each node and each
//! reader has a thread of its own, which an eventfd (`wake`) wakes: no lock is taken on a frame's path.

mod buffer;
mod error;
pub mod graph;
mod log;
pub mod memory;
pub mod mode;
pub mod node;
pub mod param;
pub mod reader;
pub mod session;
mod wake;
pub mod watch;

/// For cameras of the tests.
pub use ::pipewire as bindings;
pub use error::PipeWireError;
use error::Result;

/// Returns the link group of the nodes with which this program filters a camera: group members are not connected to the
/// filter itself.
fn link_group() -> String {
    format!("bokehcam-{}", std::process::id())
}

/// Whether the socket of this session's daemon exists.
pub fn is_available() -> bool {
    std::path::Path::new(&session::socket_path()).exists()
}
