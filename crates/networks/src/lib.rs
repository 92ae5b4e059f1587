//! Neural networks for bokehcam: [`network`] runs them, [`single_camera`] makes mattes and depth of what they give.

pub mod network;
pub mod single_camera;
