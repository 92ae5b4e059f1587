//! Video4Linux: what capture, live depth and the virtual camera share. The one place that names the crate `v4l`.

pub mod audience;
pub mod device;
pub mod events;
pub mod holders;
pub mod loopback;

pub use device::Device;
