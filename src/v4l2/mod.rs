//! Video4Linux: what capture, live depth and the virtual camera share. The one place that names the crate `v4l`.

pub mod controls;
pub mod device;
pub mod holders;
pub mod layout;
pub mod modes;
pub mod node;

pub use device::Device;
pub use layout::{FourCc, Layout};
