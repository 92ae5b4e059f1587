//! Video4Linux: what capture, live depth and the virtual camera share. The one place that names the crate `v4l`.

pub mod audience;
pub mod controls;
pub mod device;
pub mod events;
pub mod holders;
mod layout;
pub mod live;
pub mod loopback;
pub mod modes;
pub mod node;
pub mod queue;

pub use crate::layout::{FourCc, Layout};
pub use device::Device;
