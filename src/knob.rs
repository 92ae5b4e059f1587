//! What of a camera a person turns.

/// A control with a number that a person understands: brightness, exposure, white balance, zoom, focus and the like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Knob {
    /// Its name as tools write it: `exposure_time_absolute`.
    pub name: String,
    /// What it is set to.
    pub value: i64,
    /// Least and largest value, and the step between, at least 1.
    pub range: (i64, i64, i64),
    /// Names of the values of a menu, by value; empty otherwise.
    pub menu: Vec<(i64, String)>,
    /// Whether it is on (1) or off (0).
    pub switch: bool,
    /// Whether it can be changed now, and has an effect.
    pub active: bool,
}
