//! The sizes and rates of a camera, and whether it faces the user.

pub use super::cameras::{faces_user, list_modes};

/// A picture size of a camera, and its frame rates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mode {
    /// Width and height.
    pub size: (u32, u32),
    /// Frames per second, in descending order.
    pub fps: Vec<f64>,
}
