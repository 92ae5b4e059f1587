//! Camera controls that a person can adjust.

/// A camera control with a numeric value that a person understands: brightness, exposure, white balance, zoom, focus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraControl {
    /// Its name as `v4l2-ctl` writes it: `exposure_time_absolute`.
    pub name: String,
    /// Its current value.
    pub value: i64,
    /// Least and largest value, and the step between, at least 1.
    pub range: (i64, i64, i64),
    /// Value and name of each menu item; empty for other controls.
    pub menu: Vec<(i64, String)>,
    /// Whether it is boolean: 0 is off, 1 is on.
    pub is_boolean: bool,
    /// Whether it can be changed now, and has an effect.
    pub is_active: bool,
}
