//! Video4Linux support shared by capture, live depth and the virtual camera. The only module that names the crate
//! `v4l`.

pub mod controls;
pub mod device;
pub mod events;
pub mod holders;
pub mod layout;
pub mod live;
pub mod loopback;
pub mod modes;
pub mod node;
pub mod queue;
pub mod reader_monitor;

pub use crate::layout::{FourCc, Layout};
pub use device::Device;
