//! Neural networks for bokehcam.
//!
//! | layer | modules |
//! |---|---|
//! | 1 | [`single_camera`]: mattes and depth of one camera |
//! | 0 | [`network`]: loads and runs networks, without trusting their files |

pub mod network;
pub mod single_camera;
